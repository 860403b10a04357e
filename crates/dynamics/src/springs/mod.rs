//! Density springs between neighbouring samples.

mod law;
mod neighbours;
mod plasticity;
mod stencil;

pub(crate) use law::EnergyChange;
pub use law::{Law, Rest, SpringNetwork, SpringReport};
pub use neighbours::{Direction, Neighbours};
pub use plasticity::Plasticity;
pub use stencil::{SpringWeights, StepMatrix, Weights};
