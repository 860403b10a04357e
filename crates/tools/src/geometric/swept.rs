use std::sync::Arc;

use bspline::{Aabb, Field, Interval, Jet};
use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::chain::Rival;

/// Share of the solid's size to which the nearest pose is told from others that are as near.
const APART: f64 = 1e-3;

/// Share of the solid's size by which the distance of the nearest pose may be off.
const PEAK: f64 = 1e-6;

/// Steps that look for a peak, at most: those of a golden section leave `0.618³⁰ ≈ 5e-7` of the way.
const SECTIONS: usize = 30;

/// Where a tool is, and how it is turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pose {
    pub at: DVec3,
    pub turn: DQuat,
}

impl Pose {
    /// World from solid.
    pub fn map(&self) -> DAffine3 {
        DAffine3::from_rotation_translation(self.turn, self.at)
    }
}

/// The union of all poses of a solid on its way from one pose to another: straight, and turning evenly.
///
/// `f(x) = max_t d(x(t))`, `x(t)` the point in the coordinates of the solid, is the distance to what was swept outside, and no more
/// than that inside. Of convex solids that do not turn `d(x(t))` is concave in `t`, so it lies under its tangents \[Kelley60\]; of
/// others a search finds the largest that uses that `d` is a distance, so `d(x(t))` changes no faster than the point moves
/// \[Piyavskii72\].
#[derive(Clone)]
pub(super) struct Swept {
    solid: Arc<dyn Field>,
    /// Radius of a ball about the origin that holds the solid.
    size: f64,
    from: Pose,
    by: DVec3,
    axis: DVec3,
    angle: f64,
    search: Search,
}

/// A distance on the way.
#[derive(Clone, Copy)]
struct Rise {
    t: f64,
    value: f64,
    slope: f64,
}

/// What is known of a solid that helps to find its nearest pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Search {
    /// It is a distance.
    Distance {
        /// Whether the solid is convex.
        is_convex: bool,
    },
    /// Its bounds alone; between poses that are a share of its size apart it has no detail.
    Any,
}

/// Share of the size of a solid without a known distance after which it is asked again on its way.
const ASKED: f64 = 1.0 / 24.0;

/// Pieces of a leg over which such a solid is bounded.
const PIECES: usize = 4;

impl Swept {
    /// `solid` about the origin, within `size` of it, on its way between two poses.
    pub fn new(solid: Arc<dyn Field>, size: f64, [from, to]: [Pose; 2], search: Search) -> Self {
        let between = to.turn * from.turn.inverse();
        // The short way round.
        let between = if between.w < 0.0 { -between } else { between };
        let (axis, angle) = match between.xyz().length() {
            sine if sine < 1e-12 => (DVec3::Z, 0.0),
            sine => (between.xyz() / sine, 2.0 * libm::atan2(sine, between.w)),
        };
        Self {
            solid,
            size,
            from,
            by: to.at - from.at,
            axis,
            angle,
            search,
        }
    }

    /// Bound on the speed of a point in the coordinates of the solid, over the whole way.
    fn speed(&self, p: DVec3) -> f64 {
        let away = p - self.from.at;
        let farthest = away.length().max((away - self.by).length());
        (self.by.length() + self.angle * farthest) * (1.0 + 1e-9)
    }

    /// World from solid at `t` between 0 and 1.
    fn turn(&self, t: f64) -> DMat3 {
        let own = DMat3::from_quat(self.from.turn);
        match self.angle == 0.0 {
            true => own,
            false => crate::warp::rotation(self.axis, self.angle * t) * own,
        }
    }

    fn local(&self, p: DVec3, t: f64) -> DVec3 {
        self.turn(t).transpose() * (p - self.from.at - self.by * t)
    }

    fn at(&self, p: DVec3, t: f64) -> f64 {
        self.solid.value(self.local(p, t))
    }

    /// The distance at `t`, and how fast it changes with `t`.
    fn rise(&self, p: DVec3, t: f64) -> Rise {
        let turn = self.turn(t);
        let away = p - self.from.at - self.by * t;
        let (value, gradient) = self.solid.value_gradient(turn.transpose() * away);
        let slope = -(turn * gradient).dot(self.by + self.angle * self.axis.cross(away));
        Rise { t, value, slope }
    }

    /// Where on its way the solid is nearest, and its distance there; if that is not above `floor`, any pose.
    fn nearest(&self, p: DVec3, floor: f64) -> (f64, f64) {
        let ends = || [0.0, 1.0].map(|t| (t, self.at(p, t)));
        match self.search {
            Search::Distance { is_convex: true } if self.angle == 0.0 => {
                let ends = [0.0, 1.0].map(|t| self.rise(p, t));
                self.peak(p, ends, floor).0
            }
            Search::Distance { .. } => self.searched(p, ends(), floor),
            Search::Any => self.asked(p, ends(), floor),
        }
    }

