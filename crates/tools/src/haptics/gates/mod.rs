//! What stands between a force that is wished and the hand: passivity control, ramp, clamp, slew, and what takes all force away.
//!
//! A force goes coupling → passivity control → ramp → vector clamp → slew limit → hand. Each gate sees what the one before let
//! through; the observer of energy sees what was *sent*. What takes the force away at once (a pose that makes no sense, is too old
//! or too fast, a device or a writer that is gone) goes past the slew limit, and stays until the user arms again. A force goes on
//! only after: armed → the device told where it is → the wished force was small for some ticks → a ramp.

mod ceiling;
mod hold;
mod limit;
mod motion;
mod options;
mod passivity;
mod stage;
mod status;
mod thermal;
mod trip;

use glam::DVec3;

pub use ceiling::{Ceiling, Granted};
pub use hold::held;
pub use options::{GateError, GateOptions};
pub use stage::Stage;
pub use status::Status;
pub use trip::Trip;

use super::{Abilities, Contact, DeviceError, Reading};
use hold::HOLD;
use limit::{clamped, slewed};
use motion::Motion;
use passivity::Passivity;
use thermal::Thermal;

/// Force and torque for a tick, in newtons and newton-millimetres of the device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wrench {
    /// N.
    pub force: DVec3,
    /// N mm.
    pub torque: DVec3,
}

impl Wrench {
    /// Nothing.
    pub const ZERO: Self = Self {
        force: DVec3::ZERO,
        torque: DVec3::ZERO,
    };

    /// A share of it.
    fn times(self, share: f64) -> Self {
        Self {
            force: self.force * share,
            torque: self.torque * share,
        }
    }

    fn is_finite(&self) -> bool {
        self.force.is_finite() && self.torque.is_finite()
    }
}

/// The gates of one device: told a reading and then the wished force, once a tick.
#[derive(Clone, Debug)]
pub struct Gates {
    options: GateOptions,
    /// N and N mm that the device holds at most; the user's limit is among them.
    force: f64,
    torque: f64,
    /// Age from which a pose is told as late, and from which it is stale, s.
    late: f64,
    stale: f64,
    stage: Stage,
    motion: Motion,
    passivity: Passivity,
    thermal: Thermal,
    /// Share of the force that the age of the snapshot leaves, and whether that falls.
    fresh: f64,
    fades: bool,
    sent: Wrench,
    status: Status,
    late_poses: u64,
    stalls: u64,
}

impl Gates {
    /// Gates for a device behind which a coupling of a stiffness, N/m at the hand, pulls; they are shut until [`arm`](Self::arm).
    ///
    /// # Errors
    /// [`GateError`].
    pub fn new(abilities: &Abilities, stiffness: f64, options: GateOptions) -> Result<Self, GateError> {
        options.check()?;
        let force = abilities.force.min(options.force);
        Ok(Self {
            force,
            torque: abilities.torque,
            // A device that tells a pose each 16 ms is not late for 16 ms.
            late: f64::max(2e-3, 2.0 * abilities.period),
            stale: f64::max(10e-3, 3.0 * abilities.period),
            stage: Stage::Disarmed,
            motion: Motion::default(),
            passivity: Passivity::new(abilities, force, stiffness, options.passive),
            thermal: Thermal::new(force, abilities.continuous_force),
            fresh: 1.0,
            fades: false,
            sent: Wrench::ZERO,
            status: Status::default(),
            late_poses: 0,
            stalls: 0,
            options,
        })
    }

    /// The user wants force: it comes after the device has told where it is, the wished force was small, and a ramp. Takes back
    /// what [`Stage::Tripped`] says.
    pub fn arm(&mut self) {
        self.stage = Stage::Homing;
        self.motion = Motion::default();
        self.sent = Wrench::ZERO;
        self.passivity.forget();
    }

    /// The user wants no force: none from now on, past the slew limit.
    pub fn disarm(&mut self) {
        self.stage = Stage::Disarmed;
        self.sent = Wrench::ZERO;
    }

    /// Takes all force away until the user arms again. For what the gates do not see themselves, such as a writer that stalls.
    pub fn trip(&mut self, why: Trip) {
        // The first reason is the one to be told.
        if self.stage.is_armed() {
            self.stage = Stage::Tripped(why);
        }
        self.sent = Wrench::ZERO;
    }

