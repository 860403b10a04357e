//! What is seen: where the eye is, the triangles on the graphics card, and what lies under the mouse.

mod camera;
mod canvas;
mod pick;
mod shape;

pub use camera::{Camera, Ray};
pub use canvas::{Canvas, Look};
pub use pick::pick;
pub use shape::{Patch, Shape};