    /// The nearest pose, told from others to a share of the solid's size, and then followed to its peak.
    fn searched(&self, p: DVec3, ends: [(f64, f64); 2], floor: f64) -> (f64, f64) {
        let speed = self.speed(p);
        let [first, last] = ends;
        let mut best = if last.1 > first.1 { last } else { first };
        let mut around = (first.0, last.0);
        let mut open = vec![(first, last)];
        while let Some((a, b)) = open.pop() {
            let top = 0.5 * (a.1 + b.1 + speed * (b.0 - a.0));
            if top <= floor.max(best.1 + self.slack(best.1)) {
                continue;
            }
            let t = (0.5 * (a.0 + b.0) + 0.5 * (b.1 - a.1) / speed).clamp(a.0, b.0);
            let middle = (t, self.at(p, t));
            if middle.1 > best.1 {
                (best, around) = (middle, (a.0, b.0));
            }
            // The likelier half is looked at first.
            match a.1 > b.1 {
                true => open.extend([(middle, b), (a, middle)]),
                false => open.extend([(a, middle), (middle, b)]),
            }
        }
        if best.1 + speed * (around.1 - best.0).max(best.0 - around.0) <= floor {
            return best;
        }
        let at = self.rise(p, best.0);
        let pair = match at.slope > 0.0 {
            true => [at, self.rise(p, around.1)],
            false => [self.rise(p, around.0), at],
        };
        let refined = match self.peak(p, pair, floor) {
            (refined, true) => refined,
            (_, false) => self.golden(p, around.0, around.1),
        };
        if refined.1 > best.1 { refined } else { best }
    }

    /// The nearest pose of a solid of which only bounds are known.
    fn asked(&self, p: DVec3, ends: [(f64, f64); 2], floor: f64) -> (f64, f64) {
        let speed = self.speed(p);
        let [first, last] = ends;
        let mut best = if last.1 > first.1 { last } else { first };
        let mut width = 1.0;
        let mut open = vec![(0.0, 1.0)];
        while let Some((a, b)) = open.pop() {
            let t: f64 = 0.5 * (a + b);
            let reach = 0.5 * (b - a) * speed;
            let at = self.local(p, t);
            if self.solid.bounds(&Aabb::new(at - reach, at + reach)).hi <= best.1.max(floor) {
                continue;
            }
            let value = self.solid.value(at);
            if value > best.1 {
                (best, width) = ((t, value), b - a);
            }
            if 2.0 * reach > ASKED * self.size {
                open.extend([(t, b), (a, t)]);
            } else {
                width = width.min(b - a);
            }
        }
        // The top of the parabola through the poses beside it.
        let [low, high] = [(best.0 - width).max(0.0), (best.0 + width).min(1.0)];
        let [a, b] = [low, high].map(|t| (best.1 - self.at(p, t)) / (best.0 - t));
        let bend = (b - a) / (high - low);
        let top = 0.5 * (low + best.0 - a / bend);
        if top > low && top < high && self.at(p, top) > best.1 {
            best = (top, self.at(p, top));
        }
        best
    }

    /// The largest between two places if all lies under the tangents there, as of concave functions, and whether it was found or is
    /// not above `floor`: not if the slopes at both ends say that it lies beyond.
    fn peak(&self, p: DVec3, [mut a, mut b]: [Rise; 2], floor: f64) -> ((f64, f64), bool) {
        let mut best = if b.value > a.value { b } else { a };
        let mut is_found = a.slope <= 0.0 && best.t == a.t || b.slope >= 0.0 && best.t == b.t;
        let mut n = 0;
        while a.slope > 0.0 && b.slope < 0.0 && n < SECTIONS {
            let (width, bend) = (b.t - a.t, a.slope - b.slope);
            let meet = (b.value - a.value - b.slope * width) / bend;
            let top = a.value + a.slope * meet;
            is_found = true;
            if top <= floor.max(best.value + PEAK * self.size) {
                break;
            }
            // Smooth ones peak where the slope would be none if it changed evenly, others where the tangents meet.
            let step = if n % 2 == 0 { width * a.slope / bend } else { meet };
            let c = self.rise(p, a.t + step.clamp(0.0, width));
            if c.value > best.value {
                best = c;
            }
            *(if c.slope > 0.0 { &mut a } else { &mut b }) = c;
            n += 1;
        }
        ((best.t, best.value), is_found)
    }

    /// How far a distance may be off; far from the surface nobody asks for more.
    fn slack(&self, value: f64) -> f64 {
        APART * self.size + 0.02 * value.abs()
    }

    fn golden(&self, p: DVec3, mut low: f64, mut high: f64) -> (f64, f64) {
        const SHARE: f64 = 0.618_033_988_749_894_9;
        let mut inner = [high - SHARE * (high - low), low + SHARE * (high - low)];
        let mut values = inner.map(|t| self.at(p, t));
        for _ in 0..SECTIONS {
            if values[0] < values[1] {
                low = inner[0];
                inner = [inner[1], low + SHARE * (high - low)];
                values = [values[1], self.at(p, inner[1])];
            } else {
                high = inner[1];
                inner = [high - SHARE * (high - low), inner[0]];
                values = [self.at(p, inner[0]), values[0]];
            }
        }
        match values[0] < values[1] {
            true => (inner[1], values[1]),
            false => (inner[0], values[0]),
        }
    }
}

