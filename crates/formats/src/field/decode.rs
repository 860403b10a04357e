//! A field out of bytes that may be anything.

use bspline::HierarchicalSpline;
use bspline::hierarchical::{BRICK, HALO_LEN, Lattice};
use glam::DAffine3;

use super::chunk::Chunk;
use super::cursor::Cursor;
use super::kinds::{HEADER, LEAVES, LEVEL, SIGNS};
use super::levels::{self, Level};
use super::valid::{self, written_wrongly};
use super::{AnyField, FieldMeta, LeafRecord, LoadedField, MAGIC, Stored, VERSION, beside};
use crate::error::excerpt;
use crate::limits::Budget;
use crate::{Fault, ReadLimits};

/// Reads the bytes of a field file.
///
/// # Errors
/// As [`super::load`], without I/O.
pub fn decode(bytes: &[u8], limits: &ReadLimits) -> Result<LoadedField, Fault> {
    decode_within(bytes, &mut Budget::new(limits))
}

pub(super) fn decode_within(bytes: &[u8], budget: &mut Budget) -> Result<LoadedField, Fault> {
    if bytes.is_empty() {
        return Err(Fault::Empty);
    }
    let mut rest = bytes.strip_prefix(&MAGIC).ok_or_else(|| Fault::Value {
        what: "the start of the file",
        value: excerpt(&bytes[..bytes.len().min(8)]),
        remedy: "a field file starts with \"\\x89ICLAY\\r\\n\"; was it sent as text?",
    })?;
    let version = Cursor::new(rest, "the version").u32()?;
    if !(1..=VERSION).contains(&version) {
        return Err(Fault::Value {
            what: "the version of the file",
            value: version.to_string(),
            remedy: "this program reads versions 1 and 2; use a newer one",
        });
    }
    rest = &rest[4..];
    let chunks = beside::chunks(rest, (MAGIC.len() + 4) as u64, budget)?;
    let (first, others) = beside::header(&chunks, HEADER)?;
    let header = Header::read(&first.unpack(budget)?)?;
    match header.bytes_per_value {
        4 => assemble::<f32>(header, others, budget),
        _ => assemble::<f64>(header, others, budget),
    }
}

struct Header {
    bytes_per_value: u8,
    level_count: u32,
    lattice: Lattice,
    slope: f64,
    meta: FieldMeta,
}

impl Header {
    fn read(raw: &[u8]) -> Result<Self, Fault> {
        let mut c = Cursor::new(raw, "the header");
        let marks = [c.u8()?, c.u8()?, c.u8()?, c.u8()?];
        let level_count = c.u32()?;
        let cells = [c.u32()?, c.u32()?, c.u32()?];
        let mut map = [0.0; 12];
        for x in &mut map {
            *x = c.f64()?;
        }
        let (slope, iso) = (c.f64()?, c.f64()?);
        let density_unit = c.text()?;
        c.end()?;
        let (bytes_per_value, meta, has_iso) = beside::of_marks(marks)?;
        let lattice = Lattice {
            world_from_lattice: DAffine3::from_cols_array(&map),
            cells,
        };
        valid::frame(&lattice, level_count.into(), slope, Some(iso)).map_err(written_wrongly)?;
        let meta = FieldMeta {
            density_unit,
            iso: has_iso.then_some(iso),
            ..meta
        };
        Ok(Self {
            bytes_per_value,
            level_count,
            lattice,
            slope,
            meta,
        })
    }
}

