//! NRRD: one file, or a header with its voxels beside it.

mod fields;
mod geometry;
mod header;
mod write;

use std::path::Path;

use super::detached;
use super::slices::SliceSource;
use super::volume::Volume;
use crate::limits::Budget;
use crate::{Fault, ReadLimits};

pub(super) use write::write;

/// Whether a content starts like a NRRD header.
pub(crate) fn looks_like_nrrd(head: &[u8]) -> bool {
    head.starts_with(b"NRRD000")
}

/// Reads the bytes of a NRRD file whose voxels follow the header.
///
/// # Errors
/// As [`super::read`], without the path.
pub fn parse_nrrd(bytes: &[u8], limits: &ReadLimits) -> Result<Volume, Fault> {
    detached::parse(bytes, header::read, limits)
}

pub(super) fn open(
    path: &Path,
    volume: Option<usize>,
    budget: &mut Budget,
) -> Result<Box<dyn SliceSource>, Fault> {
    detached::open(path, header::read, volume, budget)
}
