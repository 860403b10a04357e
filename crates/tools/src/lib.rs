//! What a hand can do to a field: scripted [scenes](scene) of forces, matter and constraints, and [geometric] tools that carve,
//! add and [carry along](warp). A [session] is a row of strokes; each uses one [tool], within [limits]. [haptics] make what is done felt.

pub mod body;
pub mod canvas;
pub mod coefficients;
pub mod curve;
mod face;
pub mod fade;
pub mod force;
mod formula_solid;
pub mod geometric;
pub mod haptics;
pub mod hold;
mod interior;
pub mod knots;
pub mod limits;
pub mod live;
pub mod malleable;
pub mod material;
pub mod mix;
pub mod number;
pub mod others;
pub mod paint;
pub mod place;
mod room;
pub mod scene;
pub mod session;
mod slope;
#[cfg(feature = "study")]
pub mod study;
pub mod surface;
pub mod symmetry;
pub mod tool;
pub mod warp;
