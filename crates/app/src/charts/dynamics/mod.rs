//! Speed against accuracy of a step: the error of its increment, sampling and neighbours, cost by size.

mod control;
mod cost;
mod draw;
mod sampling;
mod step;
mod sweep;

pub use cost::{Cost, cost};
pub use sampling::{Profile, sampling};
pub use sweep::{Extent, sweep};

use dynamics::patch::PatchError;
use dynamics::study::StudyError;
use serde::Serialize;

/// One configuration and what it did.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Line {
    /// Coefficients along an axis, fixed ones included.
    pub coefficients: usize,
    /// Samples along an axis.
    pub samples: usize,
    /// Largest stiffness over smallest.
    pub contrast: f64,
    /// Where the stiffness is painted; whether the rim is fixed.
    pub pattern: String,
    /// Step over the limit of the explicit scheme.
    pub dt_over_limit: f64,
    /// Most iterations that a load took.
    pub iterations: usize,
    /// What the iterations are preconditioned with.
    pub preconditioner: &'static str,
    /// Law of the springs.
    pub law: &'static str,
    /// Scheme of the step.
    pub integrator: &'static str,
    /// Of the coefficients.
    pub precision: &'static str,
    /// `‖A(x - x*)‖/‖Ax*‖`, `x*` from a direct solve in double precision; the worst of three loads.
    pub increment_error: f64,
    /// Processor time of the step, the median of its runs.
    pub step_seconds: f64,
    /// What a user gets without options.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub default: bool,
}

/// Why a chart cannot be drawn.
#[derive(Debug, thiserror::Error)]
pub enum DynamicsError {
    /// A configuration of the study.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// A patch.
    #[error(transparent)]
    Patch(#[from] PatchError),
    /// The user said stop.
    #[error("cancelled")]
    Cancelled,
}

/// What a sweep runs with.
pub struct Run<'a> {
    /// Processor seconds of the process.
    pub clock: fn() -> f64,
    /// Told the share done; says whether to go on.
    pub go_on: &'a mut dyn FnMut(f64) -> bool,
    /// Given every line when it is there.
    pub show: &'a mut dyn FnMut(&Line),
}

/// Median of the processor seconds of `work`, run until it took 20 ms but at least thrice and at most 15 times.
fn median_seconds(clock: fn() -> f64, mut work: impl FnMut()) -> f64 {
    let (mut all, mut sum) = (Vec::new(), 0.0);
    while all.len() < 3 || (sum < 0.02 && all.len() < 15) {
        let start = clock();
        work();
        let seconds = clock() - start;
        all.push(seconds);
        sum += seconds;
    }
    all.sort_by(f64::total_cmp);
    all[all.len() / 2]
}
