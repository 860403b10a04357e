use std::any::Any;

use glam::{DAffine3, DMat3, DVec3};

use crate::{Interval, vectorized};

/// An axis-aligned box in world coordinates, ends included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Corner of smallest coordinates.
    pub min: DVec3,
    /// Corner of largest coordinates.
    pub max: DVec3,
}

impl Aabb {
    /// Box from its two corners.
    pub fn new(min: DVec3, max: DVec3) -> Self {
        debug_assert!(min.cmple(max).all(), "box corners out of order: {min} {max}");
        Self { min, max }
    }

    /// Smallest box about points; none about none.
    pub fn about(points: impl IntoIterator<Item = DVec3>) -> Option<Self> {
        let boxes = points.into_iter().map(|p| Self { min: p, max: p });
        boxes.reduce(Self::hull)
    }

    /// Smallest box about two.
    pub fn hull(self, other: Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    /// The box with `by` more on every side.
    pub fn widened(self, by: f64) -> Self {
        Self::new(self.min - by, self.max + by)
    }

    /// Middle of the box.
    pub fn center(&self) -> DVec3 {
        (self.min + self.max) * 0.5
    }

    /// Edge lengths.
    pub fn size(&self) -> DVec3 {
        self.max - self.min
    }

    /// Smallest axis-aligned box round the image of this box; sound up to the rounding of `map`.
    pub fn transformed(&self, map: &DAffine3) -> Self {
        let center = map.transform_point3(self.center());
        let half = self.size() * 0.5;
        let m = map.matrix3;
        let reach = m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z;
        // Terms that cancel in `center` have rounded all the same.
        let c = self.center().abs();
        let terms = m.x_axis.abs() * c.x + m.y_axis.abs() * c.y + m.z_axis.abs() * c.z;
        let slack = (terms + map.translation.abs() + reach) * (8.0 * f64::EPSILON);
        Self {
            min: center - reach - slack,
            max: center + reach + slack,
        }
    }
}

/// Value, gradient and Hessian of a field at one point, in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet {
    /// `f(x)`.
    pub value: f64,
    /// `∇f(x)`.
    pub gradient: DVec3,
    /// `∇²f(x)`, symmetric.
    pub hessian: DMat3,
}

/// A regular grid of cells laid over space, along which a field is sampled and meshed.
///
/// Node `(i, j, k)` lies at `world_from_grid · (i, j, k)`; nodes run from `0` to `cells` inclusive on each axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Grid coordinates (one unit per cell) to world.
    pub world_from_grid: DAffine3,
    /// Cells on each axis.
    pub cells: [u32; 3],
}

impl Frame {
    /// A grid of `cells` cells that fills `b`.
    pub fn over(b: &Aabb, cells: [u32; 3]) -> Self {
        let step = b.size() / DVec3::new(cells[0] as f64, cells[1] as f64, cells[2] as f64);
        Self {
            world_from_grid: DAffine3 {
                matrix3: DMat3::from_diagonal(step),
                translation: b.min,
            },
            cells,
        }
    }

    /// World position of node `(i, j, k)`.
    pub fn node(&self, ijk: [i64; 3]) -> DVec3 {
        self.world_from_grid
            .transform_point3(DVec3::new(ijk[0] as f64, ijk[1] as f64, ijk[2] as f64))
    }

    /// World box round the cells from node `lo` to node `hi`.
    pub fn world_box(&self, lo: [i64; 3], hi: [i64; 3]) -> Aabb {
        let v = |a: [i64; 3]| DVec3::new(a[0] as f64, a[1] as f64, a[2] as f64);
        Aabb {
            min: v(lo),
            max: v(hi),
        }
        .transformed(&self.world_from_grid)
    }
}

/// A scalar density over all of space: `f > c` is inside the solid, `f < c` outside, and the outward
/// normal is `-∇f/|∇f|`.
///
/// The defaults of the batch methods are the plain loops; an implementation overrides them only to be faster,
/// never to answer differently.
pub trait Field: Send + Sync {
    /// `f(p)`.
    fn value(&self, p: DVec3) -> f64;

    /// `f(p)` and `∇f(p)`.
    fn value_gradient(&self, p: DVec3) -> (f64, DVec3);

    /// Value, gradient and Hessian.
    fn jet(&self, p: DVec3) -> Jet;

    /// An interval that holds `f` everywhere in `b`: never too small, possibly too large.
    fn bounds(&self, b: &Aabb) -> Interval;

    /// Intervals that hold the three components of `∇f` everywhere in `b`, where there is a gradient; at creases the
    /// limits from all sides. Never too small; the whole line, as here, for a field that does not know.
    fn gradient_bounds(&self, b: &Aabb) -> [Interval; 3] {
        let _ = b;
        [Interval::EVERYTHING; 3]
    }

