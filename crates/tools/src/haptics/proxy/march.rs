//! Ways of the proxy: free until the surface, then along it.

use glam::DVec3;

use super::planes::{Plane, Planes};
use crate::haptics::Obstacle;

/// Rounds of a tick: each goes to the place nearest to the goal in front of the planes found so far.
const ROUNDS: usize = 12;
/// Steps of one way; beyond, the proxy goes on in the next tick.
const STEPS: usize = 64;
/// Way towards the goal, in tolerances, twice over, that is not worth another look when a first one has failed: sampled distances of single
/// precision are off by as much.
const HAIR: f64 = 0.04;
/// Newton steps onto the surface.
const ONTO: usize = 6;
/// Share of a distance that a step takes: sampled distances are off by up to a hundredth.
const SAFE: f64 = 0.98;

/// A place and what the obstacle says there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub at: DVec3,
    pub distance: f64,
    pub gradient: DVec3,
}

impl Place {
    pub fn of(obstacle: &dyn Obstacle, at: DVec3) -> Self {
        let (distance, gradient) = obstacle.distance(at);
        Self {
            at,
            distance,
            gradient,
        }
    }

    /// Direction into the air.
    pub fn normal(&self) -> Option<DVec3> {
        self.gradient.try_normalize()
    }
}

/// Where a straight way ends.
enum Way {
    /// At its end.
    Free(Place),
    /// Just inside the solid, with the last place in the air before it.
    Blocked { before: Place, by: Place },
    /// On it, since it is long.
    Long(Place),
}

/// What may be walked over: all that is at least `clearance` away from the surface.
#[derive(Clone, Copy)]
pub(super) struct March<'a> {
    pub obstacle: &'a dyn Obstacle,
    /// mm.
    pub clearance: f64,
    /// Way that makes no difference, mm.
    pub tolerance: f64,
}

