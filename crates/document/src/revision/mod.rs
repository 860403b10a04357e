//! What the edits of an object mean for the scan that it was fitted to.

mod cloud;
mod journey;
mod volume;
mod write_back;

pub use cloud::{CloudError, revise_cloud};
pub use journey::Journey;
pub use volume::{VolumeRevision, revise_volume};
pub use write_back::{Course, WriteBackError};
