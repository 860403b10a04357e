//! Steps in time, on changes of the coefficients and their velocities: a step reads nothing of the one before but the
//! state, so its length may change from step to step.

mod adaptive;
mod explicit;
mod implicit;

pub(crate) use explicit::largest_frequency;
pub use adaptive::{AdaptiveOptions, AdaptiveReport};

use bspline::Real;

use crate::patch::{Energy, Patch, PatchError};
use crate::solve::SolveReport;

/// How a step is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Integrator {
    /// Implicit Euler in displacements with the damping in the middle [DIS eq. 12], first order.
    Paper,
    /// Implicit in all forces, explicit in none: the velocity first, then the position. First order, symplectic where
    /// nothing damps, stable up to a bound.
    Symplectic,
    /// Trapezoidal rule to `2 - √2` of the step, then backward differences: second order, L-stable [R. E. Bank et
    /// al., *Transient simulation of silicon devices and circuits*, 1985].
    TrBdf2,
}

impl Integrator {
    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Symplectic => "symplectic",
            Self::TrBdf2 => "tr-bdf2",
        }
    }
}

/// What a step did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepReport {
    /// Length of the step, in seconds.
    pub dt: f64,
    /// The last solve of the step.
    pub solve: SolveReport,
    /// Springs whose negative tangent was taken as 0.
    pub clamped: usize,
    /// Energies after the step.
    pub energy: Energy,
    /// Work of the external forces over the step.
    pub work: f64,
    /// Estimate of the step's error in the densities, root mean square; of TR-BDF2 only.
    pub error: Option<f64>,
}

impl<T: Real> Patch<T> {
    /// Moves the patch by `dt` seconds.
    ///
    /// # Errors
    /// [`PatchError::TimeStep`], [`PatchError::Unstable`] of an explicit step beyond its bound, [`PatchError::Solve`].
    /// The state is then the one before.
    pub fn step(&mut self, integrator: Integrator, dt: f64) -> Result<StepReport, PatchError> {
        if !(dt.is_finite() && dt > 0.0) {
            return Err(PatchError::TimeStep { dt });
        }
        self.work.before.clone_from(&self.state);
        let moved = match integrator {
            Integrator::Paper => self.paper_step(dt),
            Integrator::Symplectic => self.symplectic_step(dt),
            Integrator::TrBdf2 => self.tr_bdf2_step(dt),
        };
        if moved.is_err() {
            self.restore();
        }
        let (solve, clamped, error) = moved?;
        let energy = self.energy();
        let before = &self.work.before;
        let path = self.state.d.iter().zip(&before.d).zip(&self.external);
        let work = path.map(|((now, then), f)| (*now - *then).as_f64() * f.as_f64()).sum();
        Ok(StepReport {
            dt,
            solve,
            clamped,
            energy,
            work,
            error,
        })
    }

    /// Back to the state before the step.
    pub(crate) fn restore(&mut self) {
        self.state.clone_from(&self.work.before);
    }
}
