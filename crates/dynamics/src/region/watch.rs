//! Adaptive steps of a region, and a look at it that does not wake it.

use bspline::Real;

use super::Region;
use crate::integrators::{AdaptiveOptions, AdaptiveReport};
use crate::patch::{Energy, PatchError};

impl<T: Real> Region<T> {
    /// As [`Region::step`], of at most `dt` seconds, shortened until it keeps to the options; all parts are awake.
    ///
    /// # Errors
    /// [`PatchError`]; the state is then the one before.
    pub fn adaptive_step(
        &mut self,
        dt: f64,
        options: &AdaptiveOptions,
    ) -> Result<Option<AdaptiveReport>, PatchError> {
        if self.asleep {
            return Ok(None);
        }
        // The whole of it: its balance of energy is judged.
        self.drop_part();
        let report = self.patch.adaptive_step(dt, options)?;
        self.rest_if_quiet();
        Ok(Some(report))
    }

    /// Energies of the present state.
    pub fn energy(&mut self) -> Energy {
        self.patch.energy()
    }
}