    /// A number that `‖∇²f‖` (Frobenius norm, world units) exceeds nowhere in `b`; never too small. Infinite, as here,
    /// for a field that does not know, and where the gradient jumps somewhere in `b`.
    fn hessian_bound(&self, b: &Aabb) -> f64 {
        let _ = b;
        f64::INFINITY
    }

    /// An interval that holds `f` everywhere on the segment between two points: never too small, possibly too large.
    fn bounds_along(&self, from: DVec3, to: DVec3) -> Interval {
        self.bounds(&Aabb {
            min: from.min(to),
            max: from.max(to),
        })
    }

    /// World boxes outside which, within `within`, this field and its bounds have the very bits that those of `before`
    /// have; all of `within`, as here, for fields that do not know how they follow from one another.
    fn changed_boxes(&self, before: &dyn Field, within: &Aabb) -> Vec<Aabb> {
        let _ = before;
        vec![*within]
    }

    /// The field itself, for [`Field::changed_boxes`] of its own kind to look into.
    fn as_any(&self) -> Option<&dyn Any> {
        None
    }

    /// [`Field::value_gradient`] of many points, in order.
    ///
    /// # Panics
    /// If the lengths differ.
    fn values_gradients(&self, points: &[DVec3], out: &mut [(f64, DVec3)]) {
        assert_eq!(points.len(), out.len(), "one output slot per point");
        for (p, o) in points.iter().zip(out) {
            *o = self.value_gradient(*p);
        }
    }

    /// [`Field::jet`] of many points, in order.
    ///
    /// # Panics
    /// If the lengths differ.
    fn jets(&self, points: &[DVec3], out: &mut [Jet]) {
        assert_eq!(points.len(), out.len(), "one output slot per point");
        for (p, o) in points.iter().zip(out) {
            *o = self.jet(*p);
        }
    }

    /// Values at the nodes `lo .. lo + count` of `frame`, last axis fastest, into `out`.
    ///
    /// The value of a node does not depend, to the bit, on the block it was asked with.
    ///
    /// # Panics
    /// If `out` is not `count[0]·count[1]·count[2]` long.
    fn frame_values(&self, frame: &Frame, lo: [i64; 3], count: [usize; 3], out: &mut [f64]) {
        values_node_by_node(self, frame, lo, count, out);
    }

    /// [`Field::frame_values`] of a field that has `known` among its branches, whose `values` at these nodes are given: so
    /// that field need not be asked again. The same values, to the bit; or nothing is done and the answer is false.
    ///
    /// # Panics
    /// As [`Field::frame_values`]; `values` has to be as long as `out`.
    fn frame_values_from(
        &self,
        known: &dyn Field,
        values: &[f64],
        frame: &Frame,
        lo: [i64; 3],
        count: [usize; 3],
        out: &mut [f64],
    ) -> bool {
        let _ = (known, values, frame, lo, count, out);
        false
    }

    /// [`Field::bounds`] over the cells of `frame` from node `lo` to node `hi`.
    fn frame_bounds(&self, frame: &Frame, lo: [i64; 3], hi: [i64; 3]) -> Interval {
        self.bounds(&frame.world_box(lo, hi))
    }

    /// [`Field::frame_bounds`] for a caller who only asks whether all of the cells lie on one side of `level`
    /// (`hi <= level` or `lo > level`): sound, but wider wherever that is cheaper and, but for rounding,
    /// changes no answer.
    fn frame_bounds_about(&self, frame: &Frame, lo: [i64; 3], hi: [i64; 3], level: f64) -> Interval {
        let _ = level;
        self.frame_bounds(frame, lo, hi)
    }
}

/// [`Field::frame_values`] by asking for one point after the other.
pub(crate) fn values_node_by_node<F: Field + ?Sized>(
    field: &F,
    frame: &Frame,
    lo: [i64; 3],
    count: [usize; 3],
    out: &mut [f64],
) {
    assert_eq!(
        out.len(),
        count.iter().product::<usize>(),
        "one output slot per node"
    );
    if count[2] == 0 {
        return;
    }
    let [x, y, z] = lo.map(|n| n as f64);
    let map = &frame.world_from_grid;
    for (row, values) in out.chunks_exact_mut(count[2]).enumerate() {
        let (i, j) = (x + (row / count[1]) as f64, y + (row % count[1]) as f64);
        vectorized(
            #[inline(always)]
            || {
                for (k, value) in values.iter_mut().enumerate() {
                    let node = DVec3::new(i, j, z + f64::from(k as u32));
                    *value = field.value(map.transform_point3(node));
                }
            },
        );
    }
}
