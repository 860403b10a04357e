//! What the haptic thread touches: immutable local snapshots of fields.
//!
//! A [`DistanceBrick`] holds the distance to the surface in a box round the tool, whatever the field's own numbers are: a field of a
//! scan, of Boolean operations or of blends is no distance, and a tool of some radius needs one.

mod beside;
mod brick;
mod changes;
mod crossing;
mod distances;
mod far;
mod field_obstacle;
mod foot;
mod grid;
mod hull;
mod maker;
mod nearest;
mod region;
mod samples;
mod seek;
mod spline;
mod state;
mod surface;
#[cfg(test)]
mod tests;
mod thin;
mod touch_map;
mod walk;

pub use brick::{BrickOptions, DistanceBrick};
pub use field_obstacle::FieldObstacle;
pub use maker::{Demand, SnapshotMaker, TouchedObject};
pub use spline::Interpolation;
pub use state::{Moving, Part, Snapshot};
pub use surface::Surface;
pub use thin::Unresolved;
pub use touch_map::TouchMap;
