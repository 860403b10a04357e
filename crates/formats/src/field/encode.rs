//! A field as bytes.

use std::io::{self, Write};

use bspline::HierarchicalSpline;
use bspline::hierarchical::Lattice;

use super::chunk::{self, Kind};
use super::kinds::{END, HEADER, LEAVES, LEVEL, SIGNS};
use super::levels::to_bytes;
use super::valid::{self, Wrong};
use super::{FieldMeta, MAGIC, Stored, VERSION, beside};
use crate::Fault;

/// The bytes of a field file.
///
/// # Errors
/// As [`super::save`], without I/O.
pub fn encode<T: Stored>(field: &HierarchicalSpline<T>, meta: &FieldMeta) -> Result<Vec<u8>, Fault> {
    check(field, meta)?;
    let mut bytes = Vec::new();
    write(&mut bytes, field, meta).map_err(|source| Fault::Io {
        doing: "packing",
        source,
    })?;
    Ok(bytes)
}

/// Refuses what reading would refuse, by the same rules; that its functions are the lattice's a field sees to itself.
pub(super) fn check<T: Stored>(field: &HierarchicalSpline<T>, meta: &FieldMeta) -> Result<(), Fault> {
    let all = || -> Result<(), Wrong> {
        let count = field.level_count();
        valid::frame(field.lattice(), count as u64, field.slope(), meta.iso)?;
        valid::leaves(&meta.leaves, &meta.sign_confidence)?;
        let texts = [&meta.density_unit, &meta.report, &meta.provenance];
        valid::lengths(texts.into_iter().chain(&meta.notes), meta)
    };
    all().map_err(made_wrongly)
}

/// What is to be written and no field has.
pub(super) fn made_wrongly(Wrong { what, value }: Wrong) -> Fault {
    Fault::Output {
        what,
        value,
        remedy: "no field has this; fit the input again",
    }
}

/// Writes a checked field.
pub(super) fn write<T: Stored>(
    out: &mut dyn Write,
    field: &HierarchicalSpline<T>,
    meta: &FieldMeta,
) -> io::Result<()> {
    begin::<T>(out, field.lattice(), field.slope(), field.level_count(), meta)?;
    let mut count = 1u32;
    let mut put = |kind: Kind, raw: &[u8]| {
        count += 1;
        chunk::write(out, kind, raw)
    };
    for level in 0..field.level_count() {
        put(LEVEL, &to_bytes(level as u32, &field.corrections(level)))?;
    }
    if !meta.leaves.is_empty() {
        put(LEAVES, &leaves(meta))?;
    }
    if !meta.sign_confidence.is_empty() {
        let raw: Vec<u8> = meta
            .sign_confidence
            .iter()
            .flat_map(|c| c.to_le_bytes())
            .collect();
        put(SIGNS, &raw)?;
    }
    for (kind, raw) in beside::texts(meta) {
        put(kind, &raw)?;
    }
    chunk::write(out, END, &count.to_le_bytes())
}

/// Writes all up to the first level: magic, version, header.
pub(super) fn begin<T: Stored>(
    out: &mut dyn Write,
    lattice: &Lattice,
    slope: f64,
    level_count: usize,
    meta: &FieldMeta,
) -> io::Result<()> {
    out.write_all(&MAGIC)?;
    out.write_all(&VERSION.to_le_bytes())?;
    let mut raw = beside::marks::<T>(meta).to_vec();
    raw.extend((level_count as u32).to_le_bytes());
    lattice.cells.iter().for_each(|n| raw.extend(n.to_le_bytes()));
    lattice
        .world_from_lattice
        .to_cols_array()
        .iter()
        .for_each(|x| raw.extend(x.to_le_bytes()));
    raw.extend(slope.to_le_bytes());
    raw.extend(meta.iso.unwrap_or(0.0).to_le_bytes());
    beside::put_text(&mut raw, &meta.density_unit);
    chunk::write(out, HEADER, &raw)
}

/// The leaf table, a column after the other: columns of like numbers pack several times better than rows.
fn leaves(meta: &FieldMeta) -> Vec<u8> {
    let leaves = &meta.leaves;
    let mut raw = Vec::with_capacity(4 + leaves.len() * 26);
    raw.extend((leaves.len() as u32).to_le_bytes());
    raw.extend(leaves.iter().map(|l| l.level));
    raw.extend(leaves.iter().map(|l| l.reason));
    for axis in 0..3 {
        leaves.iter().for_each(|l| raw.extend(l.cell[axis].to_le_bytes()));
    }
    leaves
        .iter()
        .for_each(|l| raw.extend(l.sample_count.to_le_bytes()));
    leaves.iter().for_each(|l| raw.extend(l.rms.to_le_bytes()));
    leaves.iter().for_each(|l| raw.extend(l.max.to_le_bytes()));
    raw
}
