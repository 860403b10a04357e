//! Volumes in and out: NIfTI.

mod affine;
mod header;
mod read;
mod voxel;
mod write;

use std::path::Path;

use glam::{DAffine3, DVec3};

pub use affine::Orientation;
pub(crate) use affine::is_usable as is_usable_affine;
pub(crate) use header::looks_like_nifti;
pub use read::parse_nifti;
pub use voxel::VoxelType;
pub use write::{StoreAs, save, write_nifti};

use crate::limits::Budget;
use crate::{FormatError, ReadLimits, Unit, input};

/// A scalar volume in world space (RAS).
#[derive(Clone, Debug, PartialEq)]
pub struct Volume {
    /// What the header says.
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
    /// Which of the file's transforms `world_from_voxel` is.
    pub orientation: Orientation,
    /// Type of the voxels in the file.
    pub stored: VoxelType,
    /// Density = slope · stored + intercept; `None` if the file asks for no rescaling.
    pub rescale: Option<[f64; 2]>,
}

impl VolumeHeader {
    /// Distances between neighbouring voxels along the three index axes.
    pub fn spacing(&self) -> DVec3 {
        let m = self.world_from_voxel.matrix3;
        DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length())
    }

    /// Number of voxels.
    pub fn voxel_count(&self) -> usize {
        self.dims.iter().product()
    }

    /// Bytes that [`read`] holds at its peak.
    pub fn read_bytes(&self) -> u64 {
        self.voxel_count() as u64 * 4 + read::BUFFER as u64
    }
}

/// Reads the header alone, so that a caller can weigh what reading and fitting would need.
///
/// # Errors
/// As [`read`], as far as the header tells.
pub fn peek(path: &Path) -> Result<(VolumeHeader, Vec<String>), FormatError> {
    let look = || {
        let mut input = input::open(path)?;
        let parsed = header::read(&mut input.source)?;
        Ok((parsed.header, parsed.notes))
    };
    look().map_err(|fault: crate::Fault| fault.at(path))
}

/// Reads a volume, gzipped or not.
///
/// # Errors
/// A [`crate::Fault`] for a header that is no NIfTI, dimensions or types that cannot be used (time series, RGB,
/// complex), a file cut short, damaged gzip data, more bytes than the limits allow, or no finite voxel.
pub fn read(path: &Path, limits: &ReadLimits) -> Result<Volume, FormatError> {
    let read = || {
        let mut input = input::open(path)?;
        let bound = input.length_bound;
        read::volume(&mut input.source, bound, &mut Budget::new(limits))
    };
    read().map_err(|fault| fault.at(path))
}
