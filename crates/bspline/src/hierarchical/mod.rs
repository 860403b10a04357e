//! Dyadic levels of uniform cubic B-splines whose active functions are chosen one by one.

mod batch;
mod bounds;
mod brick;
mod build;
mod grid;
mod kernel;
mod lattice;
mod prolong;
mod spline;

pub use brick::{BRICK, BRICK_LEN, BrickKey, Corrections, HALO, HALO_LEN};
pub use lattice::Lattice;
pub use prolong::refine_block;
pub use spline::{HierarchicalSpline, LevelCorrections};
