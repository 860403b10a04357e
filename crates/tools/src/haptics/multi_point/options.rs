//! What a tool of many points is told.

use super::super::Coupling;

/// What a tool of many points is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MultiPointOptions {
    /// Spring and damper along the way from hand to proxy.
    pub coupling: Coupling,
    /// Stiffness of the turn from hand to proxy, N mm/rad.
    pub angular_stiffness: f64,
    /// Damping of that turn, N mm s/rad.
    pub angular_damping: f64,
    /// Way that a point near the surface goes between two looks at the solid, mm, at most. Within a tick it is halved where a step fails, doubled where
    /// one is taken, and never above half of [`finest`](super::super::Obstacle::finest).
    pub step: f64,
    /// Steps in a tick at most; there are fewer when the proxy has arrived.
    pub iterations: usize,
    /// Finer points that a tick looks at, at most. Where they do not suffice for a step, the rest have their turn in the next tick, and the
    /// proxy goes on in small steps in this one.
    pub fine_checks: usize,
    /// Depth that makes no difference, mm.
    pub tolerance: f64,
    /// Speed at which solid that has grown over a point pushes it out, mm/s.
    pub push_out: f64,
    /// Largest change of the force from tick to tick, N.
    pub slew: f64,
    /// Largest change of the torque from tick to tick, N mm.
    pub torque_slew: f64,
    /// Seed of random extraction.
    pub seed: u64,
    /// Looks at that many points alone after the first look of a tick, the deepest \[Sensable99\]. A point that was not among them can go
    /// through; nothing looks at all points in every step, so it is off.
    pub deepest: Option<usize>,
    /// Turns the points to the hand's turn every so many ticks and leaves them turned so between \[Sensable99\]. The solid then has no hold on
    /// the turn and there is no torque; 0, off, solves for the turn.
    pub turn_every: u32,
}

impl Default for MultiPointOptions {
    /// 500 N/m and 2 N m/rad.
    fn default() -> Self {
        Self {
            coupling: Coupling::spring(500.0),
            angular_stiffness: 2000.0,
            angular_damping: 0.0,
            step: 0.5,
            iterations: 2,
            fine_checks: 400,
            tolerance: 1e-3,
            push_out: 100.0,
            slew: 0.25,
            torque_slew: 25.0,
            seed: 1,
            deepest: None,
            turn_every: 0,
        }
    }
}

/// Why options are refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MultiPointError {
    /// A number that must be above 0, or at least 0.
    #[error("{what} is {value}; it must be a finite number {}", if *.may_be_zero { "of 0 or above" } else { "above 0" })]
    Number {
        /// Which.
        what: &'static str,
        /// How much.
        value: f64,
        /// Whether 0 is allowed.
        may_be_zero: bool,
    },
    /// No steps, or no points to look at.
    #[error("{what} is 0; a tick needs at least 1")]
    Nothing {
        /// Which.
        what: &'static str,
    },
}

impl MultiPointOptions {
    /// # Errors
    /// [`MultiPointError`] of the first number that makes no sense.
    pub(super) fn check(&self) -> Result<(), MultiPointError> {
        let numbers = [
            ("the stiffness", self.coupling.stiffness, false),
            ("the damping", self.coupling.damping, true),
            ("the angular stiffness", self.angular_stiffness, false),
            ("the angular damping", self.angular_damping, true),
            ("the step", self.step, false),
            ("the tolerance", self.tolerance, false),
            ("the speed of pushing out", self.push_out, false),
            ("the slew limit", self.slew, false),
            ("the slew limit of the torque", self.torque_slew, false),
        ];
        for (what, value, may_be_zero) in numbers {
            if !(value.is_finite() && (value > 0.0 || may_be_zero && value == 0.0)) {
                return Err(MultiPointError::Number {
                    what,
                    value,
                    may_be_zero,
                });
            }
        }
        for (what, count) in [
            ("the number of steps", self.iterations),
            ("the number of deepest points", self.deepest.unwrap_or(1)),
        ] {
            if count == 0 {
                return Err(MultiPointError::Nothing { what });
            }
        }
        Ok(())
    }
}
