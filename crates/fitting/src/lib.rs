//! Samples in, field out: fits of oriented point clouds ([`points`]), of triangle meshes ([`mesh`]) and of voxel
//! grids ([`volume`]); and any field written back into a box of another ([`field`]).
//!
//! A fit takes plain slices and gives a [`bspline::HierarchicalSpline`] with a [`FitReport`]: residuals of every
//! leaf, why it was not split, and what was repaired in the input. The caller holds a [`Control`]: progress out,
//! cancel in, a ceiling on memory.

mod budget;
mod components;
mod error;
pub mod field;
mod leaf_index;
mod level;
mod lines;
pub mod mesh;
pub mod orient;
pub mod phantoms;
pub mod points;
pub mod prefilter;
mod report;
pub mod volume;

pub use budget::{Cancel, Control, Progress};
pub use components::{UnsupportedComponent, unsupported_components};
pub use error::FitError;
pub use leaf_index::LeafIndex;
pub use level::SolverOutcome;
pub use report::{FitReport, Leaf, SignReport, StopReason};
