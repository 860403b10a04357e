//! The way out of solid that has grown over the tool, where planes do not lead out [SVO Fig. 7C, Figs. 16A-B].

use glam::DVec3;

use super::super::{Obstacle, Pose};
use super::MultiPoint;
use super::places::ask;

/// Random directions that are tried in a tick.
const TRIES: usize = 6;
/// Share of a step by which the deepest point must rise.
const PROGRESS: f64 = 1e-3;

impl MultiPoint {
    /// Lifts the proxy if the march has not: along the normal of the deepest point, then along those of points chosen at random.
    /// A move counts if the deepest point rises by it. `depth` is where that was when the tick began.
    pub(super) fn extract(&mut self, obstacle: &dyn Obstacle, depth: f64, dt: f64) {
        let step = self.options.push_out * dt;
        let (deepest, which) = self.places.deepest();
        if -deepest < depth - PROGRESS * step || -deepest <= self.options.tolerance {
            return;
        }
        let mut now = -deepest;
        if self.rise(obstacle, which, step, &mut now) {
            return;
        }
        for _ in 0..TRIES {
            let inside = |i: &usize| self.places.counts[*i] && self.places.here[*i].clearance < 0.0;
            let count = (0..self.places.len()).filter(inside).count();
            if count == 0 {
                return;
            }
            let chosen = (self.random.next() % count as u64) as usize;
            let Some(i) = (0..self.places.len()).filter(inside).nth(chosen) else {
                return;
            };
            if self.rise(obstacle, i, step, &mut now) {
                return;
            }
        }
    }

    /// Moves along the normal of a point, no further than it is deep, if that makes the tool less deep.
    fn rise(&mut self, obstacle: &dyn Obstacle, i: usize, step: f64, depth: &mut f64) -> bool {
        let place = self.places.here[i];
        let normal = place.gradient.normalize_or_zero();
        let way = step.min(-place.clearance) * normal;
        if way == DVec3::ZERO {
            return false;
        }
        let pose = Pose {
            at: self.pose.at + way,
            turn: self.pose.turn,
        };
        let mut deepest = 0.0f64;
        for k in 0..self.places.len() {
            if self.places.counts[k] {
                self.places.there[k] = ask(
                    &self.tool,
                    obstacle,
                    &pose,
                    self.places.turn,
                    self.places.here[k].on,
                );
                deepest = deepest.min(self.places.there[k].clearance);
            } else {
                self.places.there[k] = self.places.here[k];
            }
        }
        if -deepest >= *depth - PROGRESS * step {
            return false;
        }
        *depth = -deepest;
        self.accept(&[way.x, way.y, way.z, 0.0, 0.0, 0.0]);
        true
    }
}
