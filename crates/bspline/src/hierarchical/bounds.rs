//! A sound interval over a box: the field is inside the convex hull of its control coefficients.

use glam::DVec3;

use super::brick::{BRICK, Brick, HALO, NONE};
use super::spline::HierarchicalSpline;
use crate::restrict::{RestrictedAxis, restricted_range};
use crate::{Aabb, Interval, Real};

/// Distance, in cells of the finest level, within which the end of a box counts as lying on a knot plane.
const ON_KNOT: f64 = 1e-9;

/// Moves the ends of a box that lie next to a knot plane of the finest level onto it, and says by how much in
/// cells, all ends together.
///
/// Boxes laid along the knots, as a mesher asks for, miss them by a rounding and would reach slivers of up to 26 more
/// bricks. In such a sliver of thickness `d` the one function that the cells on this side do not read has the
/// weight `d³/6 <= 2e-28`; that of the others changes the field by less than `2d` of the largest coefficient.
pub(super) fn onto_knots<T: Real>(spline: &HierarchicalSpline<T>, b: &Aabb) -> (Aabb, f64) {
    let scale = (1u64 << (spline.level_count() - 1)) as f64;
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
pub(super) fn over_lattice_box<T: Real>(
    spline: &HierarchicalSpline<T>,
    b: &Aabb,
    level: Option<f64>,
) -> Interval {
    if !(b.min.is_finite() && b.max.is_finite()) {
        return Interval::EVERYTHING;
    }
    let extent = spline.lattice().extent();
    let inside = Aabb {
        min: b.min.clamp(DVec3::ZERO, extent),
        max: b.max.clamp(DVec3::ZERO, extent),
    };
    let (snapped, moved) = onto_knots(spline, &inside);
    let fall = spline.place.fall(b, &inside);
    let mut hull = Hull {
        lo: f64::INFINITY,
        hi: f64::NEG_INFINITY,
        magnitude: 0.0,
        // The fall may decide what the inside does not.
        level: level.filter(|_| fall == Interval::point(0.0)),
    };
    let counts = spline.lattice().cells.map(|n| n.div_ceil(BRICK as u32));
    let range = |a: usize| {
        let brick = |q: f64| (q as u32 / BRICK as u32).min(counts[a] - 1);
        brick(snapped.min[a])..=brick(snapped.max[a])
    };
    for x in range(0) {
        for y in range(1) {
            for z in range(2) {
                let root = ((x * counts[1] + y) * counts[2] + z) as usize;
                visit(spline, 0, root, &snapped, &mut hull);
            }
        }
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
    fn add_part<T: Real>(&mut self, brick: &Brick<T>, level: usize, b: &Aabb) {
        let within = local_box(brick, level, b);
        if self.level.is_some() {
            // Looking at the coefficients as they are costs a tenth of restricting them.
            let read = read_range(brick, &within);
            if self.is_told_by(read) {
                return self.add(read);
            }
        }
        let axes = within.map(|[a, b]| RestrictedAxis::new(a, b));
        let (lo, hi) = restricted_range(&brick.totals, &axes);
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

/// Adds the range of brick `index` of `level`, over the part of `b` in it.
fn visit<T: Real>(spline: &HierarchicalSpline<T>, level: usize, index: usize, b: &Aabb, hull: &mut Hull) {
    let brick = &spline.levels[level][index];
    let [least, most] = brick.hull.map(T::as_f64);
    hull.magnitude = hull.magnitude.max(least.abs()).max(most.abs());
    // Nothing in this brick can widen the hull: the usual case in large boxes.
    if hull.lo <= least && most <= hull.hi || hull.is_undecided() {
        return;
    }
    let width = BRICK as f64 / (1u64 << level) as f64;
    let corner = DVec3::from_array(brick.key.0.map(|k| k as f64 * width));
    let end = (corner + width).min(spline.lattice().extent());
    let Some(part) = shared(b, corner, end) else {
        return;
    };
    if part.min == corner && part.max == end || hull.is_told_by([least, most]) {
        return hull.add([least, most]);
    }
    if !brick.has_children() {
        return hull.add_part(brick, level, &part);
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
            hull.add_part(brick, level, &part);
        }
    }
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
pub(super) fn local_box<T>(brick: &Brick<T>, level: usize, b: &Aabb) -> [[f64; 2]; 3] {
    let scale = (1u64 << level) as f64;
    std::array::from_fn(|a| {
        let first = (BRICK as u32 * brick.key.0[a]) as f64;
        [b.min[a], b.max[a]].map(|q| (q * scale - first).clamp(0.0, BRICK as f64))
    })
}

/// Smallest and largest of the coefficients that the cells of a box read.
fn read_range<T: Real>(brick: &Brick<T>, within: &[[f64; 2]; 3]) -> [f64; 2] {
    let [x, y, z] = within.map(|[a, b]| {
        let first = (a as usize).min(BRICK - 1);
        first..(b.ceil() as usize).max(first + 1) + 3
    });
    // Comparisons as written here turn into vector instructions; `Float::min` does not.
    let (mut lo, mut hi) = (T::infinity(), T::neg_infinity());
    for x in x {
        for y in y.clone() {
            let row = (x * HALO + y) * HALO;
            for &c in &brick.totals[row + z.start..row + z.end] {
                lo = if c < lo { c } else { lo };
                hi = if c > hi { c } else { hi };
            }
        }
    }
    [lo.as_f64(), hi.as_f64()]
}
