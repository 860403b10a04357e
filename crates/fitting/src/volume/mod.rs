//! Volumes: densities on a regular grid.

mod active;
mod adaptive;
mod axis;
mod banded;
mod detail;
mod domain;
mod gram;
mod joint;
mod refinement;
mod residual;
mod rows;
mod select;

pub use adaptive::experiment;
