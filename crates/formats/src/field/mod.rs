//! The native file of a fitted field, `.iclay`: see `docs/format.md` for every byte.

mod beside;
mod chunk;
mod columns;
mod cursor;
mod decode;
mod difference;
mod encode;
mod kinds;
mod knots;
mod levels;
mod part;
mod sink;
mod stored;
mod valid;

use std::path::Path;

pub use bspline::AnyField;
use bspline::HierarchicalSpline;

pub use decode::decode;
pub use difference::{DIFFERENCE_MAGIC, decode_difference, encode_difference};
pub use encode::encode;
pub use knots::{KNOTS_MAGIC, decode_knots, decode_knots_difference, encode_knots, encode_knots_difference};
pub use part::{PART_MAGIC, PartIndex, encode_part};
pub use sink::{FieldSink, Frame, save_stream};
pub use stored::Stored;

use crate::limits::Budget;
use crate::{Fault, FormatError, ReadLimits, Unit, atomic, input};

/// First bytes of every field file. Like those of PNG, they show when a transfer has mangled line ends or
/// stripped the eighth bit.
pub const MAGIC: [u8; 8] = *b"\x89ICLAY\r\n";

/// Version that is written, and the newest that is read. All older ones are read too.
pub const VERSION: u32 = 2;

/// Most levels a file may have: 2^20 cells along a cell of level 0 is beyond any scan.
pub const MAX_LEVELS: usize = 21;

/// What a field was fitted to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum SourceKind {
    /// A point cloud: values are signed distances, the surface lies at 0.
    #[default]
    Cloud = 0,
    /// A volume: values are densities.
    Volume = 1,
    /// Something else, such as a formula.
    Other = 2,
}

/// A dyadic cell that was not split, as the file keeps it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LeafRecord {
    /// Level of the cell.
    pub level: u8,
    /// Place of the cell on its level.
    pub cell: [u32; 3],
    /// Samples in the cell; 0 is the stored fact that there is no data here.
    pub sample_count: u32,
    /// Root of the mean square residual; finite.
    pub rms: f32,
    /// Largest absolute residual; finite.
    pub max: f32,
    /// Why the cell was not split: the code of the fit's own enumeration.
    pub reason: u8,
}

/// What is stored beside a field. Nothing here enters the field's hash.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FieldMeta {
    /// What the field was fitted to.
    pub source: SourceKind,
    /// Unit of world lengths.
    pub unit: Unit,
    /// Unit of the values, such as `HU` or `mm`; empty if unknown.
    pub density_unit: String,
    /// Value at which the surface is meant to lie, if there is one.
    pub iso: Option<f64>,
    /// Report of the fit, a JSON object or empty.
    pub report: String,
    /// Error of each leaf, in the fit's order.
    pub leaves: Vec<LeafRecord>,
    /// Confidence in the sign of each leaf, 0 to 1, in the order of `leaves`; empty where no sign was estimated.
    pub sign_confidence: Vec<f32>,
    /// Repairs and doubts met on the way.
    pub notes: Vec<String>,
    /// Where the field comes from (input, options, program version), a JSON object or empty.
    pub provenance: String,
}

/// What a field file holds.
#[derive(Clone, Debug)]
pub struct LoadedField {
    /// The field.
    pub field: AnyField,
    /// What is stored beside it.
    pub meta: FieldMeta,
    /// Types of chunks that this version does not know; they were skipped and would be lost by saving.
    pub skipped_chunks: Vec<String>,
}

/// Writes a field file, atomically.
///
/// # Errors
/// [`Fault::Output`] for whatever [`load`] would refuse: a value that is not finite, a brick outside of the lattice,
/// more levels than [`MAX_LEVELS`]; I/O.
pub fn save<T: Stored>(
    path: &Path,
    field: &HierarchicalSpline<T>,
    meta: &FieldMeta,
) -> Result<(), FormatError> {
    encode::check(field, meta).map_err(|fault| fault.at(path))?;
    atomic::replace(path, |out| encode::write(out, field, meta))
}

/// Reads a field file and builds the field.
///
/// # Errors
/// [`Fault::Value`] for a file that is none of ours, is newer than this program, or holds values that no field
/// has; [`Fault::Truncated`] and [`Fault::Damaged`]; [`Fault::Limit`], which also weighs the totals that the
/// field will be evaluated from.
pub fn load(path: &Path, limits: &ReadLimits) -> Result<LoadedField, FormatError> {
    let load = || {
        let mut budget = Budget::new(limits);
        let bytes = input::open(path)?.read_all(&mut budget)?;
        decode::decode_within(&bytes, &mut budget)
    };
    load().map_err(|fault: Fault| fault.at(path))
}

#[cfg(test)]
mod stream_tests;
#[cfg(test)]
mod tests;
