//! What is seen: where the eye is, the triangles on the graphics card, and what lies under the mouse.

mod brush;
mod camera;
mod canvas;
mod card;
mod cast;
mod histogram;
mod lights;
mod pick;
mod rays;
mod read;
mod scale_bar;
mod screen;
mod shape;
mod slice;
mod still;
#[cfg(test)]
mod tests;

pub use camera::{Camera, Ray};
pub use canvas::{Canvas, Look, Mode, Paper};
pub use card::Card;
pub use histogram::Histogram;
pub use pick::{leave, pick};
pub use rays::{BUDGET, Solid};
pub use scale_bar::scale_bar;
pub use screen::{SKY, Screen};
pub use shape::{Patch, Shape};
pub use slice::{Slice, sides};
#[cfg(test)]
use still::MESH;
pub use still::{Manner, still};
