//! Slices of densities as the bytes of a file.

use std::fs::File;
use std::io::{self, Write};
use std::path::Path;

use glam::{DAffine3, DVec3};

use super::voxel::{StoreAs, VoxelType};
use crate::{Fault, Unit};

/// Deflate level: densities hardly compress, so the higher ones cost time and save a few percent.
pub(super) const LEVEL: u32 = 3;

/// Grid of a volume that is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Voxels along x, y, z.
    pub dims: [usize; 3],
    /// Voxel index to RAS world.
    pub world_from_voxel: DAffine3,
    /// Unit of world lengths. Files hold millimetres or nothing: other units are scaled.
    pub unit: Unit,
}

impl Grid {
    /// The map in millimetres, or in the unknown unit.
    pub(super) fn map_mm(&self) -> DAffine3 {
        let scale = self.unit.in_mm().unwrap_or(1.0);
        DAffine3 {
            matrix3: self.world_from_voxel.matrix3 * scale,
            translation: self.world_from_voxel.translation * scale,
        }
    }
}

/// Numbers of a header, shortest so that they come back to the bit.
pub(super) fn words(values: impl IntoIterator<Item = f64>, between: &str) -> String {
    let words: Vec<String> = values.into_iter().map(|v| format!("{v:?}")).collect();
    words.join(between)
}

/// Lengths of the axes of a map and their directions, one after the other.
pub(super) fn spacing_and_directions(map: &DAffine3) -> (DVec3, [DVec3; 3]) {
    let m = map.matrix3;
    let axes = [m.x_axis, m.y_axis, m.z_axis];
    let lengths = axes.map(DVec3::length);
    (
        DVec3::from_array(lengths),
        std::array::from_fn(|a| axes[a] / lengths[a]),
    )
}

/// Gives slice `z`, `nx·ny` densities.
pub(super) type NextSlice<'a> = dyn FnMut(usize, &mut [f32]) -> io::Result<()> + 'a;

/// The slices of a volume that is written, and how.
pub(super) struct Slices<'a, 'f> {
    pub grid: &'a Grid,
    pub store: StoreAs,
    pub next: &'a mut NextSlice<'f>,
    /// Directory for files that are thrown away.
    pub scratch: &'a Path,
}

impl Slices<'_, '_> {
    /// Type of the voxels where the format has no rescaling.
    pub fn unscaled(grid: &Grid, store: StoreAs) -> Result<VoxelType, Fault> {
        if let Some(n) = grid.dims.iter().find(|n| **n == 0) {
            return Err(Fault::Output {
                what: "a dimension",
                value: n.to_string(),
                remedy: "each is at least 1",
            });
        }
        match store {
            StoreAs::Float32 => Ok(VoxelType::F32),
            StoreAs::Integer {
                voxel,
                slope,
                intercept,
            } if slope == 1.0 && intercept == 0.0 && !matches!(voxel, VoxelType::F32 | VoxelType::F64) => {
                Ok(voxel)
            }
            StoreAs::Integer {
                voxel,
                slope,
                intercept,
            } => Err(Fault::Output {
                what: "a rescaling",
                value: format!("slope {slope}, intercept {intercept} to {voxel}"),
                remedy: "this format has none: give an integer type, slope 1 and intercept 0, or write NIfTI",
            }),
        }
    }

    /// Writes all voxels, little endian.
    pub fn write_to(&mut self, out: &mut (impl Write + ?Sized)) -> io::Result<()> {
        let [nx, ny, nz] = self.grid.dims;
        let mut slice = vec![0f32; nx * ny];
        let mut bytes = Vec::with_capacity(1 << 17);
        for z in 0..nz {
            (self.next)(z, &mut slice)?;
            for part in slice.chunks(1 << 14) {
                bytes.clear();
                encode(part, self.store, &mut bytes);
                out.write_all(&bytes)?;
            }
        }
        Ok(())
    }

    /// A nameless file beside the output; it goes when it is closed.
    pub fn scratch_file(&self) -> io::Result<File> {
        tempfile::tempfile_in(self.scratch).or_else(|_| tempfile::tempfile())
    }
}

fn encode(values: &[f32], store: StoreAs, bytes: &mut Vec<u8>) {
    let (voxel, slope, intercept) = match store {
        StoreAs::Float32 => {
            bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
            return;
        }
        StoreAs::Integer {
            voxel,
            slope,
            intercept,
        } => (voxel, slope, intercept),
    };
    // What a header in single precision holds, so that reading inverts it.
    let (s, i) = (f64::from(slope as f32), f64::from(intercept as f32));
    let steps = values.iter().map(|v| ((f64::from(*v) - i) / s).round());
    macro_rules! put {
        ($t:ty) => {
            bytes.extend(steps.flat_map(|v| (v as $t).to_le_bytes()))
        };
    }
    match voxel {
        VoxelType::U8 => put!(u8),
        VoxelType::I8 => put!(i8),
        VoxelType::U16 => put!(u16),
        VoxelType::I16 => put!(i16),
        VoxelType::U32 => put!(u32),
        VoxelType::I32 => put!(i32),
        VoxelType::U64 => put!(u64),
        VoxelType::I64 => put!(i64),
        VoxelType::F32 | VoxelType::F64 => unreachable!("refused with the header"),
    }
}
