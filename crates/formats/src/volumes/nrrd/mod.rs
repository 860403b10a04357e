//! NRRD: one file, or a header with its voxels beside it.

mod geometry;
mod header;
mod write;

use std::path::Path;

use super::Volume;
use super::detached::{Content, attached, in_files};
use super::slices::{self, SliceSource};
use crate::limits::Budget;
use crate::{Fault, ReadLimits, input};

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
    let mut budget = Budget::new(limits);
    let mut source = slices(Content::of_bytes(bytes), None, &mut budget)?;
    slices::read(&mut *source, &mut budget)
}

pub(super) fn open(path: &Path, budget: &mut Budget) -> Result<Box<dyn SliceSource>, Fault> {
    slices(input::open(path)?.into(), Some(path), budget)
}

fn slices<'a>(
    mut content: Content<'a>,
    path: Option<&Path>,
    budget: &mut Budget,
) -> Result<Box<dyn SliceSource + 'a>, Fault> {
    let parsed = header::read(&mut content, path, budget)?;
    match parsed.files {
        None => attached(parsed.header, parsed.notes, parsed.layout, content),
        Some(paths) => in_files(parsed.header, parsed.notes, parsed.layout, paths),
    }
}
