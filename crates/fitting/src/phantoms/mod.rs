//! Test objects of known shape, seeded: the truth that fits are held against.

mod cloud;
mod random;
mod solid;

pub use cloud::{CloudOptions, SampledCloud, sample_cloud};
pub use random::SplitMix64;
pub use solid::{COARSE_CELL, Solid};
