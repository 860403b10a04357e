//! MetaImage: `.mha`, or `.mhd` with its voxels beside it.

mod header;
mod write;

use std::path::Path;

use super::detached;
use super::slices::SliceSource;
use super::volume::Volume;
use crate::limits::Budget;
use crate::{Fault, ReadLimits};

pub(super) use write::write;

/// Whether a content starts like a MetaImage header.
pub(crate) fn looks_like_metaimage(head: &[u8]) -> bool {
    let line = head.split(|b| *b == b'\n').next().unwrap_or_default();
    let mut parts = line.splitn(2, |b| *b == b'=');
    let key = parts.next().unwrap_or_default().trim_ascii();
    let value = parts.next().map(<[u8]>::trim_ascii);
    match key {
        b"ObjectType" => value == Some(b"Image"),
        b"NDims" => value.is_some_and(|v| !v.is_empty() && v.iter().all(u8::is_ascii_digit)),
        _ => false,
    }
}

/// Reads the bytes of a MetaImage file whose voxels follow the header.
///
/// # Errors
/// As [`super::read`], without the path.
pub fn parse_metaimage(bytes: &[u8], limits: &ReadLimits) -> Result<Volume, Fault> {
    detached::parse(bytes, header::read, limits)
}

pub(super) fn open(
    path: &Path,
    volume: Option<usize>,
    budget: &mut Budget,
) -> Result<Box<dyn SliceSource>, Fault> {
    detached::open(path, header::read, volume, budget)
}
