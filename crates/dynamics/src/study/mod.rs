//! Painted materials and loads on which the solvers are judged, the judgement, which is the error of the increment, and
//! the solvers themselves. Only with the feature `study`: for charts and tests, without a promise of stability.

mod increment;
mod patterns;

pub use crate::solve::band_cholesky::BandCholesky;
pub use crate::solve::fast_diagonalization::FastDiagonalization;
pub use crate::solve::galerkin::Galerkin;
pub use crate::solve::pcg::{
    CoefficientSystem, ConjugateGradients, Preconditioner, System, Unpreconditioned,
};
pub use crate::solve::step_solver::StepSolver;
pub use crate::solve::v_cycle::VCycle;
pub use increment::{Configuration, Outcome, Reference, Solver, StudyError};
pub use patterns::{Pattern, loads, random_masses, spring_weights};
