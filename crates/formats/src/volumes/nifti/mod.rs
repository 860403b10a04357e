//! NIfTI-1 and NIfTI-2, single files and header/image pairs.

mod affine;
mod header;
mod write;

use std::ops::Range;
use std::path::{Path, PathBuf};

pub(crate) use header::nifti_format;
pub(super) use write::write;
pub use write::write_nifti;

use super::several::OneOf;
use super::slices;
use super::slices::SliceSource;
use super::stream::{StreamSlices, check_length, skip};
use super::volume::Volume;
use super::voxel::VoxelType;
use crate::input::{self, SkipRead};
use crate::limits::Budget;
use crate::{Fault, ReadLimits};

/// Reads the (inflated) bytes of a NIfTI file.
///
/// # Errors
/// As [`super::read`], without the path.
pub fn parse_nifti(bytes: &[u8], limits: &ReadLimits) -> Result<Volume, Fault> {
    let mut source = single(Box::new(bytes), Some(bytes.len() as u64))?;
    slices::read(&mut *source, &mut Budget::new(limits))
}

/// Opens `.nii`, or `.hdr` with its `.img`; of several volumes number `volume`.
pub(super) fn open(path: &Path, volume: Option<usize>) -> Result<Box<dyn SliceSource>, Fault> {
    let input = input::open(&header_of(path))?;
    let (mut source, bound) = (input.source, input.length_bound);
    let parsed = header::read(&mut source, volume)?;
    if parsed.is_pair {
        let image = input::open_by_name(&image_of(path)?)?;
        return voxels(parsed, 0, Box::new(image.source), image.length_bound);
    }
    let consumed = parsed.consumed;
    voxels(parsed, consumed, Box::new(source), bound)
}

/// Where the voxels of a volume lie in the bytes of a file, and what they are.
pub(super) struct Places {
    /// All voxels of the volume, x fastest.
    pub bytes: Range<usize>,
    pub stored: VoxelType,
    pub big_endian: bool,
    pub rescale: Option<[f64; 2]>,
}

/// Finds the voxels in the (inflated) bytes of a single file; of several volumes those of number `volume`.
pub(super) fn places(bytes: &[u8], volume: Option<usize>) -> Result<Places, Fault> {
    let parsed = header::read(&mut &bytes[..], volume)?;
    let header = parsed.header;
    let length = header.voxel_count() * header.stored.size();
    let number = parsed.several.map_or(0, |several| several.number);
    let start = (parsed.voxels_at as usize).saturating_add(number.saturating_mul(length));
    let end = start.saturating_add(length);
    if end > bytes.len() {
        return Err(Fault::Truncated {
            what: "the voxels".into(),
            needed: end as u64,
            found: bytes.len() as u64,
        });
    }
    Ok(Places {
        bytes: start..end,
        stored: header.stored,
        big_endian: parsed.big_endian,
        rescale: header.rescale,
    })
}

fn single<'a>(
    mut source: Box<dyn SkipRead + 'a>,
    bound: Option<u64>,
) -> Result<Box<dyn SliceSource + 'a>, Fault> {
    let parsed = header::read(&mut source, None)?;
    if parsed.is_pair {
        return Err(Fault::Value {
            what: "the magic",
            value: "that of a header/image pair".into(),
            remedy: "name the .hdr file with its .img beside it",
        });
    }
    let consumed = parsed.consumed;
    voxels(parsed, consumed, source, bound)
}

/// `source`, of at most `bound` bytes, stands at byte `at`.
fn voxels<'a>(
    parsed: header::Parsed,
    at: u64,
    mut source: Box<dyn SkipRead + 'a>,
    bound: Option<u64>,
) -> Result<Box<dyn SliceSource + 'a>, Fault> {
    let whole = match &parsed.several {
        Some(several) => several.file_header(&parsed.header)?,
        None => parsed.header.clone(),
    };
    if let Some(bound) = bound {
        check_length(&whole, bound.saturating_sub(parsed.voxels_at))?;
    }
    skip(&mut *source, parsed.voxels_at - at)?;
    let inner = Box::new(StreamSlices::new(whole, parsed.notes, parsed.big_endian, source));
    Ok(match parsed.several {
        Some(several) => Box::new(OneOf::new(inner, parsed.header, several)),
        None => inner,
    })
}

/// The file of a pair that has the header.
fn header_of(path: &Path) -> PathBuf {
    other_of(path, "img", "hdr").unwrap_or_else(|| path.to_path_buf())
}

/// The file of a pair that has the voxels.
fn image_of(path: &Path) -> Result<PathBuf, Fault> {
    if crate::file_name::extension(path) == "img" {
        return Ok(path.to_path_buf());
    }
    other_of(path, "hdr", "img").ok_or_else(|| Fault::Value {
        what: "the image of the header/image pair",
        value: "missing".into(),
        remedy: "the .img or .img.gz file lies beside the .hdr file, under the same name",
    })
}

/// `name.to` or `name.to.gz` beside `name.from` or `name.from.gz`, if there.
fn other_of(path: &Path, from: &str, to: &str) -> Option<PathBuf> {
    if crate::file_name::extension(path) != from {
        return None;
    }
    let plain = if crate::file_name::is_gz_name(path) {
        path.with_extension("")
    } else {
        path.to_path_buf()
    };
    // Capitals come from systems without small ones; a pair is written by one program, in one case.
    let is_capital = plain
        .extension()
        .is_some_and(|e| e.to_string_lossy().starts_with(char::is_uppercase));
    let to = if is_capital {
        to.to_ascii_uppercase()
    } else {
        to.to_owned()
    };
    let gz = if is_capital { "GZ" } else { "gz" };
    [
        plain.with_extension(&to),
        plain.with_extension(format!("{to}.{gz}")),
    ]
    .into_iter()
    .find(|p| p.is_file())
}
