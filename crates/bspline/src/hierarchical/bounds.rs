//! A sound interval over a box: the field is inside the convex hull of its control coefficients.

use glam::DVec3;

use super::brick::{BRICK, Brick, HALO, NONE};
use super::spline::HierarchicalSpline;
use crate::{Aabb, Interval, Real};

/// Part of a cell that a box may reach over a knot plane without reading the cells beyond.
///
/// There the one function that the cells on this side do not read has weight `t³/6 <= 2e-28`, far below the
/// rounding allowed for. Boxes laid along the knots, as a mesher asks for, keep to their cells this way, though
/// mapping them to the lattice widens them by a rounding.
const SLIVER: f64 = 1e-9;

/// Interval of the field over a box given in lattice coordinates.
pub(super) fn over_lattice_box<T: Real>(spline: &HierarchicalSpline<T>, b: &Aabb) -> Interval {
    if !(b.min.is_finite() && b.max.is_finite()) {
        return Interval::EVERYTHING;
    }
    let extent = spline.lattice().extent();
    let inside = Aabb {
        min: b.min.clamp(DVec3::ZERO, extent),
        max: b.max.clamp(DVec3::ZERO, extent),
    };
    let mut hull = Hull {
        lo: f64::INFINITY,
        hi: f64::NEG_INFINITY,
    };
    let counts = spline.lattice().cells.map(|n| n.div_ceil(BRICK as u32));
    let range = |a: usize| {
        let brick = |q: f64| (q as u32 / BRICK as u32).min(counts[a] - 1);
        let first = brick(inside.min[a] + SLIVER);
        first..=brick(inside.max[a] - SLIVER).max(first)
    };
    for x in range(0) {
        for y in range(1) {
            for z in range(2) {
                let root = ((x * counts[1] + y) * counts[2] + z) as usize;
                visit(spline, 0, root, &inside, &mut hull);
            }
        }
    }
    // What evaluation in T can add: 4 + 4 + 4 products and sums on each of three axes, and the weights' own
    // rounding, relative to the largest coefficient in play.
    let magnitude = hull.lo.abs().max(hull.hi.abs());
    let interval = Interval::new(hull.lo, hull.hi).widened(64.0 * T::UNIT_ROUND_OFF * magnitude);
    interval - fall(spline, b, &inside)
}

struct Hull {
    lo: f64,
    hi: f64,
}

impl Hull {
    fn add(&mut self, [lo, hi]: [f64; 2]) {
        self.lo = self.lo.min(lo);
        self.hi = self.hi.max(hi);
    }
}

/// Adds the range of brick `index` of `level`, over the part of `b` in it.
fn visit<T: Real>(spline: &HierarchicalSpline<T>, level: usize, index: usize, b: &Aabb, hull: &mut Hull) {
    let brick = &spline.levels[level][index];
    let width = BRICK as f64 / (1u64 << level) as f64;
    let corner = DVec3::from_array(brick.key.0.map(|k| k as f64 * width));
    let end = (corner + width).min(spline.lattice().extent());
    if b.min.cmple(corner).all() && b.max.cmpge(end).all() {
        return hull.add(brick.hull.map(T::as_f64));
    }
    if !brick.has_children() {
        return hull.add(local_hull(brick, level, b));
    }
    for octant in 0..8usize {
        let low = corner
            + DVec3::from_array(std::array::from_fn(|a| {
                (octant >> (2 - a) & 1) as f64 * width / 2.0
            }));
        let part = Aabb {
            min: b.min.max(low),
            max: b.max.min((low + width / 2.0).min(end)),
        };
        let sliver = DVec3::splat(SLIVER * width / BRICK as f64);
        let thin = (part.max - part.min).cmple(sliver) & (b.max - b.min).cmpgt(2.0 * sliver);
        if thin.any() || !part.min.cmple(part.max).all() {
            continue;
        }
        match brick.children[octant] {
            NONE => hull.add(local_hull(brick, level, &part)),
            child => visit(spline, level + 1, child as usize, &part, hull),
        }
    }
}

/// Hull of the coefficients that the cells of `b` in the brick read.
fn local_hull<T: Real>(brick: &Brick<T>, level: usize, b: &Aabb) -> [f64; 2] {
    let scale = (1u64 << level) as f64;
    let range = |a: usize| {
        let origin = (BRICK as u32 * brick.key.0[a]) as f64;
        let cell = |q: f64| q.clamp(0.0, BRICK as f64 - 1.0) as usize;
        let first = cell(b.min[a] * scale - origin + SLIVER);
        let last = cell(b.max[a] * scale - origin - SLIVER).max(first);
        first..last + 4
    };
    // Comparisons as written here turn into vector instructions; `Float::min` does not.
    let (mut lo, mut hi) = (T::infinity(), T::neg_infinity());
    for x in range(0) {
        for y in range(1) {
            let row = (x * HALO + y) * HALO;
            for &c in &brick.totals[row + range(2).start..row + range(2).end] {
                lo = if c < lo { c } else { lo };
                hi = if c > hi { c } else { hi };
            }
        }
    }
    [lo.as_f64(), hi.as_f64()]
}

/// Interval of the fall `g·|x - clamp x|` over the box.
fn fall<T: Real>(spline: &HierarchicalSpline<T>, b: &Aabb, inside: &Aabb) -> Interval {
    let most = (inside.min - b.min).max(b.max - inside.max).max(DVec3::ZERO);
    if most == DVec3::ZERO {
        return Interval::point(0.0);
    }
    // Least distance beyond the box on each axis: only where the whole interval lies outside.
    let extent = spline.lattice().extent();
    let least = (b.min - extent).max(-b.max).max(DVec3::ZERO);
    let m = spline.lattice().world_from_lattice.matrix3;
    let columns = [m.x_axis, m.y_axis, m.z_axis];
    let tilt = columns[0].dot(columns[1]).abs()
        + columns[1].dot(columns[2]).abs()
        + columns[0].dot(columns[2]).abs();
    let lengths = DVec3::from_array(columns.map(|c| c.length()));
    let (lo, hi) = if tilt <= 1e-12 * lengths.length_squared() {
        ((least * lengths).length(), (most * lengths).length())
    } else {
        (0.0, (most * lengths).element_sum())
    };
    let slack = 1e-12 * hi;
    Interval::new((lo - slack).max(0.0), hi + slack) * Interval::point(spline.slope())
}
