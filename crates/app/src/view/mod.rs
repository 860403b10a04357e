//! What is seen: where the eye is, the triangles on the graphics card, and what lies under the mouse.

mod beside;
mod brush;
mod camera;
mod canvas;
mod card;
mod cast;
mod held;
mod histogram;
mod laid;
mod light_pass;
mod lights;
mod look;
mod overlay;
mod pick;
mod rays;
mod read;
mod scale_bar;
mod screen;
mod shape;
mod show;
mod slice;
mod stereo;
mod still;
mod target;
#[cfg(test)]
mod tests;

pub use beside::Tinted;
pub use camera::{Camera, Ray};
pub use canvas::Canvas;
pub use card::{Card, DRIVERS};
pub use histogram::Histogram;
pub use look::{LINE, Look, Mode, Paper};
pub use overlay::legend::Legend;
pub use overlay::{Ink, Stretch, cells, floor};
pub use pick::{leave, pick};
pub use rays::{BUDGET, Solid};
pub use scale_bar::{WIDE as SCALE_BAR, scale_bar};
pub use screen::{SKY, Screen};
pub use shape::{Budget, Patch, Shape, is_heavy, second};
pub use show::{Cells, Show, Tint};
pub use slice::{Slice, sides};
pub use stereo::{Pair, Stereo};
#[cfg(test)]
use still::MESH;
pub use still::{Manner, still};
