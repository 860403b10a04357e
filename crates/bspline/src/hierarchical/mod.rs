//! Dyadic levels of uniform cubic B-splines whose active functions are chosen one by one.

mod batch;
mod bounds;
mod brick;
mod build;
mod edit;
mod evaluate;
mod grid;
mod kernel;
mod lattice;
mod prolong;
mod spline;
mod versions;

pub use brick::{BRICK, BRICK_LEN, BrickKey, Corrections, HALO, HALO_LEN, LevelCorrections};
pub use edit::{EditError, LevelEdit, MAX_LEVELS};
pub use lattice::Lattice;
pub use prolong::refine_block;
pub use spline::HierarchicalSpline;
