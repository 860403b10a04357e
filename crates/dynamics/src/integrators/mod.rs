//! Steps in time, on changes of the coefficients and their velocities: a step reads nothing of the one before but the
//! state, so its length may change from step to step.

mod adaptive;
mod auto;
mod explicit;
mod implicit;

pub use adaptive::{AdaptiveOptions, AdaptiveReport};
pub use auto::Choice;
#[cfg(feature = "study")]
pub(crate) use explicit::largest_frequency;

use bspline::Real;

use crate::patch::{Patch, PatchError};
use crate::solve::SolveReport;

/// How a step is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Integrator {
    /// Implicit Euler in displacements with the damping in the middle [Hua04 eq. 12], first order.
    Paper,
    /// The velocity from the present forces, then the position from the new velocity; only the damping is implicit.
    /// First order, symplectic where nothing damps, stable up to a bound.
    Symplectic,
    /// Velocity Verlet: half a kick by the forces, the drift, half a kick; the damping is that of the mean velocity of
    /// each kick. Second order, symplectic where nothing damps, two solves, stable up to the bound of `Symplectic`.
    Verlet,
    /// Trapezoidal rule to `2 - √2` of the step, then backward differences: second order, L-stable \[Bank85\].
    TrBdf2,
    /// `Verlet` in sub-steps within its bound where these cost less than a step of `TrBdf2`, which is no more accurate;
    /// else `TrBdf2`. See [`Patch::choose`].
    Auto,
}

impl Integrator {
    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Symplectic => "symplectic",
            Self::Verlet => "verlet",
            Self::TrBdf2 => "tr-bdf2",
            Self::Auto => "auto",
        }
    }
}

/// What a step did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepReport {
    /// Length of the step, in seconds.
    pub dt: f64,
    /// The scheme taken; of [`Integrator::Auto`] what it chose.
    pub integrator: Integrator,
    /// Equal parts that the step was made of.
    pub substeps: usize,
    /// The worst of the solves that the step was made of: most iterations, largest residual, any negative curvature; the
    /// method is that of the last.
    pub solve: SolveReport,
    /// Springs whose negative tangent was taken as 0, in the stage that had most.
    pub clamped: usize,
    /// Work of the external forces over the step, from the increments themselves.
    pub work: f64,
    /// Estimate of the step's error in the densities, root mean square; of TR-BDF2 only.
    pub error: Option<f64>,
}

impl<T: Real> Patch<T> {
    /// Moves the patch by `dt` seconds; then rest lengths follow as the [plasticity](crate::springs::Plasticity) says.
    ///
    /// # Errors
    /// [`PatchError::TimeStep`], [`PatchError::Unstable`] of an explicit step beyond its bound, [`PatchError::Solve`],
    /// [`PatchError::Overflow`] if a number of the new state would not be finite. The state is then the one before.
    pub fn step(&mut self, integrator: Integrator, dt: f64) -> Result<StepReport, PatchError> {
        let report = self.try_step(integrator, dt)?;
        self.flow(dt);
        Ok(report)
    }

    /// A step that can be [taken back](Self::take_back): rest lengths do not follow yet.
    fn try_step(&mut self, integrator: Integrator, dt: f64) -> Result<StepReport, PatchError> {
        if !(dt.is_finite() && dt > 0.0) {
            return Err(PatchError::TimeStep { dt });
        }
        self.cache.work.before.copy_from(&self.motion.state);
        self.cache.work.work = 0.0;
        let (integrator, substeps) = match integrator {
            Integrator::Auto => {
                let choice = self.choose(dt)?;
                (choice.integrator, choice.substeps)
            }
            other => (other, 1),
        };
        let moved = match integrator {
            Integrator::Paper => self.paper_step(dt),
            Integrator::Symplectic => self.symplectic_step(dt),
            Integrator::Verlet => self.verlet_steps(dt, substeps),
            Integrator::TrBdf2 | Integrator::Auto => self.tr_bdf2_step(dt),
        };
        if moved.is_err() {
            self.take_back();
        }
        let (solve, clamped, error) = moved?;
        self.keep_if_finite()?;
        Ok(StepReport {
            dt,
            integrator,
            substeps,
            solve,
            clamped,
            work: self.cache.work.work,
            error,
        })
    }

    /// Back to the state before the step.
    fn take_back(&mut self) {
        self.motion.state.copy_from(&self.cache.work.before);
    }
}
