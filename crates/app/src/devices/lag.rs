//! From values that come a few dozen times a second to one for every tick.

use glam::DVec3;

/// Longest time between two looks that is made up for, s: who was away longer goes on from where they were.
const LONGEST_TICK: f64 = 0.01;

/// A first-order lag: after its time 63 % of a step have arrived.
#[derive(Clone, Copy, Debug)]
pub struct Lag {
    /// Its time, s.
    time: f64,
    value: DVec3,
}

impl Lag {
    /// A lag at rest at a value.
    pub fn at(value: DVec3, time: f64) -> Self {
        Self { time, value }
    }

    /// Goes towards a goal for `dt` seconds.
    pub fn towards(&mut self, goal: DVec3, dt: f64) -> DVec3 {
        self.value += (goal - self.value) * -libm::expm1(-dt / self.time);
        self.value
    }
}

/// Times between looks.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ticks {
    last: Option<f64>,
}

impl Ticks {
    /// Time since the last look, s, 0 at the first, and never more than [`LONGEST_TICK`].
    pub fn since(&mut self, now: f64) -> f64 {
        let last = self.last.replace(now).unwrap_or(now);
        (now - last).clamp(0.0, LONGEST_TICK)
    }
}
