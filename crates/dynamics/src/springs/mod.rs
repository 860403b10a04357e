//! Density springs between neighbouring samples.

mod neighbours;
mod stencil;

pub use neighbours::{Direction, Neighbours};
pub use stencil::{SpringWeights, StepMatrix, Weights};
