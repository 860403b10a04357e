//! What happened, tick by tick.

use glam::DVec3;

use super::super::{Contact, Pose};

/// One tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tick {
    /// When, s.
    pub time: f64,
    /// Time to the next, s.
    pub dt: f64,
    /// What the device told; not a number where it told nothing.
    pub read: Pose,
    /// Where it truly was, mm.
    pub at: DVec3,
    /// Where the hand wanted to be, mm.
    pub target: DVec3,
    /// Force that was sent, N.
    pub force: DVec3,
    /// Torque that was sent, N mm.
    pub torque: DVec3,
    /// Force of the motors at the end of the tick, N.
    pub applied: DVec3,
    /// Where the tool would be.
    pub proxy: Pose,
    /// Distance of the proxy's handle point, mm, in the obstacle of the tick.
    pub distance: f64,
    /// What the tool had to do with the solid.
    pub contact: Contact,
    /// Energy that the law of force gave back so far, J: the sum of ½ (F₋ + F)·Δx over what was told. 0 over any closed
    /// way through a static field of springs, whatever the ticks and counts are.
    pub returned: f64,
    /// Work of the motors so far, J, with all that ticks and delays add.
    pub work: f64,
    /// Age of the obstacle, s.
    pub age: f64,
    /// Cost of the tick, s, if a clock was given.
    pub cost: f64,
}

/// What happened, from the first tick to the last.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// All ticks.
    pub ticks: Vec<Tick>,
}

impl Trace {
    /// The ticks from one time to another, s.
    pub fn between(&self, from: f64, until: f64) -> &[Tick] {
        let of = |t: f64| self.ticks.partition_point(|k| k.time < t - 1e-9);
        let (first, end) = (of(from), of(until));
        &self.ticks[first..end.max(first)]
    }

    /// The ticks of the last so many seconds.
    pub fn last(&self, seconds: f64) -> &[Tick] {
        let end = self.ticks.last().map_or(0.0, |t| t.time + t.dt);
        self.between(end - seconds, f64::INFINITY)
    }

    /// How often the proxy changed to another side, as a function of place says it.
    pub fn crossings(&self, is_here: impl Fn(DVec3) -> bool) -> usize {
        let sides: Vec<bool> = self.ticks.iter().map(|t| is_here(t.proxy.at)).collect();
        sides.windows(2).filter(|w| w[0] != w[1]).count()
    }
}

/// Mean force over ticks, N.
pub(super) fn mean_force(ticks: &[Tick]) -> DVec3 {
    ticks.iter().map(|t| t.force).sum::<DVec3>() / ticks.len().max(1) as f64
}

/// From the lowest to the highest force over ticks, N, as the length of the box that holds all.
pub(super) fn ripple(ticks: &[Tick]) -> f64 {
    let Some(first) = ticks.first() else {
        return 0.0;
    };
    let (low, high) = ticks.iter().fold((first.force, first.force), |(low, high), t| {
        (low.min(t.force), high.max(t.force))
    });
    (high - low).length()
}
