//! Density dynamics of implicit solids.

pub mod integrators;
pub mod lattice;
pub mod matter;
pub mod patch;
pub mod solve;
pub mod springs;
pub mod study;
