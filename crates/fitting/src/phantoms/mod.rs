//! Test objects of known shape, seeded: the truth that fits are held against.

mod cloud;
mod head;
mod random;
mod solid;

pub use cloud::{CloudOptions, SampledCloud, sample_cloud};
pub use head::head;
pub use random::SplitMix64;
pub use solid::{COARSE_CELL, Solid};
