//! Samples in, field out.

pub mod budget;
mod lines;
pub mod prefilter;
pub mod report;
pub mod volume;

pub use budget::{Cancel, Control, Progress};
pub use report::{FitReport, Leaf, StopReason};

mod error;
pub use error::FitError;
