//! Force boards of Haptikfabriken: WoodenHaptics, Polhem v1 and their kin. A place in three or six axes, a force in three.
//!
//! The board has the id of any board of its kind with raw reports, and cannot say which arm it drives. So a device counts as one
//! by its page and usage, and it pushes only after the user named the arm: wrong figures are wrong forces.
//!
//! The board is paced by whoever writes: the first report wakes it, it answers each, and without any for half a second it shuts
//! off its motors. Nothing of this was tried on hardware; usage and page of shipped boards are those of the library that boards of
//! this kind are programmed with.

pub mod kinematics;
pub mod report;
pub mod variants;

#[cfg(test)]
mod tests;

use glam::{DQuat, DVec3};
use tools::haptics::{Abilities, Pose};

use crate::devices::link::{Compose, Model, Order, Out};
use crate::devices::report::Sample;
use crate::devices::transport::{Identity, TransportError};
use variants::Variant;

/// Vendor and product of the board.
const IDS: (u16, u16) = (0x16c0, 0x0486);
/// Its page and usage.
const USAGE: (u16, u16) = (0xffab, 0x0200);

/// Currents stay below this, mA: the makers' own limit.
const CURRENT: f64 = 1999.0;

/// Time between two reports, s.
const PERIOD: f64 = 0.001;

/// Time between two settings of the encoders while the board asks, s.
const PRESET_PERIOD: f64 = 0.1;

/// Whether a device may be such a board.
pub fn recognize(identity: &Identity) -> bool {
    (identity.vendor, identity.product) == IDS && identity.has(USAGE.0, USAGE.1)
}

/// Axes of the arm (towards the user, to his right, up) in those of the room (right, away from the user, up).
fn room_from_arm(v: DVec3) -> DVec3 {
    DVec3::new(v.y, -v.x, v.z)
}

fn arm_from_room(v: DVec3) -> DVec3 {
    DVec3::new(-v.y, v.x, v.z)
}

/// An arm of known figures.
pub struct Arm {
    variant: &'static Variant,
    abilities: Abilities,
    holds_its_weight: bool,
    /// Of the last pose.
    angles: Option<DVec3>,
}

impl Arm {
    /// An arm that is held against gravity, or not.
    pub fn new(variant: &'static Variant, holds_its_weight: bool) -> Self {
        let resolution = kinematics::resolution(variant).into_iter().fold(0.0, f64::max);
        let abilities = Abilities {
            name: variant.title.into(),
            force: variant.force,
            // Not told by the makers.
            continuous_force: 0.0,
            torque: 0.0,
            // Assumed: of an arm with cables and small motors.
            damping: 0.5,
            stiffness: variant.stiffness,
            resolution: resolution * 1e3,
            period: PERIOD,
            // A report goes with the next frame of the bus.
            delay: PERIOD,
            reach: variant.radius * 1e3,
        };
        Self {
            variant,
            abilities,
            holds_its_weight,
            angles: None,
        }
    }
}

impl Model for Arm {
    fn abilities(&self) -> &Abilities {
        &self.abilities
    }

    fn pose(&mut self, sample: Option<(&Sample, f64)>, _now: f64) -> Option<Pose> {
        let [a, b, c, d, e, f, ..] = sample?.0.axes;
        let angles = kinematics::angles(self.variant, [a, b, c]);
        self.angles = Some(angles);
        let at = room_from_arm(kinematics::position(self.variant, angles)) * 1e3;
        // The gimbal is wired from the handle inwards.
        let turn = kinematics::turn(self.variant, angles, [f, e, d]);
        let v = room_from_arm(DVec3::new(turn.x, turn.y, turn.z));
        let turn = DQuat::from_xyzw(v.x, v.y, v.z, turn.w);
        Some(Pose { at, turn })
    }

    fn order(&mut self, force: DVec3, _torque: DVec3) -> Order {
        let Some(angles) = self.angles else {
            return Order::default();
        };
        let force = arm_from_room(force.clamp_length_max(self.variant.force));
        let mut torques = kinematics::torques(self.variant, angles, force);
        if self.holds_its_weight {
            torques += kinematics::gravity(self.variant, angles);
        }
        let current = kinematics::currents(self.variant, torques) * 1e3;
        // All of them together, so that the force keeps its direction.
        let largest = current.abs().max_element();
        let current = current * (CURRENT / largest.max(CURRENT));
        Order {
            force: current.to_array(),
            ..Order::default()
        }
    }
}

/// Turns currents into reports.
#[derive(Debug)]
pub struct Board {
    preset: [i16; 6],
    may_push: bool,
    last: Option<([i16; 3], f64)>,
    preset_at: f64,
}

impl Board {
    /// A board that pushes, or that only tells where it is.
    pub fn new(variant: &Variant, may_push: bool) -> Self {
        Self {
            preset: variant.preset,
            may_push,
            last: None,
            preset_at: f64::NEG_INFINITY,
        }
    }
}

impl Compose for Board {
    fn write(&mut self, order: &Order, now: f64, out: &mut Out) -> Result<(), TransportError> {
        if order.flags & report::ASKS != 0 {
            // Where the arm is, nobody knows yet: no current.
            if now - self.preset_at < PRESET_PERIOD {
                return self.currents([0; 3], now, out);
            }
            self.preset_at = now;
            self.last = None;
            return out(&report::with_preset(self.preset));
        }
        let current = |i: usize| match self.may_push {
            true => order.force[i].round().clamp(-CURRENT, CURRENT) as i16,
            false => 0,
        };
        self.currents([current(0), current(1), current(2)], now, out)
    }

    fn leave(&mut self, out: &mut Out) {
        let _ = out(&report::with_currents([0; 3]));
    }
}

impl Board {
    /// Asks for currents, where they changed or the board waits for a report.
    fn currents(&mut self, current: [i16; 3], now: f64, out: &mut Out) -> Result<(), TransportError> {
        if let Some((last, at)) = self.last
            && last == current
            && now - at < 0.9 * PERIOD
        {
            return Ok(());
        }
        out(&report::with_currents(current))?;
        self.last = Some((current, now));
        Ok(())
    }
}
