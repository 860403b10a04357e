//! What the gates are set to.

/// What the gates are set to. The defaults are those of `docs/haptics.md`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GateOptions {
    /// Largest force that the user wants, N; that of the device counts beside it.
    pub force: f64,
    /// Largest step of the force from tick to tick, N.
    pub slew: f64,
    /// Largest step of the torque from tick to tick, N mm.
    pub torque_slew: f64,
    /// Speed of the hand from which on there is no force, m/s.
    pub speed: f64,
    /// Time in which the force comes after arming, s.
    pub ramp: f64,
    /// Force below which it may begin to come, N, and ticks for which it has to stay there.
    pub small_force: f64,
    /// See `small_force`.
    pub small_ticks: u32,
    /// Age of the simulation's last heartbeat from which on the force fades, s.
    pub snapshot_age: f64,
    /// Time in which it fades, s.
    pub fade: f64,
    /// Largest damping that passivity control adds, N s/m; 0 leaves the observer alone at work.
    pub passive: f64,
}

impl Default for GateOptions {
    fn default() -> Self {
        Self {
            force: f64::INFINITY,
            slew: 0.25,
            torque_slew: 25.0,
            speed: 1.0,
            ramp: 2.0,
            small_force: 0.2,
            small_ticks: 5,
            snapshot_age: 0.5,
            fade: 0.1,
            passive: 5.0,
        }
    }
}

/// A setting that makes no sense.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{what} is {value}; it must be {must}")]
pub struct GateError {
    /// Which.
    pub what: &'static str,
    /// As it was given.
    pub value: f64,
    /// What helps.
    pub must: &'static str,
}

impl GateOptions {
    /// Refuses what makes no sense.
    pub(super) fn check(&self) -> Result<(), GateError> {
        let above = [
            ("the largest force", self.force),
            ("the largest step of the force", self.slew),
            ("the largest step of the torque", self.torque_slew),
            ("the largest speed of the hand", self.speed),
            ("the small force", self.small_force),
            ("the age of a snapshot", self.snapshot_age),
            ("the time of the fade", self.fade),
        ];
        let not_below = [
            ("the time of the ramp", self.ramp),
            ("the damping of passivity control", self.passive),
        ];
        for (what, value) in above {
            if value.is_nan() || value <= 0.0 {
                let must = "above 0";
                return Err(GateError { what, value, must });
            }
        }
        for (what, value) in not_below {
            if !value.is_finite() || value < 0.0 {
                let must = "0 or above";
                return Err(GateError { what, value, must });
            }
        }
        Ok(())
    }
}
