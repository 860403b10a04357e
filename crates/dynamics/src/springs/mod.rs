//! Density springs between neighbouring samples.

mod law;
mod neighbours;
mod stencil;

pub use law::{Law, Rest, SpringNetwork, SpringReport};
pub use neighbours::{Direction, Neighbours};
pub use stencil::{SpringWeights, StepMatrix, Weights};
