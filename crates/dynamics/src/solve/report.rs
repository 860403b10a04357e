//! What a solve may do, by which method it does it, and what it says of it.

use super::band_cholesky::NotPositive;
use super::pcg::PcgReport;
use super::v_cycle::VCycleOptions;
use crate::sparse::{MaskedWay, NotDefinite};
use serde::{Deserialize, Serialize};

/// Limits of a solve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SolverOptions {
    /// Most iterations of conjugate gradients.
    pub iterations: usize,
    /// Residual, relative to the impulse, that ends them earlier. `None`: what the precision can reach where a solve is
    /// exact but for rounding, [`ITERATED`] where it is iterated.
    pub tolerance: Option<f64>,
    /// Free coefficients up to which the matrix is factorized; four times as many on lattices with as many samples, whose
    /// band is a quarter as wide.
    pub direct_limit: usize,
    /// Free coefficients up to which a factor is made beside the steps, a V-cycle solving them until it is done: 5832
    /// take 33 MB in single precision, which is read twice a step.
    pub background_limit: usize,
    /// Iterations with that V-cycle, to a 64th of what others leave, beside which no factor is begun: so few take less time than to
    /// read one.
    pub quick: usize,
    /// Of the V-cycle for more.
    pub v_cycle: VCycleOptions,
    /// How a patch with a mask is solved.
    pub masked: MaskedWay,
}

impl Default for SolverOptions {
    fn default() -> Self {
        Self {
            iterations: 8,
            tolerance: None,
            direct_limit: 1000,
            background_limit: 6000,
            quick: 3,
            v_cycle: VCycleOptions::default(),
            masked: MaskedWay::Best,
        }
    }
}

impl SolverOptions {
    /// The method for so many free coefficients, `square` with as many samples; a V-cycle may give way to a factor that is made
    /// beside the steps.
    pub(crate) fn method(&self, uniform: bool, coefficients: usize, square: bool) -> Method {
        match (uniform, square) {
            (true, _) => Method::FastDiagonalization,
            (_, true) if coefficients <= self.sample_direct_limit() => Method::SampleDirect,
            (_, true) => Method::SampleMultigrid,
            (_, false) if coefficients <= self.direct_limit => Method::Direct,
            (_, false) => Method::VCycle,
        }
    }

    /// Free coefficients up to which the matrix of a lattice with as many samples is factorized.
    pub fn sample_direct_limit(&self) -> usize {
        4 * self.direct_limit
    }
}

/// Residual, relative to the impulse, at which the V-cycle and the multigrid stop by default. The increment is then
/// wrong by about as much, far less than the 0.3 % asked of a step; halving it costs one iteration.
pub const ITERATED: f64 = 1e-3;

/// How a step was solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Method {
    /// Fast diagonalization: constant material.
    FastDiagonalization,
    /// Banded Cholesky factor: few coefficients.
    Direct,
    /// V-cycle on every other knot: many coefficients.
    VCycle,
    /// Banded Cholesky factor on the samples: few, and as many coefficients as samples.
    SampleDirect,
    /// Multigrid on the samples: as many coefficients as samples.
    SampleMultigrid,
    /// Sparse Cholesky factor: a patch with a mask.
    SparseDirect,
    /// Conjugate gradients on the sparse form: a patch with a mask.
    SparseIteration,
}

impl Method {
    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::FastDiagonalization => "fast-diagonalization",
            Self::Direct => "direct",
            Self::VCycle => "v-cycle",
            Self::SampleDirect => "sample-direct",
            Self::SampleMultigrid => "sample-multigrid",
            Self::SparseDirect => "sparse-direct",
            Self::SparseIteration => "sparse-iteration",
        }
    }
}

/// What a solve did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveReport {
    /// The method.
    pub method: Method,
    /// Iterations, residual and curvature.
    pub iteration: PcgReport,
}

impl SolveReport {
    /// Whether what is left of the impulse is at most [`ITERATED`]; increments may be wrong by as much. An iteration that its
    /// cap ended before has not converged: take a shorter step, more iterations, less contrast, or double precision.
    pub fn converged(&self) -> bool {
        self.iteration.residual <= ITERATED && self.iteration.negative_curvature.is_none()
    }

    /// The worst of this solve and a later one.
    pub(crate) fn and(self, later: Self) -> Self {
        let (a, b) = (self.iteration, later.iteration);
        Self {
            method: later.method,
            iteration: PcgReport {
                iterations: a.iterations.max(b.iterations),
                // Not a number is worst of all, and no number is below it.
                residual: if a.residual.is_nan() {
                    a.residual
                } else {
                    b.residual.max(a.residual)
                },
                negative_curvature: a.negative_curvature.or(b.negative_curvature),
            },
        }
    }

    /// Refuses a solve that did not begin.
    pub(crate) fn checked(self) -> Result<Self, SolveError> {
        match self.iteration.negative_curvature {
            Some(curvature) if self.iteration.iterations == 0 || curvature.is_nan() => {
                Err(SolveError::Indefinite { curvature })
            }
            _ => Ok(self),
        }
    }
}

/// Why a matrix cannot be solved.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SolveError {
    /// A solve that met no positive curvature where it began.
    #[error(
        "the curvature along the first direction is {curvature:.3e}; the matrix of the step is not positive definite in \
         this precision, so take less contrast of stiffness and mass, or double precision"
    )]
    Indefinite {
        /// The curvature.
        curvature: f64,
    },
    /// Not positive definite.
    #[error(transparent)]
    NotPositive(#[from] NotPositive),
    /// Not positive definite, of a sparse form.
    #[error(transparent)]
    NotDefinite(#[from] NotDefinite),
}
