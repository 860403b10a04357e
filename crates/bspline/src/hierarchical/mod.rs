//! Dyadic levels of uniform cubic B-splines whose active functions are chosen one by one.

mod brick;
mod lattice;
mod spline;

pub use brick::{BRICK, BRICK_LEN, BrickKey, Corrections, HALO, HALO_LEN};
pub use lattice::Lattice;
pub use spline::HierarchicalSpline;
