//! Scripted scenes: a region of a field, its matter, forces over time and constraints, moved without a window.
//!
//! A [`Scene`] is read by any `serde` format whose tables look like those of the guide; a [`Simulation`] moves it on its field.
//! Nothing here reads a file, a clock or prints.

mod amount;
mod error;
pub(crate) mod formula;
mod holds;
mod load;
mod mask;
mod matter;
mod motion;
pub(crate) mod operations;
mod place;
mod script;
mod when;

pub use error::SimulateError;
pub use formula::Formula;
pub use motion::{Simulation, StepLine};
pub use script::Scene;
