//! Painted materials and loads on which the solvers are judged, and the judgement: the error of the increment.

mod increment;
mod patterns;

pub use increment::{Configuration, Outcome, Reference, Solver, StudyError};
pub use patterns::{Pattern, loads, random_masses, spring_weights};
