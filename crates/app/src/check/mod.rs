//! Errors of a field measured again, without anything the fit knew of itself.

mod against_mesh;
mod boxes;
mod color;
mod leaves;
mod projection;
mod residual;

pub use against_mesh::{AgainstMesh, against_mesh};
pub use boxes::write_boxes;
pub use color::viridis;
pub use leaves::{LeafAudit, LeafIndex, audit_leaves};
pub use projection::project_points;
pub use residual::{ErrorStatistics, voxel_residuals};