    /// Looks at what the device told `dt` seconds after the last look. Gives what may be rendered: nothing where it makes no sense.
    pub fn admit(&mut self, told: Result<&Reading, &DeviceError>, dt: f64) -> Option<Reading> {
        self.status = Status::default();
        if !(dt.is_finite() && dt > 0.0) {
            self.trip(Trip::Clock);
            return None;
        }
        if dt > HOLD {
            self.stalls += 1;
            self.status |= Status::STALLED;
        }
        // What the hand feels by now of what was sent last.
        let held = held(dt);
        self.passivity.passed(self.sent.force, 0.5 * (1.0 + held));
        self.thermal.passed(self.sent.force, dt);
        self.sent = self.sent.times(held);
        let reading = match told {
            Ok(reading) => *reading,
            // It has not been led to its stops yet, or nobody has moved it.
            Err(DeviceError::Silent(_)) if !self.stage.is_past_homing() => return None,
            Err(DeviceError::Silent(_)) => {
                self.trip(Trip::Stale);
                return None;
            }
            Err(_) => {
                self.trip(Trip::Gone);
                return None;
            }
        };
        if !reading.pose.is_finite() || !reading.age.is_finite() {
            self.trip(Trip::NotFinite);
            return None;
        }
        self.motion.told(&reading, dt);
        if self.motion.speed() > self.options.speed {
            self.trip(Trip::TooFast);
        }
        if reading.age > self.stale {
            // A device that is armed before it tells anything new is waited for.
            match self.stage.is_past_homing() {
                true => self.trip(Trip::Stale),
                false => return Some(reading),
            }
        } else if reading.age > self.late {
            self.late_poses += 1;
            self.status |= Status::LATE_POSE;
        }
        if self.stage == Stage::Homing && reading.age <= self.stale {
            self.stage = Stage::Waiting { ticks: 0 };
        }
        Some(reading)
    }

    /// The force that goes to the hand for one that is wished. `heartbeat` is the time since the simulation was last alive, s.
    pub fn pass(&mut self, wished: Wrench, contact: Contact, heartbeat: f64, dt: f64) -> Wrench {
        if !wished.is_finite() || heartbeat.is_nan() {
            self.trip(Trip::NotFinite);
        }
        self.status |= Status::of(contact);
        self.freshen(heartbeat, dt);
        let is_small = wished.force.length() < self.options.small_force && contact != Contact::Inside;
        let share = self.stage.advance(is_small, &self.options, dt);
        self.passivity.observe(self.motion.way(), dt);
        self.sent = match share {
            None => Wrench::ZERO,
            Some(share) => self.gated(wished, share * self.fresh),
        };
        if !self.sent.is_finite() {
            self.trip(Trip::NotFinite);
        }
        self.status |= Status::at(self.stage);
        self.sent
    }

    /// No force in this tick: there is nothing that could be rendered.
    pub fn shut(&mut self) {
        self.sent = Wrench::ZERO;
        self.status |= Status::BLIND;
        self.status |= Status::at(self.stage);
    }

    /// The gates in their order.
    fn gated(&mut self, wished: Wrench, share: f64) -> Wrench {
        let damping = self.passivity.damping(self.motion.velocity());
        if damping != DVec3::ZERO {
            self.status |= Status::PASSIVITY;
        }
        let ramped = Wrench {
            force: wished.force + damping,
            torque: wished.torque,
        }
        .times(share);
        let most = self.thermal.limit();
        let limited = Wrench {
            force: clamped(ramped.force, most),
            torque: clamped(ramped.torque, self.torque),
        };
        if limited != ramped {
            self.status |= Status::CLAMPED;
        }
        if most < self.force {
            self.status |= Status::WARM;
        }
        let sent = Wrench {
            force: slewed(self.sent.force, limited.force, self.options.slew),
            torque: slewed(self.sent.torque, limited.torque, self.options.torque_slew),
        };
        if sent != limited {
            self.status |= Status::SLEWED;
        }
        sent
    }

    /// The force fades while the simulation is not heard of, and comes back as slowly. A fade goes on to its end: a spring that gets its
    /// stiffness back while it is pressed gives energy.
    fn freshen(&mut self, heartbeat: f64, dt: f64) {
        self.fades = heartbeat > self.options.snapshot_age || (self.fades && self.fresh > 0.0);
        let to = if self.fades { 0.0 } else { 1.0 };
        let most = dt / self.options.fade;
        self.fresh += f64::clamp(to - self.fresh, -most, most);
        if self.fresh < 1.0 {
            self.status |= Status::OLD_SNAPSHOT;
        }
    }

    /// Whether nothing is left of the force, as the simulation has not been heard of for so long.
    pub fn is_faded(&self) -> bool {
        self.fresh == 0.0
    }

    /// How far on its way to giving force it is.
    pub fn stage(&self) -> Stage {
        self.stage
    }

    /// What happened in this tick.
    pub fn status(&self) -> Status {
        self.status
    }

    /// What was sent last, as far as the hand still feels it.
    pub fn sent(&self) -> Wrench {
        self.sent
    }

    /// Energy that the hand has put in and not got back, J, as the observer counts it; never more than the coupling can hold.
    pub fn energy(&self) -> f64 {
        self.passivity.energy()
    }

    /// Poses that were late and not yet stale, and ticks that came after the last force had begun to fade.
    pub fn counts(&self) -> (u64, u64) {
        (self.late_poses, self.stalls)
    }

    /// N that it sends at most now.
    pub fn limit(&self) -> f64 {
        self.thermal.limit()
    }
}

#[cfg(test)]
mod tests;
