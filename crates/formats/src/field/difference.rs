//! Differences of versions of a field as bytes: what undo keeps on disk and a journal carries.

use std::collections::BTreeMap;
use std::sync::Arc;

use bspline::hierarchical::{BrickChange, BrickDiff, Corrections, Lattice};

use super::chunk::{self, Kind};
use super::cursor::Cursor;
use super::levels::{Level, from_bytes, to_bytes};
use super::{MAX_LEVELS, Stored};
use crate::limits::Budget;
use crate::{Fault, ReadLimits};

/// First bytes of a difference.
pub const DIFFERENCE_MAGIC: [u8; 8] = *b"\x89ICDIFF\n";

const HEADER: Kind = *b"DIFF";
const OLD: Kind = *b"OLD ";
const NEW: Kind = *b"NEW ";

/// The bytes of a difference: corrections alone, level by level, old and new.
///
/// # Errors
/// [`Fault::Io`] if packing fails.
pub fn encode_difference<T: Stored>(diff: &BrickDiff<T>) -> Result<Vec<u8>, Fault> {
    let mut levels: BTreeMap<usize, [Level<T>; 2]> = BTreeMap::new();
    let empty = Arc::new(Corrections::empty());
    for change in &diff.bricks {
        let [old, new] = levels.entry(change.level).or_default();
        let of = |c: &Option<Arc<Corrections<T>>>| c.clone().unwrap_or_else(|| empty.clone());
        old.insert(change.key, of(&change.old));
        new.insert(change.key, of(&change.new));
    }
    let mut bytes = DIFFERENCE_MAGIC.to_vec();
    let mut head = vec![T::BYTES as u8];
    head.extend((levels.len() as u32).to_le_bytes());
    let mut write = |kind: Kind, raw: &[u8]| {
        chunk::write(&mut bytes, kind, raw).map_err(|source| Fault::Io {
            doing: "packing",
            source,
        })
    };
    write(HEADER, &head)?;
    for (level, [old, new]) in &levels {
        write(OLD, &to_bytes(*level as u32, old))?;
        write(NEW, &to_bytes(*level as u32, new))?;
    }
    Ok(bytes)
}

/// Reads a difference of fields on `lattice`.
///
/// # Errors
/// [`Fault::Value`], [`Fault::Damaged`], [`Fault::Truncated`] for bytes that are no such difference; [`Fault::Limit`].
pub fn decode_difference<T: Stored>(
    bytes: &[u8],
    lattice: &Lattice,
    limits: &ReadLimits,
) -> Result<BrickDiff<T>, Fault> {
    let mut budget = Budget::new(limits);
    let mut rest = bytes
        .strip_prefix(&DIFFERENCE_MAGIC)
        .ok_or_else(|| damaged("it does not start as a difference does"))?;
    let mut take = |kind: Kind, budget: &mut Budget| chunk::expected(&mut rest, bytes.len(), kind, budget);
    let head = take(HEADER, &mut budget)?;
    let mut cursor = Cursor::new(&head, "the head of a difference");
    let (value, count) = (cursor.u8()?, cursor.u32()?);
    cursor.end()?;
    if usize::from(value) != T::BYTES {
        return Err(Fault::Value {
            what: "the precision (bytes of a value)",
            value: value.to_string(),
            remedy: "read it in the precision of its field",
        });
    }
    let mut diff = BrickDiff { bricks: Vec::new() };
    let mut next = 0;
    for _ in 0..count {
        let old = take(OLD, &mut budget)?;
        let level = Cursor::new(&old, "the corrections of a level").u32()?;
        if level < next || level as usize >= MAX_LEVELS {
            return Err(damaged("its levels are not in order"));
        }
        next = level + 1;
        let new = take(NEW, &mut budget)?;
        let old: Level<T> = from_bytes(&old, level, lattice, &mut budget)?;
        let new: Level<T> = from_bytes(&new, level, lattice, &mut budget)?;
        if !old.keys().eq(new.keys()) {
            return Err(damaged("old and new are of different bricks"));
        }
        let some = |c: Arc<Corrections<T>>| Some(c).filter(|c| c.count() > 0);
        let changes = old.into_iter().zip(new.into_values());
        diff.bricks.extend(changes.map(|((key, old), new)| BrickChange {
            level: level as usize,
            key,
            old: some(old),
            new: some(new),
        }));
    }
    match rest.len() {
        0 => Ok(diff),
        n => Err(damaged(&format!("{n} bytes follow its last part"))),
    }
}

fn damaged(what: &str) -> Fault {
    Fault::Damaged { what: what.into() }
}