fn assemble<T: Stored>(header: Header, chunks: &[Chunk], budget: &mut Budget) -> Result<LoadedField, Fault> {
    let Header {
        level_count,
        lattice,
        slope,
        mut meta,
        ..
    } = header;
    reserve_box::<T>(&lattice, budget)?;
    let mut levels: Vec<Level<T>> = Vec::new();
    let mut skipped_chunks = Vec::new();
    for chunk in chunks {
        match chunk.kind {
            LEVEL => {
                let level = levels.len() as u32;
                if level == level_count {
                    return Err(Fault::Damaged {
                        what: format!("more than {level_count} levels are stored"),
                    });
                }
                levels.push(levels::from_bytes(
                    &chunk.unpack(budget)?,
                    level,
                    &lattice,
                    budget,
                )?);
            }
            LEAVES => meta.leaves = leaves(&chunk.unpack(budget)?, budget)?,
            SIGNS => meta.sign_confidence = confidences(&chunk.unpack(budget)?, budget)?,
            HEADER => {
                return Err(Fault::Damaged {
                    what: "a second header".into(),
                });
            }
            other => {
                if !beside::take_text(&mut meta, chunk, budget)? {
                    skipped_chunks.push(String::from_utf8_lossy(&other).into_owned());
                }
            }
        }
    }
    if levels.len() != level_count as usize {
        return Err(Fault::Damaged {
            what: format!("{} levels are stored, {level_count} are stated", levels.len()),
        });
    }
    valid::leaves(&meta.leaves, &meta.sign_confidence).map_err(written_wrongly)?;
    reserve_totals(&levels, budget)?;
    let field: AnyField = T::any(HierarchicalSpline::from_corrections(lattice, slope, levels));
    Ok(LoadedField {
        field,
        meta,
        skipped_chunks,
    })
}

/// Books the totals of level 0, which exist everywhere: the lattice alone decides how many there are.
fn reserve_box<T: Stored>(lattice: &Lattice, budget: &mut Budget) -> Result<(), Fault> {
    let bricks = lattice
        .cells
        .iter()
        .fold(1u64, |n, c| n.saturating_mul(u64::from(c.div_ceil(BRICK as u32))));
    budget.reserve("the totals of the coarsest level", bricks, brick_bytes::<T>())
}

/// Books the totals of the finer levels: the functions of a brick reach at most 8 bricks of totals, each of
/// which may need one parent on every coarser level. Where that generous count is too much, they are counted.
fn reserve_totals<T: Stored>(levels: &[Level<T>], budget: &mut Budget) -> Result<(), Fault> {
    let generous: u64 = levels
        .iter()
        .enumerate()
        .map(|(level, l)| (8 * level * l.len()) as u64)
        .sum();
    if generous.saturating_mul(brick_bytes::<T>() as u64) <= budget.left() {
        return budget.reserve("the totals", generous, brick_bytes::<T>());
    }
    let mut finer: Vec<[u32; 3]> = Vec::new();
    let mut total = 0;
    for level in levels.iter().skip(1).rev() {
        let mut needed: Vec<[u32; 3]> = finer.iter().map(|k| k.map(|b| b >> 1)).collect();
        for key in level.keys() {
            for octant in 0..8u32 {
                needed.push(std::array::from_fn(|a| key.0[a].saturating_sub(octant >> a & 1)));
            }
        }
        needed.sort_unstable();
        needed.dedup();
        total += needed.len() as u64;
        finer = needed;
    }
    budget.reserve("the totals", total, brick_bytes::<T>())
}

/// Bytes of a brick of totals with its key, hull and links.
fn brick_bytes<T: Stored>() -> usize {
    HALO_LEN * T::BYTES + 128
}

fn confidences(raw: &[u8], budget: &mut Budget) -> Result<Vec<f32>, Fault> {
    let (all, rest) = raw.as_chunks::<4>();
    budget.reserve("the confidences", all.len() as u64, size_of::<f32>())?;
    let all: Vec<f32> = all.iter().map(|b| f32::from_le_bytes(*b)).collect();
    if !rest.is_empty() {
        return Err(Fault::Damaged {
            what: "the table of confidences ends within a number".into(),
        });
    }
    Ok(all)
}

fn leaves(raw: &[u8], budget: &mut Budget) -> Result<Vec<LeafRecord>, Fault> {
    let mut c = Cursor::new(raw, "the leaf table");
    let count = c.u32()?;
    let n = u64::from(count);
    let (levels, reasons) = (c.take(n)?, c.take(n)?);
    let mut column = || c.take(4 * n).map(|b| b.as_chunks::<4>().0);
    let cells = [column()?, column()?, column()?];
    let (counts, rms, max) = (column()?, column()?, column()?);
    c.end()?;
    budget.reserve("the leaf table", n, size_of::<LeafRecord>())?;
    Ok((0..count as usize)
        .map(|i| LeafRecord {
            level: levels[i],
            cell: cells.map(|column| u32::from_le_bytes(column[i])),
            sample_count: u32::from_le_bytes(counts[i]),
            rms: f32::from_le_bytes(rms[i]),
            max: f32::from_le_bytes(max[i]),
            reason: reasons[i],
        })
        .collect())
}
