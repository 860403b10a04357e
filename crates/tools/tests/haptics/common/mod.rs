//! Obstacles whose distances are exact, and what scenes share.

mod obstacles;
mod projection;
mod scene;

pub use obstacles::{Ball, Bumps, Channel, Edge, Groove, HalfSpace, Rod, Sheet};
pub use projection::Projection;
pub use scene::{Check, Loop, omni};
