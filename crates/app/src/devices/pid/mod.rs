//! Force devices by the HID class for physical interfaces: sticks and wheels with one to three axes that push.
//!
//! Two ways to a force. A *spring* on every axis rests at the place of the hand plus force over stiffness, so that the loop closes
//! inside of the device and the program only moves the spring: stable at any rate of reports, but no stiffer than the device's
//! largest force over its way, and it only pushes, never holds back. A *constant* force is what is asked for, a report or more late.
//!
//! Effects last [`DURATION`] and are started again before that, so that a program that was killed leaves no force behind.
//!
//! A descriptor tells neither newtons nor millimetres: both are what the user says ([`Scale`]). Not tried on hardware. Springs push
//! back by definition; that a constant force at 270 degrees pushes to the right is what Linux documents of its own directions,
//! which it hands through.

pub mod descriptor;
pub mod effects;
pub mod input;
pub mod layout;
pub mod slot;

#[cfg(test)]
mod makers;
#[cfg(test)]
mod tests;

use glam::DVec3;
use tools::haptics::{Abilities, Pose};

use crate::devices::frame::room_from_hid;
use crate::devices::link::{Compose, Model, Order, Out};
use crate::devices::report::Sample;
use crate::devices::transport::{Identity, Transport, TransportError};
use effects::{CreateError, Kind, Spring};
use layout::{Layout, Missing};

/// Page of the physical interface class.
const PAGE: u16 = 0x0f;

/// Time that an effect lasts, ms.
const DURATION: i64 = 200;

/// Time after which it is started again, s.
const RENEWED: f64 = 0.05;

/// Time between two input reports, s, at the slowest that is usual.
const PERIOD: f64 = 0.008;

/// Time that a report takes on the bus, s.
const REPORT: f64 = 0.001;

/// Directions from which a positive constant force comes, in hundredths of a degree from the far side over the right: it pushes
/// along the axis.
const DIRECTIONS: [u32; 3] = [27_000, 0, 0];

/// Whether a device is one.
pub fn recognize(identity: &Identity) -> bool {
    identity.usages.iter().any(|(page, _)| *page == PAGE)
}

/// What a descriptor does not tell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Largest force at the handle, N.
    pub force: f64,
    /// Half the way of the handle, mm.
    pub travel: f64,
}

impl Default for Scale {
    /// A stick of the usual size.
    fn default() -> Self {
        Self {
            force: 5.0,
            travel: 60.0,
        }
    }
}

/// A stick: what its axes mean.
pub struct Stick {
    input: layout::Input,
    has_axis: [bool; 3],
    scale: Scale,
    abilities: Abilities,
    /// Shares of the way of the axes, at the last pose.
    at: DVec3,
}

impl Stick {
    /// A stick of a layout.
    pub fn new(name: &str, layout: &Layout, kind: Kind, scale: Scale) -> Self {
        let has_axis = [0, 1, 2].map(|axis| layout.has_axis(axis));
        let count = has_axis.iter().filter(|has| **has).count();
        let steps = layout.input.axes[0].map_or(1, |slot| slot.max - slot.min);
        let abilities = Abilities {
            name: name.into(),
            force: scale.force,
            continuous_force: 0.0,
            torque: 0.0,
            // Assumed: of a stick on belts or gears.
            damping: 0.5,
            stiffness: match kind {
                Kind::Spring => scale.force / (scale.travel * 1e-3),
                Kind::Constant => f64::INFINITY,
            },
            resolution: 2.0 * scale.travel / steps.max(1) as f64,
            period: PERIOD,
            delay: REPORT * count as f64,
            reach: scale.travel,
        };
        Self {
            input: layout.input.clone(),
            has_axis,
            scale,
            abilities,
            at: DVec3::ZERO,
        }
    }
}

impl Model for Stick {
    fn abilities(&self) -> &Abilities {
        &self.abilities
    }

    fn pose(&mut self, sample: Option<(&Sample, f64)>, _now: f64) -> Option<Pose> {
        let axes = sample?.0.axes;
        for i in 0..3 {
            if let Some(slot) = self.input.axes[i].filter(|_| self.has_axis[i]) {
                let (low, high) = (slot.min as f64, slot.max as f64);
                let share = (2.0 * f64::from(axes[i]) - low - high) / (high - low);
                self.at[i] = if share.is_finite() {
                    share.clamp(-1.0, 1.0)
                } else {
                    0.0
                };
            }
        }
        Some(Pose::at(room_from_hid(self.at) * self.scale.travel))
    }

    fn order(&mut self, force: DVec3, _torque: DVec3) -> Order {
        let share = room_from_hid(force).clamp_length_max(self.scale.force) / self.scale.force;
        Order {
            force: share.to_array(),
            at: self.at.to_array(),
            flags: 0,
        }
    }
}

