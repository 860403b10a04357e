//! Volumes in and out.

mod dicom;
mod detached;
mod encode;
mod geometry;
mod metaimage;
mod nifti;
mod nrrd;
mod open;
mod options;
mod part;
mod raw;
mod save;
mod slices;
mod stream;
mod tiff;
mod voxel;
mod vti;

use std::fmt;
use std::path::Path;

use glam::{DAffine3, DVec3};

pub use dicom::{DicomOptions, Tilt, Uneven, parse_dicom};
pub(crate) use dicom::{holds_dicom, looks_like_dicom};
pub use encode::Grid;
pub(crate) use geometry::is_usable as is_usable_affine;
pub(crate) use metaimage::looks_like_metaimage;
pub use metaimage::parse_metaimage;
pub(crate) use nifti::nifti_format;
pub use nifti::{parse_nifti, write_nifti};
pub(crate) use nrrd::looks_like_nrrd;
pub use nrrd::parse_nrrd;
pub use options::VolumeOptions;
pub use raw::{RawLayout, parse_raw};
pub use save::{save, save_slices};
use slices::SliceSource;
pub use tiff::parse_tiff;
pub(crate) use tiff::{is_stack_folder, looks_like_tiff};
pub use voxel::{StoreAs, VoxelType};

use crate::limits::Budget;
use crate::{FormatError, ReadLimits, Unit};

/// Formats of volumes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VolumeFormat {
    /// One NIfTI file.
    Nifti,
    /// A NIfTI header with its image beside it.
    NiftiPair,
    /// A DICOM series: a directory, one of its files, or one file of several frames.
    Dicom,
    /// NRRD, its voxels in the same file or in others.
    Nrrd,
    /// MetaImage, its voxels in the same file or in others.
    MetaImage,
    /// The pages of a TIFF file.
    Tiff,
    /// The TIFF files of a directory, a slice each.
    TiffFolder,
    /// Voxels without a header, told by [`VolumeOptions::raw`] alone.
    Raw,
}

impl fmt::Display for VolumeFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Nifti => "NIfTI",
            Self::NiftiPair => "NIfTI header and image",
            Self::Dicom => "DICOM",
            Self::Nrrd => "NRRD",
            Self::MetaImage => "MetaImage",
            Self::Tiff => "TIFF stack",
            Self::TiffFolder => "directory of TIFF slices",
            Self::Raw => "raw",
        })
    }
}

/// A scalar volume in world space (RAS).
#[derive(Clone, Debug, PartialEq)]
pub struct Volume {
    /// What the header says of the part that was read.
    pub header: VolumeHeader,
    /// Densities after rescaling, all finite; voxel `(x, y, z)` at `x + nx·(y + ny·z)`: x fastest.
    pub values: Vec<f32>,
    /// Voxels that were NaN or infinite; they hold the smallest finite density (outside of any solid).
    pub replaced_count: usize,
    /// Repairs and doubts, each a sentence with its figures.
    pub notes: Vec<String>,
}

/// The header of a volume: what is known before a voxel is read.
#[derive(Clone, Debug, PartialEq)]
pub struct VolumeHeader {
    /// Voxels along x, y, z; each at least 1.
    pub dims: [usize; 3],
    /// Voxel index (the centre of voxel `(0, 0, 0)` is the origin) to RAS world; invertible.
    pub world_from_voxel: DAffine3,
    /// Unit of world lengths: millimetres if the file names any unit, else unknown.
    pub unit: Unit,
    /// Where `world_from_voxel` is from.
    pub orientation: Orientation,
    /// Type of the voxels in the file.
    pub stored: VoxelType,
    /// Density = slope · stored + intercept; `None` if the file asks for no rescaling, or for another in each slice.
    pub rescale: Option<[f64; 2]>,
}

/// Origin of a volume's transform.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Orientation {
    /// The affine matrix of NIfTI (`sform_code > 0`).
    Sform,
    /// The rotation of NIfTI (`qform_code > 0`).
    Qform,
    /// The directions of the axes, as the file gives them.
    Directions,
    /// Only spacings: axes as stored.
    Spacings,
}

impl VolumeHeader {
    /// Distances between neighbouring voxels along the three index axes.
    pub fn spacing(&self) -> DVec3 {
        let m = self.world_from_voxel.matrix3;
        DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length())
    }

    /// States the unit of the file and converts the map to millimetres.
    ///
    /// # Errors
    /// [`crate::Fault::Value`] if `stated` is [`Unit::Unknown`] or the volume already is in a known unit.
    pub fn to_mm(&mut self, stated: Unit) -> Result<(), crate::Fault> {
        let scale = stated.scale_for("volume", self.unit)?;
        self.world_from_voxel = DAffine3::from_scale(DVec3::splat(scale)) * self.world_from_voxel;
        self.unit = Unit::Millimetre;
        Ok(())
    }

    /// Number of voxels.
    pub fn voxel_count(&self) -> usize {
        self.dims.iter().product()
    }
}

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

/// Densities met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValueRange {
    /// Smallest finite density.
    pub min: f32,
    /// Largest finite density.
    pub max: f32,
    /// Voxels that are NaN or infinite.
    pub replaced_count: usize,
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
/// A [`crate::Fault`] for a header that cannot be used, dimensions or types that are not read (time series, RGB,
/// complex), a region outside of the volume, a file cut short, damaged compressed data, more bytes than the limits
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
