//! Assembled sparse forms: the matrices that the tensor path never forms, as compressed rows in double precision.
//!
//! They serve where a region is no box, whose coefficients are no tensor product, and they are what the tensor path is
//! held against: springs, samples and coefficients are numbered here once more, from the definitions.
//!
//! Products are those of `sprs`, factors those of `nalgebra-sparse`, on unknowns ordered by nested dissection; both work
//! on one thread, in a fixed order and without fused operations. `docs/dynamics.md` says where each way wins.

mod dissection;
mod factor;
mod forms;
mod mask;
mod masked;
mod projected;
mod solver;

pub use dissection::nested_dissection;
pub use factor::{NotDefinite, SparseCholesky};
pub use forms::{Sampling, SparseForms, multiply};
pub(crate) use mask::MaskRecord;
pub use mask::{Mask, MaskError, MaskPart};
pub use masked::OUTSIDE;
pub(crate) use projected::Projected;
pub(crate) use solver::MaskedSolver;
pub use solver::MaskedWay;