/// The effects of a device under way.
pub struct Effects {
    layout: Layout,
    kind: Kind,
    /// Axis and number of each effect. A spring has one number on all axes.
    effects: Vec<(usize, i64)>,
    last: Vec<Option<Vec<u8>>>,
    started: f64,
}

impl Effects {
    /// Enables the motors and makes an effect for each axis. Waits.
    ///
    /// # Errors
    /// [`CreateError`]; the motors are off then.
    pub fn begin(layout: Layout, kind: Kind, transport: &mut dyn Transport) -> Result<Self, CreateError> {
        let mut this = Self {
            layout,
            kind,
            effects: Vec::new(),
            last: Vec::new(),
            started: f64::NEG_INFINITY,
        };
        let made = this.make(transport);
        if made.is_err() {
            this.leave(&mut |report| transport.write(report));
        }
        made.map(|()| this)
    }

    fn make(&mut self, transport: &mut dyn Transport) -> Result<(), CreateError> {
        let layout = &self.layout;
        let control = &layout.control;
        for command in [Some(control.stop), control.reset].into_iter().flatten() {
            transport.write(&layout.command(command))?;
        }
        if let Some(gain) = layout.full_gain() {
            transport.write(&gain)?;
        }
        let has = [0, 1, 2].map(|axis| layout.has_axis(axis));
        let axes = (0..3).filter(|axis| has[*axis]);
        match self.kind {
            Kind::Spring => {
                if layout.condition.is_none() {
                    return Err(Missing("report to set a spring").into());
                }
                let index = layout.create(transport, Kind::Spring)?;
                transport.write(&layout.set_effect(index, Kind::Spring, has, 0, DURATION)?)?;
                // Some have springs on one axis only.
                let first = layout.condition.as_ref().is_some_and(|c| c.block.is_none());
                let count = if first { 1 } else { 3 };
                self.effects = axes.take(count).map(|axis| (axis, index)).collect();
            }
            Kind::Constant => {
                if layout.constant.is_none() {
                    return Err(Missing("report to set a constant force with a sign").into());
                }
                for axis in axes {
                    let index = layout.create(transport, Kind::Constant)?;
                    let only = [0, 1, 2].map(|i| i == axis);
                    let direction = DIRECTIONS[axis];
                    transport.write(&layout.set_effect(
                        index,
                        Kind::Constant,
                        only,
                        direction,
                        DURATION,
                    )?)?;
                    self.effects.push((axis, index));
                }
            }
        }
        self.last = vec![None; self.effects.len()];
        for (axis, index) in &self.effects {
            if let Some(report) = self.say(*axis, *index, 0.0, 0.0) {
                transport.write(&report)?;
            }
        }
        transport.write(&self.layout.command(self.layout.control.enable))?;
        Ok(())
    }

    /// The report for a share of the largest force on an axis whose hand is at a share of its way.
    fn say(&self, axis: usize, index: i64, force: f64, at: f64) -> Option<Vec<u8>> {
        match self.kind {
            Kind::Constant => self.layout.set_constant(index, force),
            Kind::Spring => {
                // Stiff only where the hand is pushed from: it may leave the surface freely.
                let stiffness = [force < 0.0, force > 0.0].map(|is_on| if is_on { 1.0 } else { 0.0 });
                let spring = Spring {
                    centre: (at + force).clamp(-1.0, 1.0),
                    stiffness,
                    saturation: 1.0,
                };
                self.layout.set_spring(index, axis, &spring)
            }
        }
    }
}

impl Compose for Effects {
    fn write(&mut self, order: &Order, now: f64, out: &mut Out) -> Result<(), TransportError> {
        let mut pushes = false;
        for i in 0..self.effects.len() {
            let (axis, index) = self.effects[i];
            let (force, at) = (order.force[axis], order.at[axis]);
            pushes |= force != 0.0;
            let report = self.say(axis, index, force, at);
            if report.is_some() && report != self.last[i] {
                if let Some(report) = &report {
                    out(report)?;
                }
                self.last[i] = report;
            }
        }
        if pushes && now - self.started >= RENEWED {
            let mut numbers: Vec<i64> = self.effects.iter().map(|(_, index)| *index).collect();
            numbers.dedup();
            for index in numbers {
                out(&self.layout.start(index))?;
            }
            self.started = now;
        }
        Ok(())
    }

    fn leave(&mut self, out: &mut Out) {
        for (axis, index) in &self.effects {
            if let Some(report) = self.say(*axis, *index, 0.0, 0.0) {
                let _ = out(&report);
            }
        }
        for command in [self.layout.control.stop, self.layout.control.disable] {
            let _ = out(&self.layout.command(command));
        }
    }
}
