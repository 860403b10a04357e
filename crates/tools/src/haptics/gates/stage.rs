//! How far on its way to giving force a device is.

use super::{GateOptions, Trip};

/// How far on its way to giving force a device is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stage {
    /// The user wants no force, or has not said so yet.
    Disarmed,
    /// Armed; the device has still to tell where it is. One that must be led to its stops first is silent until then.
    Homing,
    /// The wished force must be small for some ticks first.
    Waiting {
        /// Ticks for which it was.
        ticks: u32,
    },
    /// The force comes.
    Ramping {
        /// Since when, s.
        time: f64,
    },
    /// It is there.
    Live,
    /// All force is taken away until the user arms again.
    Tripped(Trip),
}

impl Stage {
    /// Whether the user wants force and nothing has taken it away.
    pub fn is_armed(&self) -> bool {
        !matches!(self, Self::Disarmed | Self::Tripped(_))
    }

    /// Whether force may be on the hand, now or a few ticks on.
    pub(super) fn is_past_homing(&self) -> bool {
        matches!(self, Self::Waiting { .. } | Self::Ramping { .. } | Self::Live)
    }

    /// Goes on by a tick; the share of the wished force that comes through, if any does.
    pub(super) fn advance(&mut self, is_small: bool, options: &GateOptions, dt: f64) -> Option<f64> {
        match self {
            Self::Disarmed | Self::Homing | Self::Tripped(_) => None,
            Self::Waiting { ticks } => {
                *ticks = if is_small { *ticks + 1 } else { 0 };
                if *ticks >= options.small_ticks {
                    *self = Self::Ramping { time: 0.0 };
                }
                None
            }
            Self::Ramping { time } => {
                *time += dt;
                let share = *time / options.ramp;
                // Also where the ramp takes no time.
                if share.is_nan() || share >= 1.0 {
                    *self = Self::Live;
                    return Some(1.0);
                }
                Some(share)
            }
            Self::Live => Some(1.0),
        }
    }
}
