//! Errors of a field at points of a surface: one definition, for the fit that states them and for whoever measures
//! again.

use std::ops::ControlFlow;

use bspline::{Field, HierarchicalSpline, Real};
use glam::DVec3;
use rayon::prelude::*;

/// Newton steps in search of the surface.
const NEWTON_STEPS: usize = 40;
/// A step of this share of the way gone is the last.
const SETTLED: f64 = 0.01;
/// Halvings of a step that went too far.
const HALVINGS: usize = 40;

/// What the field says of a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointError {
    /// Way of Newton's steps along the gradient from the point to the surface `f = 0`, in a straight line.
    pub distance: f64,
    /// `|f|` at the point.
    pub value: f64,
    /// Whether the surface was reached; if not, `distance` is what was gone and what is left by first order.
    pub converged: bool,
}

/// Errors of some leaf.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LeafError {
    /// Points in it that count.
    pub count: u32,
    /// Root of the mean square distance; 0 without points.
    pub rms: f64,
    /// Largest distance.
    pub max: f64,
}

/// Errors at all points that count.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointErrors {
    /// Points that count.
    pub count: usize,
    /// Distance of each position; NaN where it does not count.
    pub distances: Vec<f64>,
    /// Root of the mean square distance.
    pub rms: f64,
    /// 95th percentile of the distances, by nearest rank.
    pub p95: f64,
    /// Largest distance.
    pub max: f64,
    /// Sound bound on every distance and on `|f|` at every point, rounding of the evaluation included.
    pub bound: f64,
    /// Points from which the surface was not reached.
    pub unprojected: usize,
    /// Of each leaf.
    pub leaves: Vec<LeafError>,
}

/// Points measured together.
const BLOCK: usize = 1 << 16;
/// Points asked for at once.
const TOGETHER: usize = 64;

/// Measures `field` at the positions that count, each of which may lie in one of `leaf_count` leaves.
pub fn measure_points<T: Real>(
    field: &HierarchicalSpline<T>,
    positions: &[DVec3],
    counts: impl Fn(usize) -> bool + Sync,
    leaf_of: impl Fn(usize) -> Option<usize>,
    leaf_count: usize,
) -> PointErrors {
    let order: Vec<u32> = (0..positions.len() as u32).collect();
    measure_in_order(field, positions, &order, counts, leaf_of, leaf_count)
}

/// The same, where `order` names every position that counts once: quickest where neighbours in it lie side by side.
pub(crate) fn measure_in_order<T: Real>(
    field: &HierarchicalSpline<T>,
    positions: &[DVec3],
    order: &[u32],
    counts: impl Fn(usize) -> bool + Sync,
    leaf_of: impl Fn(usize) -> Option<usize>,
    leaf_count: usize,
) -> PointErrors {
    let spacing = field.lattice().spacing(field.level_count() - 1).min_element();
    let mut errors: Vec<Option<PointError>> = vec![None; positions.len()];
    let counted: Vec<u32> = order.iter().copied().filter(|&i| counts(i as usize)).collect();
    let mut found = vec![None; BLOCK.min(counted.len())];
    for block in counted.chunks(BLOCK) {
        block
            .par_chunks(TOGETHER)
            .zip(found.par_chunks_mut(TOGETHER))
            .with_min_len(1024 / TOGETHER)
            .for_each(|(block, found)| errors_of(field, positions, block, spacing, found));
        for (i, error) in block.iter().zip(&found) {
            errors[*i as usize] = *error;
        }
    }
    let mut out = PointErrors {
        distances: Vec::with_capacity(positions.len()),
        leaves: vec![LeafError::default(); leaf_count],
        ..Default::default()
    };
    let (mut square, mut value) = (0.0, 0.0f64);
    for (i, error) in errors.iter().enumerate() {
        out.distances.push(error.map_or(f64::NAN, |e| e.distance));
        let Some(e) = error else { continue };
        out.count += 1;
        out.unprojected += usize::from(!e.converged);
        square += e.distance * e.distance;
        value = value.max(e.value);
        out.max = out.max.max(e.distance);
        if let Some(leaf) = leaf_of(i).map(|l| &mut out.leaves[l]) {
            leaf.count += 1;
            leaf.rms += e.distance * e.distance;
            leaf.max = leaf.max.max(e.distance);
        }
    }
    drop(errors);
    for leaf in out.leaves.iter_mut().filter(|l| l.count > 0) {
        leaf.rms = (leaf.rms / f64::from(leaf.count)).sqrt();
    }
    out.bound = value.max(out.max) + field.rounding_bound();
    if out.count > 0 {
        out.rms = (square / out.count as f64).sqrt();
        let mut sorted: Vec<f64> = out.distances.iter().copied().filter(|d| !d.is_nan()).collect();
        let rank = (out.count * 95).div_ceil(100) - 1;
        out.p95 = *sorted.select_nth_unstable_by(rank, f64::total_cmp).1;
    }
    out
}

