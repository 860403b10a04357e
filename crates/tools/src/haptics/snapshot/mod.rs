//! What the haptic thread touches: immutable local snapshots of fields.
//!
//! A [`DistanceBrick`] holds the distance to the surface in a box round the tool, whatever the field's own numbers are: a field of a
//! scan, of Boolean operations or of blends is no distance, and a tool of some radius needs one.

mod brick;
mod distances;
mod foot;
mod grid;
mod nearest;
mod spline;
mod surface;
#[cfg(test)]
mod tests;

pub use brick::{BrickOptions, DistanceBrick};
pub use spline::Interpolation;
pub use surface::Surface;
