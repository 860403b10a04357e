//! The increment of one implicit step: `AᵀSA x = Aᵀg` for a matrix `S` on the samples.

mod background;
pub(crate) mod band_cholesky;
mod border;
mod chebyshev;
mod dot;
mod estimates;
pub(crate) mod fast_diagonalization;
pub(crate) mod galerkin;
mod history;
mod impulse;
mod lanczos;
mod mean;
mod orthonormal;
mod painted;
pub(crate) mod pcg;
mod renewal;
mod report;
mod sample_multigrid;
mod schwarz;
pub(crate) mod step_solver;
mod systems;
pub(crate) mod v_cycle;

pub(crate) use band_cholesky::BandCholesky;
pub use band_cholesky::NotPositive;
pub(crate) use border::{Border, add_spring, spring_value};
pub(crate) use dot::dot;
pub(crate) use galerkin::Galerkin;
pub(crate) use history::SolverHistory;
pub(crate) use lanczos::Lanczos;
pub(crate) use orthonormal::OrthonormalRows;
pub use pcg::PcgReport;
pub(crate) use pcg::{ConjugateGradients, Preconditioner, System};
pub use report::{ITERATED, Method, SolveError, SolveReport, SolverOptions};
pub(crate) use step_solver::StepSolver;
pub(crate) use v_cycle::VCycle;
pub use v_cycle::VCycleOptions;