/// Where the steps from `p` end. None is longer than `spacing`, the finest knot spacing; a step that turns the sign over
/// without bringing the surface much nearer, as to and fro across a crease, is halved until it meets it.
pub fn point_error(field: &dyn Field, p: DVec3, spacing: f64) -> PointError {
    let mut walk = Walk::new(p, field.value_gradient(p));
    loop {
        let next = match walk.next(spacing) {
            ControlFlow::Break(end) => return end,
            ControlFlow::Continue(next) => next,
        };
        if let Some(end) = walk.go(field, next, field.value_gradient(next)) {
            return end;
        }
    }
}

/// [`point_error`] of the positions `which`, at most [`TOGETHER`], step by step together.
fn errors_of(
    field: &dyn Field,
    positions: &[DVec3],
    which: &[u32],
    spacing: f64,
    out: &mut [Option<PointError>],
) {
    let mut places = [DVec3::ZERO; TOGETHER];
    let mut found = [(0.0, DVec3::ZERO); TOGETHER];
    for (place, &i) in places.iter_mut().zip(which) {
        *place = positions[i as usize];
    }
    field.values_gradients(&places[..which.len()], &mut found[..which.len()]);
    let mut walks: [Walk; TOGETHER] = std::array::from_fn(|k| Walk::new(places[k], found[k]));
    let mut going: [usize; TOGETHER] = std::array::from_fn(|k| k);
    let mut count = which.len();
    while count > 0 {
        let mut asking = 0;
        for at in 0..count {
            let k = going[at];
            match walks[k].next(spacing) {
                ControlFlow::Break(end) => out[k] = Some(end),
                ControlFlow::Continue(next) => {
                    (going[asking], places[asking]) = (k, next);
                    asking += 1;
                }
            }
        }
        field.values_gradients(&places[..asking], &mut found[..asking]);
        count = 0;
        for at in 0..asking {
            let k = going[at];
            match walks[k].go(field, places[at], found[at]) {
                Some(end) => out[k] = Some(end),
                None => {
                    going[count] = k;
                    count += 1;
                }
            }
        }
    }
}

/// Newton's steps from a point.
struct Walk {
    start: DVec3,
    /// Value there.
    first: f64,
    steps: usize,
    /// Where they have come to, with value and gradient.
    x: DVec3,
    f: f64,
    gradient: DVec3,
    /// What is left by first order.
    left: f64,
}

impl Walk {
    fn new(start: DVec3, (first, gradient): (f64, DVec3)) -> Self {
        Self {
            start,
            first,
            steps: 0,
            x: start,
            f: first,
            gradient,
            left: 0.0,
        }
    }

    fn reached(&self, x: DVec3) -> PointError {
        PointError {
            distance: x.distance(self.start),
            value: self.first.abs(),
            converged: true,
        }
    }

    /// Where the next step leads, or how the steps end.
    fn next(&mut self, spacing: f64) -> ControlFlow<PointError, DVec3> {
        if self.steps < NEWTON_STEPS {
            self.steps += 1;
            if self.f == 0.0 {
                return ControlFlow::Break(self.reached(self.x));
            }
            let slope = self.gradient.length();
            self.left = self.f.abs() / slope;
            if self.left.is_finite() {
                let share = (spacing / self.left).min(1.0);
                let next = self.x - self.gradient * (self.f / slope / slope * share);
                if self.left <= spacing && self.left <= SETTLED * next.distance(self.start) {
                    return ControlFlow::Break(self.reached(next));
                }
                return ControlFlow::Continue(next);
            }
            self.left = spacing;
        }
        ControlFlow::Break(PointError {
            distance: self.x.distance(self.start) + self.left,
            value: self.first.abs(),
            converged: false,
        })
    }

