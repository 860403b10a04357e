//! Reports to a force device, composed from its layout.

use super::descriptor::Way;
use super::layout::{Layout, Missing};
use super::slot::{Choice, Slot};
use crate::devices::transport::{Transport, TransportError};

/// Kinds of effects that are of use for touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A force that stays.
    Constant,
    /// A spring between the hand and a place, on every axis.
    Spring,
}

/// Times that the number of a new effect is asked for, as Linux does.
const TRIES: usize = 60;

/// Why no effect was made.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CreateError {
    /// The device cannot.
    #[error(transparent)]
    Missing(#[from] Missing),
    /// On the way.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// It has no memory left.
    #[error("the device has no room for another effect; unplug it and plug it in again")]
    Full,
    /// It does not say.
    #[error("the device did not say the number of its new effect")]
    NoAnswer,
}

/// A spring on one axis, in shares of the ranges of the device.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spring {
    /// Where it rests, -1 to 1.
    pub centre: f64,
    /// How stiff it is beyond that, 0 to 1, and before it.
    pub stiffness: [f64; 2],
    /// Largest force, 0 to 1.
    pub saturation: f64,
}

impl Layout {
    /// Has the device make an effect, and gives its number. Waits.
    ///
    /// # Errors
    /// [`CreateError`].
    pub fn create(&self, transport: &mut dyn Transport, kind: Kind) -> Result<i64, CreateError> {
        let mut report = self.blank(Way::Feature, self.create.report);
        self.kind(kind, self.create.constant, self.create.spring)?
            .put(&mut report);
        transport.set_feature(&report)?;
        let load = &self.load;
        let mut report = self.blank(Way::Feature, load.index.report);
        for _ in 0..TRIES {
            report.fill(0);
            report[0] = load.index.report;
            let length = transport.feature(&mut report)?;
            let told = &report[..length.min(report.len())];
            if load.success.holds(told) {
                return load.index.get(told).ok_or(CreateError::NoAnswer);
            }
            if load.full.is_some_and(|full| full.holds(told)) {
                return Err(CreateError::Full);
            }
        }
        Err(CreateError::NoAnswer)
    }

    fn kind(&self, kind: Kind, constant: Option<Choice>, spring: Option<Choice>) -> Result<Choice, Missing> {
        match kind {
            Kind::Constant => constant.ok_or(Missing("constant force")),
            Kind::Spring => spring.ok_or(Missing("spring")),
        }
    }

    /// Sets an effect up: its axes, a direction if it has one (hundredths of a degree), and a duration in ms.
    ///
    /// # Errors
    /// [`Missing`] where the device has no such effect.
    pub fn set_effect(
        &self,
        index: i64,
        kind: Kind,
        axes: [bool; 3],
        direction: u32,
        duration: i64,
    ) -> Result<Vec<u8>, Missing> {
        let effect = &self.effect;
        let mut report = self.blank(Way::Output, effect.index.report);
        effect.index.put(&mut report, index);
        self.kind(kind, effect.constant, effect.spring)?.put(&mut report);
        let all = |slot: Slot| slot.max;
        put(effect.duration, &mut report, |_| duration);
        put(effect.gain, &mut report, all);
        for (choice, is_on) in effect.axes.iter().zip(axes) {
            if let Some(choice) = choice.filter(|_| is_on) {
                choice.put(&mut report);
            }
        }
        if kind == Kind::Constant {
            if let Some(choice) = effect.direction_enable {
                choice.put(&mut report);
            }
            // A whole turn is the range of the field, whatever that is.
            put(effect.directions[0], &mut report, |slot| {
                (f64::from(direction) / 36_000.0 * slot.max as f64).round() as i64
            });
        }
        Ok(report)
    }

    /// Sets a constant force, as a share of the largest, -1 to 1. None of a device without.
    pub fn set_constant(&self, index: i64, share: f64) -> Option<Vec<u8>> {
        let constant = self.constant.as_ref()?;
        let mut report = self.blank(Way::Output, constant.index.report);
        constant.index.put(&mut report, index);
        let value = constant.magnitude.share(share);
        constant.magnitude.put(&mut report, value);
        Some(report)
    }

    /// Sets the spring of an axis. None of a device without, or without one on that axis.
    pub fn set_spring(&self, index: i64, axis: usize, spring: &Spring) -> Option<Vec<u8>> {
        let condition = self.condition.as_ref()?;
        let mut report = self.blank(Way::Output, condition.index.report);
        condition.index.put(&mut report, index);
        match condition.block {
            Some(block) => block.put(&mut report, axis as i64),
            None if axis > 0 => return None,
            None => {}
        }
        let share = |of: f64| move |slot: Slot| slot.share(of);
        put(Some(condition.centre), &mut report, share(spring.centre));
        put(Some(condition.positive), &mut report, share(spring.stiffness[0]));
        put(condition.negative, &mut report, share(spring.stiffness[1]));
        for saturation in condition.saturations {
            put(saturation, &mut report, share(spring.saturation));
        }
        put(condition.dead, &mut report, |_| 0);
        Some(report)
    }

    /// Starts an effect, once.
    pub fn start(&self, index: i64) -> Vec<u8> {
        let operation = &self.operation;
        let mut report = self.blank(Way::Output, operation.index.report);
        operation.index.put(&mut report, index);
        operation.start.put(&mut report);
        put(operation.loops, &mut report, |_| 1);
        report
    }

    /// A command to all of the device.
    pub fn command(&self, command: Choice) -> Vec<u8> {
        let mut report = self.blank(Way::Output, command.slot.report);
        command.put(&mut report);
        report
    }

    /// Sets the gain of all effects to its largest. None of a device without.
    pub fn full_gain(&self) -> Option<Vec<u8>> {
        let gain = self.gain?;
        let mut report = self.blank(Way::Output, gain.report);
        gain.put(&mut report, gain.max);
        Some(report)
    }
}

fn put(slot: Option<Slot>, report: &mut [u8], value: impl FnOnce(Slot) -> i64) {
    if let Some(slot) = slot {
        slot.put(report, value(slot));
    }
}
