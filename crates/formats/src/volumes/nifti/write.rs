//! Volumes out: NIfTI-1 single files, little endian.

use std::io::Write;
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use glam::DAffine3;

use super::header::SIZE_1;
use crate::volumes::encode::Grid;
use crate::volumes::encode::LEVEL;
use crate::volumes::encode::Slices;
use crate::volumes::voxel::{StoreAs, VoxelType};
use crate::{Fault, FormatError, Unit, atomic};

/// Writes `path`.
pub(in crate::volumes) fn write(path: &Path, mut slices: Slices, gzip: bool) -> Result<(), FormatError> {
    let header = header(slices.grid, slices.store).map_err(|f| f.at(path))?;
    atomic::replace(path, |out| {
        if gzip {
            let mut gz = GzEncoder::new(out, Compression::new(LEVEL));
            gz.write_all(&header)?;
            slices.write_to(&mut gz)?;
            gz.finish().map(drop)
        } else {
            out.write_all(&header)?;
            slices.write_to(out)
        }
    })
}

/// Writes the bytes of a `.nii` file: see [`save`](crate::volumes::save).
///
/// # Errors
/// As [`save`](crate::volumes::save).
///
/// # Panics
/// As [`save`](crate::volumes::save).
pub fn write_nifti(
    out: &mut impl Write,
    dims: [usize; 3],
    values: &[f32],
    world_from_voxel: &DAffine3,
    unit: Unit,
    store: StoreAs,
) -> Result<(), Fault> {
    assert_eq!(
        values.len(),
        dims.iter().product::<usize>(),
        "one value per voxel"
    );
    let grid = Grid {
        dims,
        world_from_voxel: *world_from_voxel,
        unit,
    };
    let header = header(&grid, store)?;
    let slice = dims[0] * dims[1];
    let mut slices = Slices {
        grid: &grid,
        store,
        next: &mut |z, to: &mut [f32]| {
            to.copy_from_slice(&values[z * slice..][..slice]);
            Ok(())
        },
        scratch: Path::new("."),
    };
    let result = out.write_all(&header).and_then(|()| slices.write_to(out));
    result.map_err(|source| Fault::Io {
        doing: "writing",
        source,
    })
}

fn header(grid: &Grid, store: StoreAs) -> Result<[u8; 352], Fault> {
    let dims = grid.dims;
    let (voxel, slope, intercept) = match store {
        StoreAs::Float32 => (VoxelType::F32, 1.0, 0.0),
        StoreAs::Integer {
            voxel,
            slope,
            intercept,
        } => {
            let is_integer = !matches!(voxel, VoxelType::F32 | VoxelType::F64);
            let (s, i) = (slope as f32, intercept as f32);
            if !is_integer || s == 0.0 || !s.is_finite() || !i.is_finite() {
                return Err(Fault::Output {
                    what: "a rescaling",
                    value: format!("slope {slope}, intercept {intercept} to {voxel}"),
                    remedy: "give an integer type, a finite slope other than 0 and a finite intercept",
                });
            }
            (voxel, s, i)
        }
    };
    if let Some(n) = dims.iter().find(|n| !(1..=i16::MAX as usize).contains(*n)) {
        return Err(Fault::Output {
            what: "a NIfTI-1 dimension",
            value: n.to_string(),
            remedy: "each is 1 to 32767; sample a part or more coarsely",
        });
    }
    let mut h = [0; 352];
    let mut put = |at: usize, bytes: &[u8]| h[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &(SIZE_1 as i32).to_le_bytes());
    let [nx, ny, nz] = dims.map(|n| n as i16);
    for (i, n) in [3, nx, ny, nz, 1, 1, 1, 1].into_iter().enumerate() {
        put(40 + 2 * i, &n.to_le_bytes());
    }
    put(70, &voxel.code().to_le_bytes());
    put(72, &(8 * voxel.size() as i16).to_le_bytes());
    let map = grid.map_mm();
    let m = map.matrix3;
    let columns = [m.x_axis, m.y_axis, m.z_axis];
    let offset = map.translation;
    put(76, &1f32.to_le_bytes());
    for (i, c) in columns.iter().enumerate() {
        put(80 + 4 * i, &(c.length() as f32).to_le_bytes());
    }
    put(108, &352f32.to_le_bytes());
    put(112, &slope.to_le_bytes());
    put(116, &intercept.to_le_bytes());
    put(123, &[if grid.unit == Unit::Unknown { 0 } else { 2 }]);
    put(148, b"isoclay");
    // 2: aligned to some other scan, the code for "a transform, and no standard space is claimed".
    put(254, &2i16.to_le_bytes());
    for row in 0..3 {
        let values = [columns[0][row], columns[1][row], columns[2][row], offset[row]];
        for (i, v) in values.into_iter().enumerate() {
            put(280 + 16 * row + 4 * i, &(v as f32).to_le_bytes());
        }
    }
    put(344, b"n+1\0");
    Ok(h)
}
