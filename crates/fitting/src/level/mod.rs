//! One level of a fit, whatever asks for it: where its functions lie, the normal equations without a matrix, their
//! preconditioners, and the conjugate gradients that solve them.
//!
//! The levels of clouds and meshes lie on grids of `2^depth` cells along the box: full ones
//! ([`full_operator`], preconditioned by a [`v_cycle`]) where the sign far from the data is decided, and [`band`]s of
//! bricks near the surface ([`band_problem`], by its diagonal) below. Volumes bring a system of their own, over all
//! levels at once. All go through [`cg`], which tells how each ended.

pub(crate) mod assemble;
pub(crate) mod band;
pub(crate) mod band_problem;
mod brick;
pub(crate) mod cg;
pub(crate) mod full_grid;
pub(crate) mod full_operator;
mod laplacian;
pub(crate) mod outcome;
#[cfg(target_arch = "x86_64")]
mod pair;
mod prolong;
pub(crate) mod stencil;
pub(crate) mod v_cycle;

pub use outcome::SolverOutcome;

/// Depth of the coarsest grid that is stored in the field of a cloud or a mesh: 32 cells along the box.
pub(crate) const BASE_DEPTH: usize = 5;
/// Deepest level a Morton key can tell apart.
pub(crate) const MAX_DEPTH: usize = 16;
