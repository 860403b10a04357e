//! Volumes in, fields out: densities on a regular grid, least squares on few B-splines or exact on one per voxel.
//!
//! The finest level of the field has a knot at every voxel, level 0 one every four voxels (fewer where a small number of
//! coefficients asks for it). Where an axis does not fill the last coarse cell, the field continues the
//! edge value.
//!
//! **Adaptive** ([`VolumeMethod::Adaptive`]): level 0 by exact least squares; of each finer level the functions
//! that would carry the largest energy `c²‖B‖²`; joint least squares over all of them by conjugate gradients, whose
//! operator is applied in one sweep over the finest level without ever storing it; then exchanges of functions.
//! A tolerance adds functions until every leaf of 4³ voxels meets it.
//!
//! **Interpolating** ([`VolumeMethod::Interpolate`]): the recursive prefilter along the three axes.
//!
//! Arrays of this module are x fastest, as volume files are; the field's bricks are z fastest.

mod active;
mod adaptive;
mod again;
mod assemble;
mod axis;
mod banded;
mod detail;
mod domain;
mod fit;
mod gram;
mod interpolate;
mod joint;
mod leaves;
mod measure;
mod noise;
mod otsu;
mod quantile;
mod refinement;
mod residual;
mod rows;
mod select;
mod tolerance;
mod view;
mod voxels;

pub use again::{VolumeErrors, measure_volume};
pub use fit::fit_volume;
pub(crate) use interpolate::interpolate_voxels;
pub use otsu::{otsu_threshold, padding};
pub use view::{VolumeMethod, VolumeOptions, VolumeView};
pub use voxels::{Order, Voxels};
