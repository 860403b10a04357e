//! Scripted scenes: a region of a field, its matter, forces over time and constraints, moved without a window.

mod error;
mod formula;
mod holds;
mod load;
mod matter;
mod motion;
mod number;
mod place;
mod scene;
mod when;

pub use error::SimulateError;
pub use motion::{Simulation, StepLine};
pub use scene::Scene;
