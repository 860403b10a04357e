//! Volumes in and out.
//!
//! | format | read | not read, and refused by name |
//! | --- | --- | --- |
//! | NIfTI-1, -2 | `.nii`, header and image pairs, both byte orders | colour, complex |
//! | DICOM | series, multi-frame files, see [`DicomOptions`] | colour, video, mosaics |
//! | NRRD | attached or detached, lists of files; raw, gzip, text, hex; RAS, LAS, LPS | bzip2, `block` |
//! | MetaImage | `.mha`, `.mhd`, lists and patterns of files; raw, zlib, text; LPS as ITK has it | other than 3 axes |
//! | TIFF | pages of a file (BigTIFF, ImageJ's form beyond 4 GB), files of a directory in the order of their numbers; plain, deflate, LZW, PackBits | colour, palettes, white as zero, JPEG |
//! | raw | any layout that is stated, [`RawLayout`] | |
//!
//! Of a time series, of echoes and of channels (NIfTI, DICOM, NRRD, MetaImage) [`VolumeOptions::volume`] chooses one.
//! Whole files may be gzipped. Voxels are integers of 8 to 64 bits or floats of 32 and 64, held as `f32`.
//! A length unit is what the file names, else unknown: NRRD and MetaImage rarely name one, TIFF gives lengths only
//! where ImageJ's description has all three and a unit; [`VolumeOptions::spacing_mm`] states what is missing.
//! A header names only data files of its own directory or below it, by a relative name without `..`.
//!
//! [`peek`] tells dimensions, spacing and memory need, [`range`] the densities in one pass that holds a slice,
//! [`read`] gives the voxels; all three of a region and stride if asked. [`save_slices`] writes, slice by slice;
//! [`save_revised`] writes a file again with some voxels changed.

#[cfg(feature = "medical")]
mod detached;
#[cfg(feature = "medical")]
pub(crate) mod dicom;
mod encode;
pub(crate) mod geometry;
#[cfg(feature = "medical")]
pub(crate) mod metaimage;
#[cfg(feature = "medical")]
pub(crate) mod nifti;
#[cfg(feature = "medical")]
pub(crate) mod nrrd;
mod open;
mod options;
mod part;
mod raw;
#[cfg(feature = "medical")]
mod revise;
#[cfg(feature = "medical")]
mod revision;
mod save;
mod several;
mod slices;
mod stream;
pub(crate) mod tiff;
mod volume;
mod voxel;
mod vti;

use std::path::Path;

#[cfg(feature = "medical")]
pub use dicom::parse_dicom;
pub use encode::Grid;
#[cfg(feature = "medical")]
pub use metaimage::parse_metaimage;
#[cfg(feature = "medical")]
pub use nifti::{parse_nifti, write_nifti};
#[cfg(feature = "medical")]
pub use nrrd::parse_nrrd;
pub use options::{DicomOptions, Tilt, Uneven, VolumeOptions};
pub use raw::{RawLayout, parse_raw};
#[cfg(feature = "medical")]
pub use revise::save_revised;
#[cfg(feature = "medical")]
pub use revision::{Change, Revision};
pub use save::{save, save_slices};
pub use tiff::parse_tiff;
pub use volume::{Orientation, ValueRange, Volume, VolumeHeader};
pub use voxel::{StoreAs, VoxelType};

pub use crate::kind::VolumeFormat;
use crate::limits::Budget;
use crate::{FormatError, ReadLimits};
use slices::SliceSource;

/// What reading would give and need.
#[derive(Clone, Debug, PartialEq)]
pub struct Preview {
    /// What the file is.
    pub format: VolumeFormat,
    /// Header of what would be read: the region and stride asked for.
    pub header: VolumeHeader,
    /// Voxels of the whole file.
    pub file_dims: [usize; 3],
    /// Bytes that [`read`] holds at its peak: a ceiling of so many suffices.
    pub read_bytes: u64,
    /// Repairs and doubts so far.
    pub notes: Vec<String>,
}

/// Reads the header alone, so that a caller can weigh what reading and fitting would need.
///
/// # Errors
/// As [`read`], as far as the header tells.
pub fn peek(path: &Path, options: &VolumeOptions) -> Result<Preview, FormatError> {
    let look = || {
        let mut budget = Budget::new(&ReadLimits::default());
        let mut opened = open::open(path, options, &mut budget)?;
        Ok(Preview {
            format: opened.format,
            header: opened.source.header().clone(),
            file_dims: opened.file_dims,
            read_bytes: budget.used().saturating_add(slices::needed_bytes(&opened.source)),
            notes: opened.source.notes(),
        })
    };
    look().map_err(|fault: crate::Fault| fault.at(path))
}

/// Reads a volume, gzipped or not.
///
/// # Errors
/// A [`crate::Fault`] for a header that cannot be used, several volumes and none chosen, types that are not read
/// (RGB, complex), a region outside of the volume, a file cut short, damaged compressed data, more bytes than the limits
/// allow, or no finite voxel.
pub fn read(path: &Path, options: &VolumeOptions, limits: &ReadLimits) -> Result<Volume, FormatError> {
    let read = || {
        let mut budget = Budget::new(limits);
        let mut opened = open::open(path, options, &mut budget)?;
        slices::read(&mut opened.source, &mut budget)
    };
    read().map_err(|fault| fault.at(path))
}

/// Runs through the volume and holds one slice at a time.
///
/// # Errors
/// As [`read`].
pub fn range(path: &Path, options: &VolumeOptions, limits: &ReadLimits) -> Result<ValueRange, FormatError> {
    let range = || {
        let mut budget = Budget::new(limits);
        let mut opened = open::open(path, options, &mut budget)?;
        slices::range(&mut opened.source, &mut budget)
    };
    range().map_err(|fault| fault.at(path))
}
