//! What a field file may hold: asked before it is written and after it is read, so that what was saved can be loaded.

use bspline::hierarchical::{BRICK, BrickKey, Corrections, Lattice, active_slots};

use super::{FieldMeta, LeafRecord, MAX_LEVELS, Stored};
use crate::Fault;
use crate::volumes::geometry::is_usable;

/// Most cells of the finest level along an axis; bricks and slots are counted in 32 bits.
const MAX_CELLS: u64 = 1 << 30;

/// Something that no field has.
#[derive(Debug)]
pub(super) struct Wrong {
    pub what: &'static str,
    pub value: String,
}

/// What a file says that no field has.
pub(super) fn written_wrongly(Wrong { what, value }: Wrong) -> Fault {
    Fault::Value {
        what,
        value,
        remedy: "no field has this; the file was written wrongly",
    }
}

fn wrong(what: &'static str, value: String) -> Result<(), Wrong> {
    Err(Wrong { what, value })
}

/// The numbers of a header.
pub(super) fn frame(lattice: &Lattice, level_count: u64, slope: f64, iso: Option<f64>) -> Result<(), Wrong> {
    if !(1..=MAX_LEVELS as u64).contains(&level_count) {
        return wrong("the number of levels", level_count.to_string());
    }
    let is_too_fine = |n: &u32| *n == 0 || u64::from(*n) << (level_count - 1) > MAX_CELLS;
    if lattice.cells.iter().any(is_too_fine) {
        let value = format!("{:?} cells with {level_count} levels", lattice.cells);
        return wrong("the lattice", value);
    }
    if !is_usable(&lattice.world_from_lattice) {
        let map = lattice.world_from_lattice.to_cols_array();
        return wrong("the map from lattice to world", format!("{map:?}"));
    }
    if !(slope.is_finite() && slope >= 0.0) {
        return wrong("the slope outside of the box", slope.to_string());
    }
    match iso.filter(|v| !v.is_finite()) {
        Some(iso) => wrong("the iso-value", iso.to_string()),
        None => Ok(()),
    }
}

/// A brick of corrections: within the lattice, all finite.
pub(super) fn brick<T: Stored>(
    lattice: &Lattice,
    level: usize,
    key: BrickKey,
    c: &Corrections<T>,
) -> Result<(), Wrong> {
    // Functions stand at slots 0 ..= n+2 of each axis.
    let last = lattice.cells_at(level).map(|n| n + 2);
    if !(0..3).all(|a| key.0[a] <= last[a] / BRICK as u32) || !within(c.mask(), key, last) {
        return wrong(
            "a brick",
            format!("{:?} of level {level}, outside of the lattice", key.0),
        );
    }
    match c.values().iter().find(|value| !value.is_finite()) {
        Some(value) => wrong(
            "a coefficient",
            format!("{value:?} in brick {:?} of level {level}", key.0),
        ),
        None => Ok(()),
    }
}

/// Whether all active slots of a brick are at most `last`, on each axis.
fn within(mask: &[u64; BRICK], key: BrickKey, last: [u32; 3]) -> bool {
    let room = |a: usize| last[a] - key.0[a] * BRICK as u32;
    if (0..3).all(|a| room(a) >= BRICK as u32 - 1) {
        return true;
    }
    active_slots(mask).all(|slot| {
        let place = [slot / 64, slot / 8 % 8, slot % 8];
        (0..3).all(|a| place[a] as u32 <= room(a))
    })
}

/// The leaf table and the confidences beside it.
pub(super) fn leaves(leaves: &[LeafRecord], confidences: &[f32]) -> Result<(), Wrong> {
    // Cells may be finer than the functions that were needed, but 2^32 along an edge is the end of counting.
    let is_bad = |l: &&LeafRecord| !(l.rms.is_finite() && l.max.is_finite()) || l.level >= 32;
    if let Some(leaf) = leaves.iter().find(is_bad) {
        return wrong("a leaf", format!("{leaf:?}"));
    }
    if !confidences.is_empty() && confidences.len() != leaves.len() {
        let value = format!("{} for {} leaves", confidences.len(), leaves.len());
        return wrong("the table of confidences", value);
    }
    match confidences.iter().find(|c| !(0.0..=1.0).contains(*c)) {
        Some(c) => wrong("a confidence", c.to_string()),
        None => Ok(()),
    }
}

/// Lengths and counts have 32 bits.
pub(super) fn lengths<'a>(texts: impl Iterator<Item = &'a String>, meta: &FieldMeta) -> Result<(), Wrong> {
    let counts = [meta.leaves.len(), meta.notes.len()];
    match texts
        .map(String::len)
        .chain(counts)
        .find(|n| u32::try_from(*n).is_err())
    {
        Some(n) => wrong("a text or a table", format!("{n} long")),
        None => Ok(()),
    }
}
