//! Speed against accuracy: sweeps over the options, and their charts.

mod fit;
mod orient;
mod plot;

pub use fit::{Configuration, Input, Measurement, sweeps};
pub use orient::Oriented;
pub use plot::{Chart, Series};