impl Rival for Swept {
    fn value_above(&self, p: DVec3, floor: f64) -> f64 {
        self.nearest(p, floor).1
    }

    fn has_bounds_of_distance(&self) -> bool {
        self.search != Search::Any
    }
}

impl Field for Swept {
    fn value(&self, p: DVec3) -> f64 {
        self.value_above(p, f64::NEG_INFINITY)
    }

    /// That of the nearest pose: it does not change the largest value to first order.
    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let (t, _) = self.nearest(p, f64::NEG_INFINITY);
        let (value, gradient) = self.solid.value_gradient(self.local(p, t));
        (value, self.turn(t) * gradient)
    }

    /// By central differences of the gradient over a thousandth of the solid's size.
    fn jet(&self, p: DVec3) -> Jet {
        let (value, gradient) = self.value_gradient(p);
        let step = APART * self.size;
        let column = |a: usize| {
            let [up, down] = [step, -step].map(|s| self.value_gradient(p + s * DVec3::AXES[a]).1);
            (up - down) / (2.0 * step)
        };
        let h = DMat3::from_cols(column(0), column(1), column(2));
        Jet {
            value,
            gradient,
            hessian: (h + h.transpose()) * 0.5,
        }
    }

    /// The largest of distances is no steeper than they are.
    fn bounds(&self, b: &Aabb) -> Interval {
        if self.search == Search::Any {
            let (p, half) = (b.center(), 0.5 * b.size().length());
            let reach = 0.5 * self.speed(p) / PIECES as f64 + half;
            let pieces = (0..PIECES).map(|i| {
                let at = self.local(p, (i as f64 + 0.5) / PIECES as f64);
                self.solid.bounds(&Aabb::new(at - reach, at + reach))
            });
            // In each piece there is a pose with at least its lower bound.
            let both = pieces.reduce(|a, b| Interval::new(a.lo.max(b.lo), a.hi.max(b.hi)));
            return both.expect("a way has pieces");
        }
        let value = self.value(b.center());
        Interval::point(value).widened(0.5 * b.size().length() + self.slack(value))
    }
}

#[cfg(test)]
mod tests {
    use bspline::primitives::{Cuboid, Cylinder, Torus};

    use super::*;

    /// Against the largest of 4000 poses; and a floor only spares work.
    #[test]
    fn the_nearest_pose_is_found() {
        let half = DVec3::new(1.0, 0.6, 0.3);
        let ends = DVec3::Z * 0.7;
        let solids: [(Arc<dyn Field>, f64, bool); 3] = [
            (
                Arc::new(Cuboid::new(DVec3::ZERO, half).unwrap()),
                half.length(),
                true,
            ),
            (Arc::new(Cylinder::new(-ends, ends, 0.5).unwrap()), 0.9, true),
            (
                Arc::new(Torus::new(DVec3::ZERO, DVec3::X, 0.8, 0.3).unwrap()),
                1.1,
                false,
            ),
        ];
        let mut drawn = 1u64;
        let mut draw = || {
            drawn = drawn.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            f64::from((drawn >> 32) as u32) / 2f64.powi(31) - 1.0
        };
        let mut worst = 0.0_f64;
        for round in 0..120 {
            let (solid, size, is_convex) = solids[round % 3].clone();
            let mut pose = |turns: f64| Pose {
                at: DVec3::new(draw(), draw(), draw()) * 2.0,
                turn: DQuat::from_scaled_axis(DVec3::new(draw(), draw(), draw()) * turns),
            };
            let (from, mut to) = (pose(2.0), pose(2.0));
            if round % 2 == 0 {
                to.turn = from.turn;
            }
            let swept = Swept::new(solid, size, [from, to], Search::Distance { is_convex });
            for _ in 0..20 {
                let p = DVec3::new(draw(), draw(), draw()) * 3.0;
                let value = swept.value(p);
                let most = (0..=4000).map(|i| swept.at(p, f64::from(i) / 4000.0));
                let most = most.fold(f64::NEG_INFINITY, f64::max);
                let bound = PEAK * size
                    + if is_convex && round % 2 == 0 {
                        0.0
                    } else {
                        swept.slack(most)
                    };
                worst = worst.max((most - value) / size);
                assert!(most - value <= bound, "{round}: {value} for {most} at {p}");
                assert!(swept.bounds(&Aabb::new(p, p)).hi >= most - 1e-12);
                assert!(swept.value_above(p, value - 1e-3) > value - 1e-3);
                assert!(swept.value_above(p, value + bound) <= value + bound);
            }
        }
        println!("{worst:.2e} of the size");
    }
}
