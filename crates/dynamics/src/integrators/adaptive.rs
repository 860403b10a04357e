use bspline::Real;

use super::{Integrator, StepReport};
use crate::patch::{Patch, PatchError};

/// Bounds of an adaptive step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptiveOptions {
    /// Error of the densities that one step may make, root mean square.
    pub tolerance: f64,
    /// Shortest step, in seconds; taken whatever its error.
    pub shortest: f64,
    /// Longest step, in seconds.
    pub longest: f64,
    /// Share of the energy that a step may create: what it holds more than before, less the work, with at least what its
    /// damping took (`ΔdᵀDΔd/Δt`, which no path of the same ends goes below).
    pub energy_gain: f64,
    /// Acceleration of a density beyond which the next step is half as long as this one [DIS §7]; `None` leaves it to the
    /// error.
    pub acceleration: Option<f64>,
}

/// What an adaptive step did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptiveReport {
    /// The step that was kept.
    pub step: StepReport,
    /// Steps that were tried and taken back.
    pub rejected: usize,
    /// What to try next, in seconds.
    pub next_dt: f64,
    /// Energy that the step created, relative to the largest of the energies before and after and the work; below 0 where
    /// the scheme damps. More than asked for only of a step that could not be shorter.
    pub gained: f64,
}

impl<T: Real> Patch<T> {
    /// One step of TR-BDF2 of at most `dt`, shortened until its estimated error and its balance of energy keep to the
    /// options.
    ///
    /// # Errors
    /// As [`step`](Patch::step).
    pub fn adaptive_step(
        &mut self,
        dt: f64,
        options: &AdaptiveOptions,
    ) -> Result<AdaptiveReport, PatchError> {
        let before = self.energy().total();
        let mut dt = dt.clamp(options.shortest, options.longest);
        let mut rejected = 0;
        loop {
            let step = self.try_step(Integrator::TrBdf2, dt)?;
            let error = step.error.unwrap_or(0.0);
            let after = self.energy().total();
            let scale = before.max(after).max(step.work.abs()).max(f64::MIN_POSITIVE);
            let gained = (after - before - step.work + self.least_dissipation(dt)) / scale;
            // NaN is not balanced.
            let balanced = gained <= options.energy_gain;
            let fast = options.acceleration.is_some_and(|a| self.acceleration(dt) > a);
            // Of a method of second order the error of a step falls with its cube.
            let factor = 0.9 * (options.tolerance / error.max(1e-30)).cbrt();
            let accepted = error <= options.tolerance && balanced && error.is_finite();
            if accepted || dt <= options.shortest {
                self.flow(dt);
                let next = dt * if fast { 0.5 } else { factor.clamp(0.2, 2.0) };
                return Ok(AdaptiveReport {
                    step,
                    rejected,
                    gained,
                    next_dt: next.clamp(options.shortest, options.longest),
                });
            }
            self.restore();
            rejected += 1;
            let factor = if !balanced || !error.is_finite() {
                0.5
            } else {
                factor.clamp(0.1, 0.9)
            };
            dt = (dt * factor).max(options.shortest);
        }
    }

    /// `ΔdᵀDΔd/Δt`, what damping takes at least from the last step to here.
    fn least_dissipation(&self, dt: f64) -> f64 {
        let moved = self.state.d.iter().zip(&self.work.before.d).enumerate();
        let terms = moved.map(|(i, (now, then))| {
            let change = (*now - *then).as_f64();
            self.lumped.damping.at(i).as_f64() * change * change
        });
        terms.sum::<f64>() / dt
    }

    /// Largest mean acceleration of a density over the last step.
    fn acceleration(&self, dt: f64) -> f64 {
        let rates = self.state.w.iter().zip(&self.work.before.w);
        rates
            .map(|(now, then)| (*now - *then).as_f64().abs() / dt)
            .fold(0.0, f64::max)
    }
}