impl March<'_> {
    /// Goes from a place as near to `goal` as can be reached without a gap: a local minimum of the distance to the goal over
    /// what is clear of the solid. Whether it is held back.
    ///
    /// The distance to the goal never grows on the way, so that under a still hand there is no limit cycle.
    pub fn toward(&self, goal: DVec3, start: Place) -> (Place, bool) {
        let mut here = start;
        let mut planes = Planes::none();
        planes.add_all(self.plane(&here), here.at);
        let mut reach = f64::INFINITY;
        let mut has_failed = false;
        for _ in 0..ROUNDS {
            let way = planes.nearest(goal, here.at) - here.at;
            let length = way.length();
            if length <= self.tolerance {
                if !has_failed {
                    break;
                }
                // Planes of places where it is not hold it: solid that is not flat between here and there.
                planes.clear();
                planes.add_all(self.plane(&here), here.at);
                has_failed = false;
                reach *= 0.5;
                continue;
            }
            let share = (reach / length).min(1.0);
            let next = here.at + share * way;
            let mut is_near = true;
            let there = match self.walk(here, next) {
                Way::Long(there) => return (there, true),
                Way::Free(there) => {
                    let air = there.distance - self.clearance;
                    if air > self.tolerance {
                        if next == goal {
                            return (there, false);
                        }
                        // The solid curves away below the planes.
                        planes.clear();
                    }
                    Some(there)
                }
                Way::Blocked { by, .. } => {
                    let plane = self.linear(&by);
                    // A plane that cuts off where the proxy is belongs to solid that is not flat between here and there.
                    is_near = plane.height(here.at) >= -self.tolerance;
                    if is_near {
                        planes.add(plane, here.at);
                    }
                    self.onto(by)
                }
            };
            let gap = |s: &Place| self.on_surface(s).distance_squared(goal);
            match there {
                Some(there) if gap(&there) < gap(&here) => {
                    here = there;
                    planes.add_all(self.plane(&here), here.at);
                    has_failed = false;
                    if share < 1.0 {
                        reach *= 2.0;
                    }
                }
                there => {
                    let gain = gap(&here) - next.distance_squared(goal);
                    if gain < HAIR * self.tolerance * goal.distance(here.at) {
                        break;
                    }
                    planes.add_all(self.plane(&here), here.at);
                    let turns = there.and_then(|there| self.turns(&here, &there, goal));
                    if turns.is_some() || has_failed || !is_near {
                        reach = turns.unwrap_or(0.5) * share * length;
                    }
                    has_failed = true;
                }
            }
        }
        (
            here,
            goal.distance_squared(here.at) > self.tolerance * self.tolerance,
        )
    }

    /// Goes straight to `goal` from a place in the air until the surface is met; a place on the surface stays. Nowhere if
    /// nothing is in the way.
    pub fn onward(&self, from: Place, goal: DVec3) -> Option<Place> {
        if self.rests(&from) || from.at == goal {
            return self.rests(&from).then_some(from);
        }
        match self.walk(from, goal) {
            Way::Free(there) => self.rests(&there).then_some(there),
            Way::Long(there) => Some(there),
            Way::Blocked { before, by } => Some(self.between(before, by)),
        }
    }

    /// Where the way from a place in the air to one in the solid meets the surface, by false position; a place in the air.
    fn between(&self, mut air: Place, mut solid: Place) -> Place {
        for _ in 0..ONTO {
            if self.rests(&air) {
                break;
            }
            let [over, under] = [air, solid].map(|place| place.distance - self.clearance);
            let middle = Place::of(self.obstacle, air.at.lerp(solid.at, over / (over - under)));
            let is_air = middle.distance >= self.clearance - self.tolerance;
            *(if is_air { &mut air } else { &mut solid }) = middle;
        }
        match self.rests(&air) {
            true => air,
            false => self.onto(solid).unwrap_or(air),
        }
    }

    fn rests(&self, place: &Place) -> bool {
        place.distance - self.clearance <= self.tolerance
    }

    /// Where the surface is at a place that rests on it: such places may be a tolerance off. Others are where they are.
    fn on_surface(&self, place: &Place) -> DVec3 {
        match self.rests(place) {
            true => {
                place.at
                    + (self.clearance - place.distance) / place.gradient.length_squared().max(1e-12)
                        * place.gradient
            }
            false => place.at,
        }
    }

    /// Share of the way between two places of the surface at which it no longer leads nearer to `goal`, by the secant of how far it does at its
    /// ends; nothing if it still does at the end. In a hollow the plane of a place leads past there, the farther the deeper the goal.
    fn turns(&self, from: &Place, to: &Place, goal: DVec3) -> Option<f64> {
        let along = to.at - from.at;
        let pull = |place: &Place| {
            let (lag, normal) = (goal - place.at, place.normal()?);
            Some((lag - lag.dot(normal) * normal).dot(along))
        };
        let (a, b) = (pull(from)?, pull(to)?);
        (a > 0.0 && b < 0.0).then(|| (a / (a - b)).clamp(0.05, 0.9))
    }

    /// The plane that holds a place which rests on the surface.
    fn plane(&self, place: &Place) -> Option<Plane> {
        self.rests(place).then(|| self.linear(place))
    }

    /// Where the surface is by the distance and gradient at a place.
    fn linear(&self, place: &Place) -> Plane {
        let normal = place.normal().unwrap_or(DVec3::Z);
        let off = (self.clearance - place.distance) / place.gradient.length().max(1e-6);
        Plane::through(place.at + off * normal, normal)
    }

    /// Goes straight on until the solid is met.
    fn walk(&self, from: Place, to: DVec3) -> Way {
        let way = to - from.at;
        let length = way.length();
        let direction = way / length;
        // No solid that is thicker fits between the ends of a step.
        let thinnest = 0.5 * (self.obstacle.finest() + self.clearance.max(0.0));
        let (mut gone, mut here) = (0.0, from);
        for _ in 0..STEPS {
            let air = here.distance - self.clearance;
            let fall = -here.gradient.dot(direction);
            let met = if fall > 0.0 {
                air.max(0.0) / fall
            } else {
                f64::INFINITY
            };
            let step = (SAFE * air)
                .max(thinnest.min(met + 0.02 * thinnest))
                .max(self.tolerance);
            gone += step;
            let is_there = gone >= length;
            let before = here;
            here = Place::of(
                self.obstacle,
                if is_there { to } else { from.at + gone * direction },
            );
            if here.distance < self.clearance - self.tolerance {
                return Way::Blocked { before, by: here };
            }
            if is_there {
                return Way::Free(here);
            }
        }
        Way::Long(here)
    }

    /// The end of a straight way, if no solid is met on it.
    pub fn free(&self, from: Place, to: DVec3) -> Option<Place> {
        match self.walk(from, to) {
            Way::Free(there) => Some(there),
            _ => None,
        }
    }

    /// The place on the surface by Newton steps along the gradient.
    pub fn onto(&self, mut place: Place) -> Option<Place> {
        for _ in 0..ONTO {
            let off = self.clearance - place.distance;
            // On it, or a hair beyond: never inside.
            if off.abs() <= 0.5 * self.tolerance {
                return Some(place);
            }
            let square = place.gradient.length_squared();
            if square < 1e-12 {
                return None;
            }
            place = Place::of(self.obstacle, place.at + (off / square) * place.gradient);
        }
        (place.distance >= self.clearance - self.tolerance).then_some(place)
    }
}