    /// Goes to `next`, where this was found; the end if the surface was crossed.
    fn go(&mut self, field: &dyn Field, next: DVec3, (f, gradient): (f64, DVec3)) -> Option<PointError> {
        if f.abs() > 0.5 * self.f.abs() && (f > 0.0) != (self.f > 0.0) {
            return Some(self.reached(crossing(field, [self.x, next], self.f > 0.0)));
        }
        (self.x, self.f, self.gradient) = (next, f, gradient);
        None
    }
}

/// The zero of `field` between two points of different sign; `inside` says whether it is positive at the first.
pub fn crossing(field: &dyn Field, [mut a, mut b]: [DVec3; 2], inside: bool) -> DVec3 {
    for _ in 0..HALVINGS {
        let middle = (a + b) * 0.5;
        if (field.value(middle) > 0.0) == inside {
            a = middle
        } else {
            b = middle
        }
    }
    b
}

#[cfg(test)]
mod tests {
    use bspline::{Aabb, Interval, Jet};
    use glam::DMat3;

    use super::*;

    /// `f = 1 - (x²/4 + y² + z²)`, cut by a crease where `x` changes its sign.
    struct Ellipsoid;

    impl Field for Ellipsoid {
        fn value(&self, p: DVec3) -> f64 {
            self.value_gradient(p).0
        }
        fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
            let g = DVec3::new(-0.5 * p.x, -2.0 * p.y, -2.0 * p.z);
            (1.0 + 0.5 * g.dot(p), g)
        }
        fn jet(&self, p: DVec3) -> Jet {
            let (value, gradient) = self.value_gradient(p);
            Jet {
                value,
                gradient,
                hessian: DMat3::from_diagonal(DVec3::new(-0.5, -2.0, -2.0)),
            }
        }
        fn bounds(&self, _: &Aabb) -> Interval {
            Interval::EVERYTHING
        }
    }

    /// Newton's way leaves the surface at right angles and bends on: it is longer than the perpendicular by the square of
    /// the distance times the curvature.
    #[test]
    fn near_the_surface_the_distance_is_that_to_the_foot_of_the_perpendicular() {
        for i in 0..200 {
            let (a, t) = (0.0314 * i as f64, 0.02 * ((i * 37 % 100) as f64 / 100.0 - 0.5));
            let s = DVec3::new(2.0 * a.cos(), 0.6 * a.sin(), 0.8 * a.sin());
            let n = DVec3::new(0.5 * s.x, 2.0 * s.y, 2.0 * s.z).normalize();
            let found = point_error(&Ellipsoid, s + n * t, 0.1);
            assert!(found.converged);
            // Steps end at a hundredth of the way, after which they fall with the square.
            assert!(
                (found.distance - t.abs()).abs() <= 1e-3 * t.abs() + 1e-7,
                "{found:?} {t}"
            );
        }
    }

    #[test]
    fn points_measured_together_have_the_errors_of_each_alone() {
        let place = |i: usize| {
            let t = i as f64;
            DVec3::new((0.7 * t).sin() * 2.2, (1.3 * t).cos(), (2.1 * t).sin()) * (i % 5) as f64 * 0.3
        };
        let positions: Vec<DVec3> = (0..200).map(place).collect();
        for count in [1, 7, TOGETHER] {
            let which: Vec<u32> = (0..count as u32).map(|i| i * 3).collect();
            let mut together = vec![None; count];
            errors_of(&Ellipsoid, &positions, &which, 0.1, &mut together);
            let alone = which
                .iter()
                .map(|&i| Some(point_error(&Ellipsoid, positions[i as usize], 0.1)));
            assert!(together.iter().copied().eq(alone), "{together:?}");
            assert!(count < 7 || together.iter().flatten().any(|e| !e.converged));
        }
    }

    #[test]
    fn a_point_where_the_gradient_vanishes_is_told() {
        let found = point_error(&Ellipsoid, DVec3::ZERO, 0.1);
        assert!(!found.converged && found.distance == 0.1, "{found:?}");
        let on = point_error(&Ellipsoid, DVec3::new(2.0, 0.0, 0.0), 0.1);
        assert!(on.converged && on.distance == 0.0);
    }
}
