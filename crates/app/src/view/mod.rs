//! What is seen: where the eye is, the triangles on the graphics card, and what lies under the mouse.

mod camera;
mod canvas;
mod histogram;
mod pick;
mod shape;
mod slice;

pub use camera::{Camera, Ray};
pub use canvas::{Canvas, Look};
pub use histogram::Histogram;
pub use pick::pick;
pub use shape::{Patch, Shape};
pub use slice::{Slice, sides};
