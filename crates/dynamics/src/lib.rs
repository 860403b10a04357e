//! Density dynamics of implicit solids.

pub mod lattice;
pub mod solve;
pub mod springs;
pub mod study;
