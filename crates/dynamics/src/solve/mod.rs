//! The increment of one implicit step: `AᵀSA x = Aᵀg` for a matrix `S` on the samples.

mod band_cholesky;
mod dot;
mod fast_diagonalization;
mod galerkin;
mod pcg;
mod v_cycle;

pub use band_cholesky::{BandCholesky, NotPositive};
pub use fast_diagonalization::FastDiagonalization;
pub use galerkin::Galerkin;
pub use pcg::{ConjugateGradients, PcgReport, Preconditioner, Unpreconditioned};
pub use v_cycle::{VCycle, VCycleOptions};
