//! A volume in memory, and what its header says.

use glam::{DAffine3, DVec3};

use super::voxel::VoxelType;
use crate::Unit;

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
