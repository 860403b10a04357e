//! SpaceMouse and its kin: a cap with six axes that is pushed and turned, and no force.
//!
//! The cap tells how far it is out of its rest, -350 to 350 an axis, 62.5 times a second. That is taken for a speed: the tool goes on
//! while the cap is held. Nobody says whether a cap that is held still goes on reporting, so the last report counts for
//! [`Rate::hold`] and the speed fades out then; the next report revives it.
//!
//! Not tried on hardware: the signs of the axes are those on which two drivers agree, the rest is what reports are documented to hold.

pub mod ids;
pub mod reports;

#[cfg(test)]
mod tests;

use glam::{DQuat, DVec3};
use tools::haptics::{Abilities, Pose};

use crate::devices::forceless;
use crate::devices::frame::room_from_hid;
use crate::devices::lag::{Lag, Ticks};
use crate::devices::link::{Compose, Model, Order, Out};
use crate::devices::report::Sample;
use crate::devices::transport::TransportError;

/// Largest count of an axis by the descriptor; some units exceed it a little.
const FULL: f64 = 350.0;

/// Time between two poses, s: split devices send one half every 8 ms, the others all of it at 62.5 Hz.
const PERIOD: f64 = 0.016;

/// How a cap steers.
#[derive(Clone, Copy, Debug)]
pub struct Rate {
    /// Share of the way of an axis that is no way: caps do not come back to the very middle.
    pub deadzone: f64,
    /// Speed of a cap that is fully out, mm/s.
    pub speed: f64,
    /// Turn of a cap that is fully out, rad/s.
    pub turn: f64,
    /// Time of the lag between a report and the speed, s: smooths steps of 16 ms for a tick of 1 ms.
    pub lag: f64,
    /// Time that a report counts, s.
    pub hold: f64,
    /// Half the width of the room in which the tool goes, mm.
    pub reach: f64,
}

impl Default for Rate {
    fn default() -> Self {
        Self {
            deadzone: 0.04,
            speed: 80.0,
            turn: 1.2,
            lag: 0.03,
            hold: 0.1,
            reach: 100.0,
        }
    }
}

/// Share of the full way of an axis, -1 to 1, 0 in the dead zone and without a step at its end.
fn share(count: i32, deadzone: f64) -> f64 {
    let share = (f64::from(count) / FULL).clamp(-1.0, 1.0);
    let beyond = (share.abs() - deadzone).max(0.0) / (1.0 - deadzone);
    beyond.copysign(share)
}

/// A cap that steers a tool.
pub struct SpaceMouse {
    rate: Rate,
    abilities: Abilities,
    ticks: Ticks,
    speed: Lag,
    turn: Lag,
    pose: Pose,
}

impl SpaceMouse {
    /// A tool in the middle of its room, at rest.
    pub fn new(name: &str, rate: Rate) -> Self {
        // The way of one count in the time between two reports.
        let resolution = rate.speed / FULL * PERIOD;
        let abilities = forceless::abilities(name, resolution, PERIOD, rate.reach);
        Self {
            abilities,
            ticks: Ticks::default(),
            speed: Lag::at(DVec3::ZERO, rate.lag),
            turn: Lag::at(DVec3::ZERO, rate.lag),
            pose: Pose::at(DVec3::ZERO),
            rate,
        }
    }

    /// Moves on to `now`. `told` is when the sample came, s.
    fn steer(&mut self, sample: &Sample, told: f64, now: f64) {
        let dt = self.ticks.since(now);
        let is_held = now - told <= self.rate.hold;
        let goal = |first: usize, full: f64| {
            let axis = |i: usize| share(sample.axes[first + i], self.rate.deadzone);
            match is_held {
                true => room_from_hid(DVec3::new(axis(0), axis(1), axis(2))) * full,
                false => DVec3::ZERO,
            }
        };
        let (speed, turn) = (goal(0, self.rate.speed), goal(3, self.rate.turn));
        let way = self.speed.towards(speed, dt) * dt;
        let angle = self.turn.towards(turn, dt) * dt;
        let reach = DVec3::splat(self.rate.reach);
        self.pose.at = (self.pose.at + way).clamp(-reach, reach);
        // Turns of a tick are so small that their half is its sine.
        let small = DQuat::from_xyzw(angle.x / 2.0, angle.y / 2.0, angle.z / 2.0, 1.0);
        self.pose.turn = (small * self.pose.turn).normalize();
    }
}

impl Model for SpaceMouse {
    fn abilities(&self) -> &Abilities {
        &self.abilities
    }

    fn pose(&mut self, sample: Option<(&Sample, f64)>, now: f64) -> Option<Pose> {
        let rest = Sample::default();
        let (sample, told) = sample.unwrap_or((&rest, now));
        self.steer(sample, told, now);
        Some(self.pose)
    }

    fn holds(&self) -> bool {
        true
    }

    fn order(&mut self, _force: DVec3, _torque: DVec3) -> Order {
        Order::default()
    }
}

/// The light under the cap: on while the tool is in use.
#[derive(Debug, Default)]
pub struct Light {
    is_on: bool,
}

impl Compose for Light {
    fn write(&mut self, _order: &Order, _now: f64, out: &mut Out) -> Result<(), TransportError> {
        if !self.is_on {
            self.is_on = true;
            // Some light up only after they were told twice; a cap without a light is no loss.
            for value in [1, 0, 1] {
                let _ = out(&[0x04, value]);
            }
        }
        Ok(())
    }

    fn leave(&mut self, out: &mut Out) {
        let _ = out(&[0x04, 0]);
    }

    fn pace(&self) -> std::time::Duration {
        std::time::Duration::from_millis(20)
    }
}
