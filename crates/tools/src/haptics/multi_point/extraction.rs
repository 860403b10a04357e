//! The way out of solid that has grown over the tool, where planes do not lead out \[Sensable99 fig. 7C, Figs. 16A-B\].

use glam::DVec3;

use super::super::{Obstacle, Pose};
use super::MultiPoint;
use super::places::{Places, arm, ask};

/// Random directions that are tried in a tick.
const TRIES: usize = 6;
/// Share of a step by which the deepest point must rise.
const PROGRESS: f64 = 1e-3;

impl MultiPoint {
    /// Lifts the proxy if the march has not: along the normal of the deepest point, then along those of points chosen at random.
    /// A move counts if the deepest point rises by it. If none does, the tool is buried. `depth` is where the deepest point was when
    /// the tick began.
    pub(super) fn extract(&mut self, obstacle: &dyn Obstacle, depth: f64) {
        let step = self.push_left.max(0.0);
        let (deepest, which) = self.places.deepest_own();
        if -deepest < depth - PROGRESS * step || -deepest <= self.options.tolerance {
            return;
        }
        if self.rise(obstacle, self.out(which, step), -deepest) {
            return;
        }
        let inside = |places: &Places, i: usize| places.here[i].is_exact && places.here[i].clearance < 0.0;
        let count = (0..self.places.own).filter(|i| inside(&self.places, *i)).count();
        for _ in 0..TRIES.min(count) {
            let chosen = (self.random.next() % count as u64) as usize;
            let nth = (0..self.places.own)
                .filter(|i| inside(&self.places, *i))
                .nth(chosen);
            if nth.is_some_and(|i| self.rise(obstacle, self.out(i, step), -deepest)) {
                return;
            }
        }
        self.is_buried = self.middle(obstacle).0 < 0.0;
    }

    /// Moves a buried tool along the normal at its middle: until that is out, and on as long as the deepest point rises.
    pub(super) fn surface(&mut self, obstacle: &dyn Obstacle, depth: f64) {
        let (distance, gradient) = self.middle(obstacle);
        let way = self.push_left * gradient.normalize_or(DVec3::Z);
        let limit = if distance < 0.0 { f64::INFINITY } else { depth };
        self.is_buried = depth > self.options.tolerance && self.rise(obstacle, way, limit);
    }

    /// Distance and gradient at the middle of the tool's points.
    fn middle(&self, obstacle: &dyn Obstacle) -> (f64, DVec3) {
        obstacle.distance(self.pose.at + arm(&self.tool, &self.places.turn, self.tool.middle))
    }

    /// Moves the tool if no point of it is then as deep as a limit.
    fn rise(&mut self, obstacle: &dyn Obstacle, way: DVec3, limit: f64) -> bool {
        let pose = Pose {
            at: self.pose.at + way,
            turn: self.pose.turn,
        };
        let mut deepest = 0.0f64;
        for k in 0..self.places.len() {
            self.places.there[k] = self.places.here[k];
            if self.places.counts[k] {
                self.places.there[k] = ask(
                    &self.tool,
                    obstacle,
                    &pose,
                    &self.places.turn,
                    self.places.here[k].on,
                );
                deepest = deepest.min(self.places.there[k].clearance);
            }
        }
        let is_better = -deepest < limit - PROGRESS * way.length() && way != DVec3::ZERO;
        if is_better {
            self.accept(&[way.x, way.y, way.z, 0.0, 0.0, 0.0]);
        }
        is_better
    }

    /// Way out of the solid along the normal of a point, no further than it is deep.
    fn out(&self, i: usize, step: f64) -> DVec3 {
        let place = &self.places.here[i];
        step.min(-place.clearance) * place.gradient.normalize_or_zero()
    }
}
