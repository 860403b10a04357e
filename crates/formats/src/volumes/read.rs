//! Voxels in: straight from the stream into one `f32` each.

use std::io::Read;

use super::header::{self, Parsed};
use super::{Volume, VoxelType};
use crate::input::read_fault;
use crate::limits::Budget;
use crate::{Fault, ReadLimits};

/// Bytes read at a time: small enough to stay in the second-level cache.
pub(super) const BUFFER: usize = 1 << 17;

/// Reads the (inflated) bytes of a NIfTI file.
///
/// # Errors
/// As [`super::read`], without the path.
pub fn parse_nifti(bytes: &[u8], limits: &ReadLimits) -> Result<Volume, Fault> {
    volume(&mut &*bytes, Some(bytes.len() as u64), &mut Budget::new(limits))
}

/// Reads a volume from a stream that holds at most `bound` bytes.
pub(super) fn volume(
    source: &mut impl Read,
    bound: Option<u64>,
    budget: &mut Budget,
) -> Result<Volume, Fault> {
    let parsed = header::read(source)?;
    let count = parsed.header.voxel_count();
    let stored_bytes = count as u64 * parsed.header.stored.size() as u64;
    if let Some(bound) = bound {
        let found = bound.saturating_sub(parsed.voxels_at);
        if stored_bytes > found {
            let [x, y, z] = parsed.header.dims;
            let what = format!("{x} x {y} x {z} voxels of {}", parsed.header.stored);
            return Err(Fault::Truncated {
                what,
                needed: stored_bytes,
                found,
            });
        }
    }
    budget.reserve("the volume", count as u64, size_of::<f32>())?;
    budget.reserve("the reading buffer", BUFFER as u64, 1)?;
    let mut values = Vec::new();
    values.try_reserve_exact(count).map_err(|_| Fault::Limit {
        what: "the volume",
        needed: count as u64 * 4,
        limit: budget.left(),
    })?;
    skip(source, parsed.voxels_at - parsed.consumed)?;
    if parsed.big_endian {
        convert_all::<true>(source, &parsed, &mut values)?;
    } else {
        convert_all::<false>(source, &parsed, &mut values)?;
    }
    finish(parsed, values)
}

fn skip(source: &mut impl Read, count: u64) -> Result<(), Fault> {
    let skipped = std::io::copy(&mut source.take(count), &mut std::io::sink()).map_err(read_fault)?;
    if skipped < count {
        return Err(Fault::Truncated {
            what: "the part between header and voxels".into(),
            needed: count,
            found: skipped,
        });
    }
    Ok(())
}

fn convert_all<const BIG: bool>(
    source: &mut impl Read,
    parsed: &Parsed,
    values: &mut Vec<f32>,
) -> Result<(), Fault> {
    let stored = parsed.header.stored;
    let total = parsed.header.voxel_count() as u64 * stored.size() as u64;
    let mut buffer = vec![0; BUFFER];
    let mut done = 0;
    while done < total {
        let want = (BUFFER as u64).min(total - done) as usize;
        let mut got = 0;
        while got < want {
            match source.read(&mut buffer[got..want]) {
                Ok(0) => {
                    return Err(Fault::Truncated {
                        what: "the voxels".into(),
                        needed: total,
                        found: done + got as u64,
                    });
                }
                Ok(n) => got += n,
                Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
                Err(e) => return Err(read_fault(e)),
            }
        }
        convert::<BIG>(&buffer[..want], stored, parsed.header.rescale, values);
        done += want as u64;
    }
    // A gzip stream is checked against its checksum when its end is met, so go and meet it.
    while source.read(&mut buffer).map_err(read_fault)? > 0 {}
    Ok(())
}

/// Appends the voxels of `raw`; rescaling is done in double precision.
fn convert<const BIG: bool>(raw: &[u8], stored: VoxelType, rescale: Option<[f64; 2]>, values: &mut Vec<f32>) {
    macro_rules! each {
        ($t:ty) => {{
            let voxels = raw.chunks_exact(size_of::<$t>()).map(|b| {
                let b = b.try_into().expect("chunks of this size");
                if BIG {
                    <$t>::from_be_bytes(b)
                } else {
                    <$t>::from_le_bytes(b)
                }
            });
            match rescale {
                None => values.extend(voxels.map(|v| v as f32)),
                Some([slope, intercept]) => {
                    values.extend(voxels.map(|v| (v as f64 * slope + intercept) as f32))
                }
            }
        }};
    }
    match stored {
        VoxelType::U8 => each!(u8),
        VoxelType::I8 => each!(i8),
        VoxelType::U16 => each!(u16),
        VoxelType::I16 => each!(i16),
        VoxelType::U32 => each!(u32),
        VoxelType::I32 => each!(i32),
        VoxelType::U64 => each!(u64),
        VoxelType::I64 => each!(i64),
        VoxelType::F32 => each!(f32),
        VoxelType::F64 => each!(f64),
    }
}

fn finish(parsed: Parsed, mut values: Vec<f32>) -> Result<Volume, Fault> {
    let Parsed {
        header, mut notes, ..
    } = parsed;
    if header.stored.exceeds_f32() {
        notes.push(format!("voxels of {} were rounded to float32", header.stored));
    }
    let can_be_infinite =
        header.rescale.is_some() || matches!(header.stored, VoxelType::F32 | VoxelType::F64);
    let mut replaced_count = 0;
    if can_be_infinite {
        replaced_count = values.iter().filter(|v| !v.is_finite()).count();
    }
    if replaced_count > 0 {
        if replaced_count == values.len() {
            return Err(Fault::Value {
                what: "the number of finite voxels",
                value: format!("0 of {replaced_count}"),
                remedy: "check how the volume was exported",
            });
        }
        let least = values
            .iter()
            .copied()
            .filter(|v| v.is_finite())
            .fold(f32::INFINITY, f32::min);
        for v in values.iter_mut().filter(|v| !v.is_finite()) {
            *v = least;
        }
        notes.push(format!(
            "{replaced_count} of {} voxels are NaN or infinite; set to the smallest density, {least}",
            values.len()
        ));
    }
    Ok(Volume {
        header,
        values,
        replaced_count,
        notes,
    })
}
