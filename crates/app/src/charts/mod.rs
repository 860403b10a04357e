//! Speed against accuracy: sweeps over the options, and their charts.

mod fit;
mod plot;

pub use fit::{Configuration, Input, Measurement, sweeps};
pub use plot::{Chart, Series};
