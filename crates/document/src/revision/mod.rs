//! What the edits of an object mean for the scan that it was fitted to.

mod cloud;
mod journey;
mod volume;

pub use cloud::{CloudError, revise_cloud};
pub use journey::Journey;
pub use volume::{VolumeRevision, revise_volume};
