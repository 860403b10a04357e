//! The corrections of a level as bytes: keys, masks, then the values of active slots in byte planes.

use std::collections::BTreeMap;
use std::sync::Arc;

use bspline::hierarchical::{BRICK, BrickKey, Corrections, Lattice};

use super::Stored;
use super::cursor::Cursor;
use super::valid::{self, written_wrongly};
use crate::Fault;
use crate::limits::Budget;

/// The bricks of one level, in key order.
pub(super) type Level<T> = BTreeMap<BrickKey, Arc<Corrections<T>>>;

/// Bytes of a level's chunk before packing.
pub(super) fn to_bytes<T: Stored>(level: u32, bricks: &Level<T>) -> Vec<u8> {
    let active: usize = bricks.values().map(|c| c.count()).sum();
    let mut bytes = Vec::with_capacity(8 + bricks.len() * (12 + 64) + active * T::BYTES);
    bytes.extend(level.to_le_bytes());
    bytes.extend((bricks.len() as u32).to_le_bytes());
    for key in bricks.keys() {
        key.0.iter().for_each(|k| bytes.extend(k.to_le_bytes()));
    }
    for c in bricks.values() {
        c.mask().iter().for_each(|m| bytes.extend(m.to_le_bytes()));
    }
    // Byte i of all values, then byte i + 1: signs and exponents stand together and pack, mantissas do not.
    let planes = bytes.len();
    bytes.resize(planes + active * T::BYTES, 0);
    let mut at = 0;
    for c in bricks.values() {
        for value in c.values() {
            for (i, b) in value.to_raw().as_ref().iter().enumerate() {
                bytes[planes + i * active + at] = *b;
            }
            at += 1;
        }
    }
    bytes
}

/// Reads the chunk of level `expected`; keys, masks and values are checked against `lattice`.
pub(super) fn from_bytes<T: Stored>(
    bytes: &[u8],
    expected: u32,
    lattice: &Lattice,
    budget: &mut Budget,
) -> Result<Level<T>, Fault> {
    let mut cursor = Cursor::new(bytes, "the corrections of a level");
    let (level, count) = (cursor.u32()?, cursor.u32()?);
    if level != expected {
        return Err(wrong(format!(
            "level {level} stands where level {expected} has to"
        )));
    }
    let keys = cursor.take(u64::from(count) * 12)?;
    let masks = cursor.take(u64::from(count) * 64)?;
    let planes = &bytes[8 + keys.len() + masks.len()..];
    let active: u64 = masks
        .as_chunks::<8>()
        .0
        .iter()
        .map(|m| u64::from_le_bytes(*m).count_ones() as u64)
        .sum();
    cursor.take(active * T::BYTES as u64)?;
    cursor.end()?;
    let active = active as usize;

    let brick = size_of::<Corrections<T>>() + 64;
    budget.reserve("the coefficients", active as u64, T::BYTES)?;
    budget.reserve("the bricks of coefficients", count.into(), brick)?;
    let mut bricks = Vec::with_capacity(count as usize);
    let mut previous = None;
    let mut at = 0;
    for (key, mask) in keys.as_chunks::<12>().0.iter().zip(masks.as_chunks::<64>().0) {
        let word = |i: usize| u32::from_le_bytes(std::array::from_fn(|b| key[4 * i + b]));
        let key = BrickKey([word(0), word(1), word(2)]);
        if previous.is_some_and(|p| p >= key) {
            return Err(wrong(format!(
                "brick {:?} of level {level} is out of order",
                key.0
            )));
        }
        previous = Some(key);
        let mask: [u64; BRICK] =
            std::array::from_fn(|i| u64::from_le_bytes(std::array::from_fn(|b| mask[8 * i + b])));
        let end = at + mask.iter().map(|m| m.count_ones() as usize).sum::<usize>();
        let values = (at..end).map(|at| T::from_bytes(|i| planes[i * active + at]));
        let c = Corrections::new(mask, values.collect());
        at = end;
        valid::brick(lattice, level as usize, key, &c).map_err(written_wrongly)?;
        bricks.push((key, Arc::new(c)));
    }
    // From a sorted list the tree is built in one go.
    Ok(bricks.into_iter().collect())
}

fn wrong(what: String) -> Fault {
    Fault::Damaged { what }
}
