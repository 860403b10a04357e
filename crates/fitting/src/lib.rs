//! Samples in, field out.

mod budget;
pub mod phantoms;
pub mod points;
mod report;

pub use budget::{Cancel, Control, Progress};
pub use report::{FitReport, Leaf, StopReason};

mod error;
pub use error::FitError;
