//! A sound interval over a box: the field is inside the convex hull of its control coefficients.

use glam::DVec3;

use super::brick::{BRICK, Brick, NONE};
use super::spline::HierarchicalSpline;
use crate::restrict::{RestrictedAxis, restricted_range};
use crate::{Aabb, Interval, Real};

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
        magnitude: 0.0,
    };
    let counts = spline.lattice().cells.map(|n| n.div_ceil(BRICK as u32));
    let range = |a: usize| {
        let brick = |q: f64| (q as u32 / BRICK as u32).min(counts[a] - 1);
        brick(inside.min[a])..=brick(inside.max[a])
    };
    for x in range(0) {
        for y in range(1) {
            for z in range(2) {
                let root = ((x * counts[1] + y) * counts[2] + z) as usize;
                visit(spline, 0, root, &inside, &mut hull);
            }
        }
    }
    // Rounding of the restriction, and of evaluation in T, both against the largest coefficient in play.
    let rounding = (64.0 * T::UNIT_ROUND_OFF + 3.0 * RestrictedAxis::<T>::axis_error()) * hull.magnitude;
    let interval = Interval::new(hull.lo, hull.hi).widened(rounding);
    interval - fall(spline, b, &inside)
}

struct Hull {
    lo: f64,
    hi: f64,
    /// Largest coefficient of the bricks visited.
    magnitude: f64,
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
    let [least, most] = brick.hull.map(T::as_f64);
    hull.magnitude = hull.magnitude.max(least.abs()).max(most.abs());
    let width = BRICK as f64 / (1u64 << level) as f64;
    let corner = DVec3::from_array(brick.key.0.map(|k| k as f64 * width));
    let end = (corner + width).min(spline.lattice().extent());
    let Some(part) = shared(b, corner, end) else {
        return;
    };
    if part.min == corner && part.max == end {
        return hull.add([least, most]);
    }
    if !brick.has_children() {
        return hull.add(local_hull(brick, level, &part));
    }
    for octant in 0..8usize {
        let child = brick.children[octant];
        if child != NONE {
            visit(spline, level + 1, child as usize, b, hull);
            continue;
        }
        let half = |a: usize| (octant >> (2 - a) & 1) as f64 * width / 2.0;
        let low = corner + DVec3::from_array(std::array::from_fn(half));
        if let Some(part) = shared(b, low, (low + width / 2.0).min(end)) {
            hull.add(local_hull(brick, level, &part));
        }
    }
}

/// The part of `b` between `low` and `high`. None where they share just a face, which the brick on its other side
/// covers as well (the field is continuous), unless `b` is no thicker than that itself.
fn shared(b: &Aabb, low: DVec3, high: DVec3) -> Option<Aabb> {
    let part = Aabb {
        min: b.min.max(low),
        max: b.max.min(high),
    };
    let thick =
        (0..3).all(|a| part.min[a] < part.max[a] || (part.min[a] == part.max[a] && b.min[a] == b.max[a]));
    thick.then_some(part)
}

/// Range of the brick's coefficients after restriction to its part of `b`.
fn local_hull<T: Real>(brick: &Brick<T>, level: usize, b: &Aabb) -> [f64; 2] {
    let scale = (1u64 << level) as f64;
    let axes = std::array::from_fn(|a| {
        let first = (BRICK as u32 * brick.key.0[a]) as f64;
        let local = |q: f64| (q * scale - first).clamp(0.0, BRICK as f64);
        RestrictedAxis::new(local(b.min[a]), local(b.max[a]))
    });
    let (lo, hi) = restricted_range(&brick.totals, &axes);
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
