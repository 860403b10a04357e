//! The increment of one implicit step: `AᵀSA x = Aᵀg` for a matrix `S` on the samples.

mod background;
mod band_cholesky;
mod border;
mod chebyshev;
mod dot;
mod fast_diagonalization;
mod galerkin;
mod history;
mod lanczos;
mod mean;
mod orthonormal;
mod painted;
mod pcg;
mod renewal;
mod report;
mod sample_multigrid;
mod schwarz;
mod step_solver;
mod systems;
mod v_cycle;

pub use band_cholesky::{BandCholesky, NotPositive};
pub(crate) use border::{Border, add_spring, spring_value};
pub(crate) use dot::dot;
pub use fast_diagonalization::FastDiagonalization;
pub use galerkin::Galerkin;
pub(crate) use history::SolverHistory;
pub(crate) use lanczos::Lanczos;
pub(crate) use orthonormal::OrthonormalRows;
pub use pcg::{CoefficientSystem, ConjugateGradients, PcgReport, Preconditioner, System, Unpreconditioned};
pub use report::{ITERATED, Method, SolveError, SolveReport, SolverOptions};
pub use sample_multigrid::SampleMultigrid;
pub use schwarz::Schwarz;
pub use step_solver::StepSolver;
pub use v_cycle::{VCycle, VCycleOptions};
