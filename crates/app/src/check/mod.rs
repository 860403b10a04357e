//! Errors of a field measured again from the field and the input alone, by the definitions that the fit goes by.

mod against_mesh;
mod boxes;
mod color;
mod leaves;
mod projection;
mod residual;

pub use against_mesh::{AgainstMesh, against_mesh};
#[cfg(feature = "window")]
pub use boxes::EDGES;
pub use boxes::write_boxes;
pub use color::viridis;
pub use leaves::{LeafAudit, audit_leaves, centers, corners};
pub use residual::{ErrorStatistics, voxel_residuals};
