//! A field out of bytes that may be anything.

use bspline::HierarchicalSpline;
use bspline::hierarchical::{BRICK, HALO_LEN, Lattice};
use glam::DAffine3;

use super::chunk::Chunk;
use super::cursor::Cursor;
use super::kinds::{END, HEADER, LEAVES, LEVEL, NOTES, PROVENANCE, REPORT, SIGNS};
use super::levels::{self, Level};
use super::valid::{self, Wrong, written_wrongly};
use super::{AnyField, FieldMeta, LeafRecord, LoadedField, MAGIC, SourceKind, Stored, VERSION};
use crate::error::excerpt;
use crate::limits::Budget;
use crate::{Fault, ReadLimits, Unit};

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
    let mut at = (MAGIC.len() + 4) as u64;
    let mut take = || {
        let chunk = Chunk::take(&mut rest, at)?;
        at += chunk.stored_length();
        Ok(chunk)
    };
    let first: Chunk = take()?;
    if first.kind != HEADER {
        return Err(Fault::Damaged {
            what: format!("the first chunk is {}, not \"HEAD\"", excerpt(&first.kind)),
        });
    }
    let header = Header::read(&first.unpack(budget)?)?;
    let mut chunks = vec![first];
    let end = loop {
        let chunk = take()?;
        if chunk.kind == END {
            break chunk;
        }
        chunks.push(chunk);
    };
    if !rest.is_empty() {
        return Err(Fault::Damaged {
            what: format!("{} bytes follow the last chunk", rest.len()),
        });
    }
    let raw = end.unpack(budget)?;
    let mut cursor = Cursor::new(&raw, "the last chunk");
    let count = cursor.u32()? as usize;
    cursor.end()?;
    if count != chunks.len() {
        return Err(Fault::Damaged {
            what: format!("{} chunks are there, {count} are stated", chunks.len()),
        });
    }
    match header.bytes_per_value {
        4 => assemble::<f32>(header, &chunks[1..], budget),
        _ => assemble::<f64>(header, &chunks[1..], budget),
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
        let bad = |what, value| Err(written_wrongly(Wrong { what, value }));
        let mut c = Cursor::new(raw, "the header");
        let [bytes_per_value, source, unit, has_iso] = [c.u8()?, c.u8()?, c.u8()?, c.u8()?];
        let level_count = c.u32()?;
        let cells = [c.u32()?, c.u32()?, c.u32()?];
        let mut map = [0.0; 12];
        for x in &mut map {
            *x = c.f64()?;
        }
        let (slope, iso) = (c.f64()?, c.f64()?);
        let density_unit = c.text()?;
        c.end()?;
        if !matches!(bytes_per_value, 4 | 8) {
            return bad("the precision (bytes of a value)", bytes_per_value.to_string());
        }
        let source = match source {
            0 => SourceKind::Cloud,
            1 => SourceKind::Volume,
            2 => SourceKind::Other,
            other => return bad("the kind of source", other.to_string()),
        };
        let Some(unit) = Unit::from_code(unit) else {
            return bad("the unit of length", unit.to_string());
        };
        if has_iso > 1 {
            return bad("the mark of the iso-value", has_iso.to_string());
        }
        let lattice = Lattice {
            world_from_lattice: DAffine3::from_cols_array(&map),
            cells,
        };
        valid::frame(&lattice, level_count.into(), slope, Some(iso)).map_err(written_wrongly)?;
        let iso = (has_iso == 1).then_some(iso);
        let meta = FieldMeta {
            source,
            unit,
            density_unit,
            iso,
            ..Default::default()
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
            REPORT => meta.report = text(chunk.unpack(budget)?)?,
            PROVENANCE => meta.provenance = text(chunk.unpack(budget)?)?,
            NOTES => {
                let raw = chunk.unpack(budget)?;
                let mut cursor = Cursor::new(&raw, "the notes");
                // A note takes at least the four bytes of its length.
                budget.reserve("the notes", raw.len() as u64 / 4, size_of::<String>())?;
                for _ in 0..cursor.u32()? {
                    meta.notes.push(cursor.text()?);
                }
                cursor.end()?;
            }
            HEADER => {
                return Err(Fault::Damaged {
                    what: "a second header".into(),
                });
            }
            other => skipped_chunks.push(String::from_utf8_lossy(&other).into_owned()),
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

fn text(raw: Vec<u8>) -> Result<String, Fault> {
    String::from_utf8(raw).map_err(|_| Fault::Damaged {
        what: "a text chunk is no UTF-8".into(),
    })
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
