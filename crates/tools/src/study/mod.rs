//! Whole loops of strokes (force, step, difference, local mesh), for charts and benches that time them. Opened by the feature
//! `study`.

mod looped;
mod patch_pull;
mod place;
mod stroke_kind;

pub use looped::{Looped, half_painted, mesh_about};
pub use patch_pull::{PatchPull, TABLE_2};
pub use place::{Sculpture, Sizes, walk};
pub use stroke_kind::StrokeKind;

use bspline::hierarchical::{DiffError, EditError};
use bspline::polygonize::PolygonizeError;
use dynamics::lattice::LatticeError;
use dynamics::patch::PatchError;
use dynamics::region::RegionError;

use crate::force::ForceError;
use crate::paint::PaintError;

/// Why a loop cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// A force tool.
    #[error(transparent)]
    Force(#[from] ForceError),
    /// A region.
    #[error(transparent)]
    Region(#[from] RegionError),
    /// A step.
    #[error(transparent)]
    Step(#[from] PatchError),
    /// Samples of a patch.
    #[error(transparent)]
    Lattice(#[from] LatticeError),
    /// A mesh.
    #[error(transparent)]
    Mesh(#[from] PolygonizeError),
    /// Paint.
    #[error(transparent)]
    Paint(#[from] PaintError),
    /// A field.
    #[error(transparent)]
    Field(#[from] EditError),
    /// A difference of two fields.
    #[error(transparent)]
    Difference(#[from] DiffError),
    /// Nothing to take hold of.
    #[error("{0}: no surface about the middle of its box; name another field")]
    NoSurface(String),
}
