//! A sound interval over a box: the field is inside the convex hull of its control coefficients.

use std::ops::Range;

use glam::DVec3;

use super::brick::{BRICK, HALO, HALO_LEN};
use super::node::Node;
use super::spline::HierarchicalSpline;
use crate::placed_box::PlacedBox;
use crate::restrict::{RestrictedAxis, restricted_range};
use crate::{Aabb, Interval, Real, vectorized};

/// Distance, in cells of the finest level, within which the end of a box counts as lying on a knot plane.
const ON_KNOT: f64 = 1e-9;

/// What bounds are taken of: nodes that together hold the box's cells, wherever a question reaches.
pub(super) struct Roots<'a, I> {
    pub place: &'a PlacedBox,
    /// Finest level.
    pub finest: usize,
    pub nodes: I,
}

impl<T: Real> HierarchicalSpline<T> {
    pub(super) fn roots(&self) -> Roots<'_, std::iter::Once<&Node<T>>> {
        Roots {
            place: &self.place,
            finest: self.level_count() - 1,
            nodes: std::iter::once(&*self.root),
        }
    }
}

/// Moves the ends of a box that lie next to a knot plane of the finest level onto it, and says by how much in
/// cells, all ends together.
///
/// Boxes laid along the knots, as a mesher asks for, miss them by a rounding and would reach slivers of up to 26 more
/// bricks. In such a sliver of thickness `d` the one function that the cells on this side do not read has the
/// weight `d³/6 <= 2e-28`; that of the others changes the field by less than `2d` of the largest coefficient.
pub(super) fn onto_knots(finest: usize, b: &Aabb) -> (Aabb, f64) {
    let scale = (1u64 << finest) as f64;
    let mut moved = 0.0;
    let mut snap = |q: f64| {
        let knot = (q * scale).round();
        let distance = (q * scale - knot).abs();
        if distance > ON_KNOT {
            return q;
        }
        moved += distance;
        knot / scale
    };
    let snapped = Aabb {
        min: b.min.map(&mut snap),
        max: b.max.map(&mut snap),
    };
    (snapped, moved)
}

/// Interval of the field over a box given in lattice coordinates.
///
/// With a `level`, only as tight as it takes to tell on which side of it the field lies; the whole line as soon as
/// that cannot be told.
pub(super) fn over_lattice_box<'a, T: Real>(
    roots: Roots<'a, impl Iterator<Item = &'a Node<T>>>,
    b: &Aabb,
    level: Option<f64>,
) -> Interval {
    if !(b.min.is_finite() && b.max.is_finite()) {
        return Interval::EVERYTHING;
    }
    let extent = roots.place.max;
    let inside = Aabb {
        min: b.min.clamp(DVec3::ZERO, extent),
        max: b.max.clamp(DVec3::ZERO, extent),
    };
    let (snapped, moved) = onto_knots(roots.finest, &inside);
    let fall = roots.place.fall(b, &inside);
    let mut hull = Hull {
        lo: f64::INFINITY,
        hi: f64::NEG_INFINITY,
        magnitude: 0.0,
        // The fall may decide what the inside does not.
        level: level.filter(|_| fall == Interval::point(0.0)),
    };
    for node in roots.nodes {
        visit(node, &extent, &snapped, &mut hull);
    }
    if hull.is_undecided() {
        return Interval::EVERYTHING;
    }
    // Rounding of the restriction, and of evaluation in T, and what was moved, against the largest coefficient in
    // play.
    let share = 64.0 * T::UNIT_ROUND_OFF + 3.0 * RestrictedAxis::<T>::axis_error() + 2.0 * moved;
    let rounding = share * hull.magnitude;
    let interval = Interval::new(hull.lo, hull.hi).widened(rounding);
    interval - fall
}

struct Hull {
    lo: f64,
    hi: f64,
    /// Largest coefficient of the bricks visited.
    magnitude: f64,
    /// The one question that the hull is to answer, if there is one: on which side of this the field lies.
    level: Option<f64>,
}

impl Hull {
    fn add(&mut self, [lo, hi]: [f64; 2]) {
        self.lo = self.lo.min(lo);
        self.hi = self.hi.max(hi);
    }

    /// Adds the part of a brick in the box `b`.
    fn add_part<T: Real>(&mut self, brick: &Node<T>, b: &Aabb) {
        let within = local_box(brick, b);
        if self.level.is_some() {
            // Looking at the coefficients as they are costs a tenth of restricting them.
            let read = read_range(brick, &within);
            if self.is_told_by(read) {
                return self.add(read);
            }
        }
        let axes = within.map(|[a, b]| RestrictedAxis::new(a, b));
        let (lo, hi) = restricted_range(brick.own_totals(), &axes);
        self.add([lo.as_f64(), hi.as_f64()]);
    }

    /// Whether there are parts on both sides of the level, so that it does not matter what else there is.
    fn is_undecided(&self) -> bool {
        self.level.is_some_and(|c| self.lo <= c && c < self.hi)
    }

    /// Whether a part that lies within `lo ..= hi` need not be looked at more closely.
    fn is_told_by(&self, [lo, hi]: [f64; 2]) -> bool {
        self.level.is_some_and(|c| hi <= c || c < lo)
    }
}

