//! Samples in, field out.

mod budget;
mod lines;
pub mod phantoms;
pub mod points;
pub mod prefilter;
mod report;
pub mod volume;

pub use budget::{Cancel, Control, Progress};
pub use report::{FitReport, Leaf, StopReason};

mod error;
pub use error::FitError;
