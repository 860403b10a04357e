//! Density springs between neighbouring samples.

mod law;
mod neighbours;
mod network;
mod plasticity;
mod stencil;

pub use law::Law;
pub use neighbours::{Direction, Neighbours};
pub(crate) use network::EnergyChange;
pub use network::{Rest, SpringNetwork, SpringReport};
pub use plasticity::Plasticity;
pub use stencil::{SpringWeights, StepMatrix, Weights};
