//! Obstacles whose distances are exact, and what scenes share.

mod fields;
mod projection;
mod renderers;
mod scene;
mod scripted;

pub use fields::{spline, surface_between};
pub use projection::Projection;
pub use renderers::{penalty, plane, proxy, vcp};
pub use scene::{Check, Loop, omni};
pub use scripted::scripted;
pub use tools::haptics::simulated::{
    Ball, Bumps, Channel, Edge, Groove, HalfSpace, Passage, Rod, Rubbing, Sheet,
};
