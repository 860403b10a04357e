//! The increment of one implicit step: `AᵀSA x = Aᵀg` for a matrix `S` on the samples.

mod band_cholesky;
mod dot;
mod fast_diagonalization;
mod galerkin;
mod lanczos;
mod pcg;
mod sample_multigrid;
mod schwarz;
mod step_solver;
mod v_cycle;

pub use band_cholesky::{BandCholesky, NotPositive};
pub use fast_diagonalization::FastDiagonalization;
pub use galerkin::Galerkin;
pub(crate) use dot::dot;
pub(crate) use lanczos::Lanczos;
pub use pcg::{CoefficientSystem, ConjugateGradients, PcgReport, Preconditioner, System, Unpreconditioned};
pub use sample_multigrid::SampleMultigrid;
pub use schwarz::Schwarz;
pub use step_solver::{Method, SolveError, SolveReport, SolverOptions, StepSolver};
pub use v_cycle::{VCycle, VCycleOptions};