/// Adds the range of a node over the part of `b` in it.
fn visit<T: Real>(node: &Node<T>, extent: &DVec3, b: &Aabb, hull: &mut Hull) {
    let [least, most] = node.hull.map(T::as_f64);
    if node.level >= 0 {
        hull.magnitude = hull.magnitude.max(least.abs()).max(most.abs());
    }
    // Nothing in this brick can widen the hull: the usual case in large boxes.
    if hull.lo <= least && most <= hull.hi || hull.is_undecided() {
        return;
    }
    let (corner, end) = corners(node, extent);
    let Some(part) = shared(b, corner, end) else {
        return;
    };
    if part.min == corner && part.max == end || hull.is_told_by([least, most]) {
        hull.magnitude = hull.magnitude.max(least.abs()).max(most.abs());
        return hull.add([least, most]);
    }
    if !node.has_children() {
        return hull.add_part(node, &part);
    }
    for octant in octants_met(node, extent, b) {
        if let Some(child) = node.child(octant) {
            visit(child, extent, b, hull);
        } else if let Some(part) = own_part(node, octant, extent, b) {
            hull.add_part(node, &part);
        }
    }
}

/// The octants of a node with which a box [shares](shared) a part, found axis by axis.
pub(super) fn octants_met<T: Real>(
    node: &Node<T>,
    extent: &DVec3,
    b: &Aabb,
) -> impl Iterator<Item = usize> + use<T> {
    let (corner, end) = corners(node, extent);
    let middle = corner + node.width() / 2.0;
    let met = |low: DVec3, high: DVec3| {
        let (min, max) = (b.min.max(low), b.max.min(high));
        (min.cmplt(max) | (min.cmpeq(max) & b.min.cmpeq(b.max))).bitmask() as usize
    };
    let halves = [met(corner, middle.min(end)), met(middle, end)];
    (0..8).filter(move |octant| (0..3).all(|a| halves[octant >> (2 - a) & 1] >> a & 1 == 1))
}

/// The box of a node's cells, in lattice coordinates.
pub(super) fn corners<T: Real>(node: &Node<T>, extent: &DVec3) -> (DVec3, DVec3) {
    let width = node.width();
    let corner = DVec3::from_array(node.key.0.map(|k| k as f64 * width));
    (corner, (corner + width).min(*extent))
}

/// The part of `b` in an octant that a brick evaluates itself.
pub(super) fn own_part<T: Real>(node: &Node<T>, octant: usize, extent: &DVec3, b: &Aabb) -> Option<Aabb> {
    node.totals.as_ref()?;
    let (corner, end) = corners(node, extent);
    let half = node.width() / 2.0;
    let low = corner + DVec3::from_array([2, 1, 0].map(|a| (octant >> a & 1) as f64 * half));
    shared(b, low, (low + half).min(end))
}

/// The part of `b` between `low` and `high`. None where they share just a face, which the brick on its other side
/// covers as well (the field is continuous), unless `b` is no thicker than that itself.
pub(super) fn shared(b: &Aabb, low: DVec3, high: DVec3) -> Option<Aabb> {
    let part = Aabb {
        min: b.min.max(low),
        max: b.max.min(high),
    };
    let thick =
        (0..3).all(|a| part.min[a] < part.max[a] || (part.min[a] == part.max[a] && b.min[a] == b.max[a]));
    thick.then_some(part)
}

/// A box in the cells of a brick, `0 ..= 8` on each axis.
pub(super) fn local_box<T: Real>(brick: &Node<T>, b: &Aabb) -> [[f64; 2]; 3] {
    let scale = brick.scale();
    std::array::from_fn(|a| {
        let first = (BRICK as u32 * brick.key.0[a]) as f64;
        [b.min[a], b.max[a]].map(|q| (q * scale - first).clamp(0.0, BRICK as f64))
    })
}

/// Smallest and largest of the coefficients that the cells of a box read.
fn read_range<T: Real>(brick: &Node<T>, within: &[[f64; 2]; 3]) -> [f64; 2] {
    let [x, y, z] = within.map(|[a, b]| {
        let first = (a as usize).min(BRICK - 1);
        first..(b.ceil() as usize).max(first + 1) + 3
    });
    let totals = brick.own_totals();
    vectorized(
        #[inline(always)]
        || match z.len() <= 8 {
            true => range_of::<T, 8>(totals, &x, &y, &z),
            false => range_of::<T, 16>(totals, &x, &y, &z),
        },
    )
}

/// Least and largest coefficient of the ranges, `z` no longer than `L`: a lane for each along `z`. What the lanes beyond
/// find nobody looks at.
#[inline(always)]
fn range_of<T: Real, const L: usize>(
    totals: &[T; HALO_LEN],
    x: &Range<usize>,
    y: &Range<usize>,
    z: &Range<usize>,
) -> [f64; 2] {
    let (mut lo, mut hi) = ([T::infinity(); L], [T::neg_infinity(); L]);
    for i in x.clone() {
        for j in y.clone() {
            let row: [T; L] = lanes(totals, (i * HALO + j) * HALO + z.start);
            for k in 0..L {
                // Comparisons as written here turn into vector instructions; `Float::min` does not.
                lo[k] = if row[k] < lo[k] { row[k] } else { lo[k] };
                hi[k] = if row[k] > hi[k] { row[k] } else { hi[k] };
            }
        }
    }
    let least = lo[..z.len()]
        .iter()
        .fold(T::infinity(), |m, c| if *c < m { *c } else { m });
    let most = hi[..z.len()]
        .iter()
        .fold(T::neg_infinity(), |m, c| if *c > m { *c } else { m });
    [least.as_f64(), most.as_f64()]
}

/// `L` totals from a place on; those beyond the last are 0.
#[inline(always)]
pub(super) fn lanes<T: Real, const L: usize>(totals: &[T; HALO_LEN], start: usize) -> [T; L] {
    match totals.get(start..start + L) {
        Some(row) => row.try_into().expect("L of them"),
        None => std::array::from_fn(|k| totals.get(start + k).copied().unwrap_or(T::zero())),
    }
}
