use std::sync::Arc;

use bspline::primitives::{Capsule, Primitive};
use bspline::{Aabb, Field, Interval, Jet};
use glam::DVec3;

/// A solid that is asked beside others, of which the largest value counts.
pub(super) trait Rival: Field {
    /// Its value if that is above `floor`, else any that is not.
    fn value_above(&self, p: DVec3, floor: f64) -> f64 {
        let _ = floor;
        self.value(p)
    }

    /// Whether its bounds tell no more than that it is a distance with its value in the middle.
    fn has_bounds_of_distance(&self) -> bool {
        false
    }
}

impl Rival for Capsule {}

impl Rival for Primitive {}

/// A solid on a part of its way, from one place of its middle to another.
pub(super) struct Leg {
    pub from: DVec3,
    pub to: DVec3,
    pub solid: Arc<dyn Rival>,
}

/// The union of all legs of a way: as [`bspline::Csg::union`], but a leg is asked only where it can win, for there are hundreds.
pub(super) struct Chain {
    legs: Vec<Leg>,
    /// Radius of a ball about the middle of the solid that holds it.
    size: f64,
}

impl Chain {
    /// # Panics
    /// Without a leg.
    pub fn new(legs: Vec<Leg>, size: f64) -> Self {
        assert!(!legs.is_empty(), "a way has a leg");
        Self { legs, size }
    }

    /// What no leg exceeds at a point: the distance within a ball that goes the same way.
    fn most(&self, leg: &Leg, p: DVec3) -> f64 {
        let way = leg.to - leg.from;
        let share = (p - leg.from).dot(way) / way.length_squared().max(f64::MIN_POSITIVE);
        self.size - p.distance(leg.from + share.clamp(0.0, 1.0) * way)
    }

    /// The leg with the largest value of `of`, which `most` bounds, and the value; the first of several. `of` is told what is to be
    /// exceeded.
    fn largest(&self, p: DVec3, room: f64, of: impl Fn(&Leg, f64) -> f64) -> (usize, f64) {
        let mosts: Vec<f64> = self.legs.iter().map(|leg| self.most(leg, p) + room).collect();
        let first = (0..mosts.len()).fold(0, |best, i| if mosts[i] > mosts[best] { i } else { best });
        let mut best = (first, of(&self.legs[first], f64::NEG_INFINITY));
        for (i, most) in mosts.iter().enumerate() {
            if i != first && *most > best.1 {
                let value = of(&self.legs[i], best.1);
                if value > best.1 {
                    best = (i, value);
                }
            }
        }
        best
    }

    fn nearest(&self, p: DVec3) -> &Arc<dyn Rival> {
        let (leg, _) = self.largest(p, 0.0, |leg, floor| leg.solid.value_above(p, floor));
        &self.legs[leg].solid
    }
}

impl Field for Chain {
    fn value(&self, p: DVec3) -> f64 {
        self.largest(p, 0.0, |leg, floor| leg.solid.value_above(p, floor))
            .1
    }

    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        self.nearest(p).value_gradient(p)
    }

    fn jet(&self, p: DVec3) -> Jet {
        self.nearest(p).jet(p)
    }

    fn bounds(&self, b: &Aabb) -> Interval {
        let (middle, room) = (b.center(), 0.5 * b.size().length());
        if self.legs.iter().all(|leg| leg.solid.has_bounds_of_distance()) {
            return self.nearest(middle).bounds(b);
        }
        let (_, hi) = self.largest(middle, room, |leg, _| leg.solid.bounds(b).hi);
        let (_, lo) = self.largest(middle, room, |leg, _| leg.solid.bounds(b).lo);
        Interval::new(lo, hi)
    }
}
