//! Volumes out: NIfTI-1 single files, little endian.

use std::io::{self, Write};
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use glam::DAffine3;

use super::header::SIZE_1;
use crate::volumes::{StoreAs, VoxelType};
use crate::{Fault, FormatError, Unit, atomic, detect};

/// Deflate level: densities hardly compress, so the higher ones cost time and save a few percent.
const LEVEL: u32 = 3;

/// Writes a volume as `.nii`, or `.nii.gz` if `path` ends so, atomically.
///
/// `values` are in file order, `values[x + nx·(y + ny·z)]`. The transform becomes the sform, in single precision,
/// which is all that NIfTI-1 has.
///
/// # Errors
/// [`Fault::Output`] if a dimension exceeds 32767 or `store` cannot be used, I/O.
///
/// # Panics
/// If `values` is not `nx·ny·nz` long.
pub fn save(
    path: &Path,
    dims: [usize; 3],
    values: &[f32],
    world_from_voxel: &DAffine3,
    unit: Unit,
    store: StoreAs,
) -> Result<(), FormatError> {
    let gzip = detect::is_gz_name(path);
    if detect::extension(path) != "nii" {
        let found = format!(".{}", detect::extension(path));
        return Err(Fault::UnknownKind {
            found,
            purpose: "volume output",
            supported: ".nii and .nii.gz",
        }
        .at(path));
    }
    let header = header(dims, world_from_voxel, unit, store).map_err(|f| f.at(path))?;
    atomic::replace(path, |out| {
        if gzip {
            let mut gz = GzEncoder::new(out, Compression::new(LEVEL));
            voxels(&mut gz, &header, dims, values, store)?;
            gz.finish().map(drop)
        } else {
            voxels(out, &header, dims, values, store)
        }
    })
}

/// Writes the bytes of a `.nii` file: see [`save`].
///
/// # Errors
/// As [`save`].
///
/// # Panics
/// As [`save`].
pub fn write_nifti(
    out: &mut impl Write,
    dims: [usize; 3],
    values: &[f32],
    world_from_voxel: &DAffine3,
    unit: Unit,
    store: StoreAs,
) -> Result<(), Fault> {
    let header = header(dims, world_from_voxel, unit, store)?;
    voxels(out, &header, dims, values, store).map_err(|source| Fault::Io {
        doing: "writing",
        source,
    })
}

fn header(dims: [usize; 3], map: &DAffine3, unit: Unit, store: StoreAs) -> Result<[u8; 352], Fault> {
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
    // Files hold millimetres or nothing: other units are scaled.
    let scale = unit.in_mm().unwrap_or(1.0);
    let m = map.matrix3 * scale;
    let columns = [m.x_axis, m.y_axis, m.z_axis];
    let offset = map.translation * scale;
    put(76, &1f32.to_le_bytes());
    for (i, c) in columns.iter().enumerate() {
        put(80 + 4 * i, &(c.length() as f32).to_le_bytes());
    }
    put(108, &352f32.to_le_bytes());
    put(112, &slope.to_le_bytes());
    put(116, &intercept.to_le_bytes());
    put(123, &[if unit == Unit::Unknown { 0 } else { 2 }]);
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

fn voxels(
    out: &mut (impl Write + ?Sized),
    header: &[u8; 352],
    dims: [usize; 3],
    values: &[f32],
    store: StoreAs,
) -> io::Result<()> {
    assert_eq!(
        values.len(),
        dims.iter().product::<usize>(),
        "one value per voxel"
    );
    out.write_all(header)?;
    let mut bytes = Vec::with_capacity(1 << 17);
    for part in values.chunks(1 << 14) {
        bytes.clear();
        match store {
            StoreAs::Float32 => bytes.extend(part.iter().flat_map(|v| v.to_le_bytes())),
            StoreAs::Integer {
                voxel,
                slope,
                intercept,
            } => {
                // What the header holds, so that reading inverts it.
                let (s, i) = (f64::from(slope as f32), f64::from(intercept as f32));
                let steps = part.iter().map(|v| ((f64::from(*v) - i) / s).round());
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
        }
        out.write_all(&bytes)?;
    }
    Ok(())
}
