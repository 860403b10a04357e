//! Splines on knot vectors of their own, and differences of their versions, as bytes: objects of documents.

use bspline::tensor::TensorDiff;
use bspline::{KnotVector, Real, TensorSpline};
use glam::DAffine3;

use super::chunk::{self, Kind};
use super::cursor::Cursor;
use super::kinds::{COEFFICIENTS, END, KNOTS, KNOTS_HEADER};
use super::valid::{Wrong, written_wrongly};
use super::{FieldMeta, Stored, beside};
use crate::limits::Budget;
use crate::{Fault, ReadLimits};

/// First bytes of such a spline.
pub const KNOTS_MAGIC: [u8; 8] = *b"\x89IKNOT\r\n";
/// First bytes of a difference of two.
const DIFFERENCE_MAGIC: [u8; 8] = *b"\x89IKDIFF\n";
/// Version that is written and read.
const VERSION: u32 = 1;

const HEADER: Kind = *b"DIFF";
const OLD: Kind = *b"OLD ";
const NEW: Kind = *b"NEW ";

/// The bytes of a spline and of what stands beside it; leaves, which only fits have, are not among them.
///
/// # Errors
/// [`Fault::Io`] if packing fails; [`Fault::Output`] for an iso-value that is not finite.
pub fn encode_knots<T: Stored>(spline: &TensorSpline<T>, meta: &FieldMeta) -> Result<Vec<u8>, Fault> {
    if let Some(iso) = meta.iso.filter(|iso| !iso.is_finite()) {
        return Err(Fault::Output {
            what: "the iso-value",
            value: iso.to_string(),
            remedy: "name the density of its surface",
        });
    }
    let mut bytes = KNOTS_MAGIC.to_vec();
    bytes.extend(VERSION.to_le_bytes());
    let mut head = beside::marks::<T>(meta).to_vec();
    for knots in spline.knots() {
        head.extend((knots.degree() as u32).to_le_bytes());
    }
    let map = spline.world_from_parameter().to_cols_array();
    let numbers = map.into_iter().chain([spline.slope(), meta.iso.unwrap_or(0.0)]);
    numbers.for_each(|x| head.extend(x.to_le_bytes()));
    beside::put_text(&mut head, &meta.density_unit);
    let mut parts = vec![(KNOTS_HEADER, head)];
    for knots in spline.knots() {
        parts.push((
            KNOTS,
            knots.knots().iter().flat_map(|u| u.to_le_bytes()).collect(),
        ));
    }
    parts.push((COEFFICIENTS, raw(spline.coefficients())));
    parts.extend(beside::texts(meta));
    parts.push((END, (parts.len() as u32).to_le_bytes().to_vec()));
    written(bytes, parts)
}

/// Reads such a spline.
///
/// # Errors
/// [`Fault::Value`] for bytes that are no such spline, are newer than this program, or hold values that no spline has;
/// [`Fault::Truncated`], [`Fault::Damaged`]; [`Fault::Limit`].
pub fn decode_knots<T: Stored>(
    bytes: &[u8],
    limits: &ReadLimits,
) -> Result<(TensorSpline<T>, FieldMeta), Fault> {
    let mut budget = Budget::new(limits);
    let rest = bytes
        .strip_prefix(&KNOTS_MAGIC)
        .ok_or_else(|| damaged("it does not start as a spline on knots does"))?;
    let version = Cursor::new(rest, "the version").u32()?;
    if version != VERSION {
        return Err(Fault::Value {
            what: "the version of the spline",
            value: version.to_string(),
            remedy: "this program reads version 1; use a newer one",
        });
    }
    let chunks = beside::chunks(&rest[4..], (KNOTS_MAGIC.len() + 4) as u64, &mut budget)?;
    let (first, others) = beside::header(&chunks, KNOTS_HEADER)?;
    let head = first.unpack(&mut budget)?;
    let mut c = Cursor::new(&head, "the header");
    let marks = [c.u8()?, c.u8()?, c.u8()?, c.u8()?];
    let degrees = [c.u32()?, c.u32()?, c.u32()?];
    let mut numbers = [0.0; 14];
    for x in &mut numbers {
        *x = c.f64()?;
    }
    let density_unit = c.text()?;
    c.end()?;
    let (bytes_per_value, mut meta, has_iso) = beside::of_marks(marks)?;
    if usize::from(bytes_per_value) != T::BYTES {
        return Err(wrong(
            "the precision (bytes of a value)",
            bytes_per_value.to_string(),
        ));
    }
    let [map @ .., slope, iso] = numbers;
    if !iso.is_finite() {
        return Err(wrong("the iso-value", iso.to_string()));
    }
    (meta.density_unit, meta.iso) = (density_unit, has_iso.then_some(iso));
    let (mut knots, mut coefficients) = (Vec::new(), None);
    for chunk in others {
        match chunk.kind {
            KNOTS if knots.len() < 3 => {
                let degree = degrees[knots.len()] as usize;
                knots.push(knot_vector(degree, &chunk.unpack(&mut budget)?, &mut budget)?);
            }
            COEFFICIENTS if coefficients.is_none() => {
                coefficients = Some(values::<T>(&chunk.unpack(&mut budget)?, &mut budget)?);
            }
            KNOTS | COEFFICIENTS | KNOTS_HEADER => return Err(damaged("a part of it is there twice")),
            // Those of later versions are passed over.
            _ => drop(beside::take_text(&mut meta, chunk, &mut budget)?),
        }
    }
    let (Ok(knots), Some(coefficients)) = (<[KnotVector; 3]>::try_from(knots), coefficients) else {
        return Err(damaged("it lacks knots or coefficients"));
    };
    let map = DAffine3::from_cols_array(map.as_array().expect("twelve numbers"));
    let spline = TensorSpline::new(knots, coefficients, map, slope);
    Ok((spline.map_err(|e| wrong("the spline", e.to_string()))?, meta))
}

/// The bytes of a difference of two versions of a spline on the same knots.
///
/// # Errors
/// [`Fault::Io`] if packing fails.
pub fn encode_knots_difference<T: Stored>(diff: &TensorDiff<T>) -> Result<Vec<u8>, Fault> {
    let mut head = vec![T::BYTES as u8];
    for n in diff.first.iter().chain(&diff.count) {
        head.extend(n.to_le_bytes());
    }
    let parts = vec![(HEADER, head), (OLD, raw(&diff.old)), (NEW, raw(&diff.new))];
    written(DIFFERENCE_MAGIC.to_vec(), parts)
}

/// Reads such a difference. That it fits a spline is asked when it is applied.
///
/// # Errors
/// [`Fault::Value`], [`Fault::Damaged`], [`Fault::Truncated`] for bytes that are no such difference; [`Fault::Limit`].
pub fn decode_knots_difference<T: Stored>(bytes: &[u8], limits: &ReadLimits) -> Result<TensorDiff<T>, Fault> {
    let mut budget = Budget::new(limits);
    let mut rest = bytes
        .strip_prefix(&DIFFERENCE_MAGIC)
        .ok_or_else(|| damaged("it does not start as a difference of knots does"))?;
    let mut take = |kind: Kind, budget: &mut Budget| chunk::expected(&mut rest, bytes.len(), kind, budget);
    let head = take(HEADER, &mut budget)?;
    let mut c = Cursor::new(&head, "the head of a difference");
    let value = c.u8()?;
    let first = [c.u32()?, c.u32()?, c.u32()?];
    let count = [c.u32()?, c.u32()?, c.u32()?];
    c.end()?;
    if usize::from(value) != T::BYTES {
        return Err(wrong("the precision (bytes of a value)", value.to_string()));
    }
    let old = values::<T>(&take(OLD, &mut budget)?, &mut budget)?;
    let new = values::<T>(&take(NEW, &mut budget)?, &mut budget)?;
    match rest.len() {
        0 => Ok(TensorDiff {
            first,
            count,
            old,
            new,
        }),
        n => Err(damaged(&format!("{n} bytes follow its last part"))),
    }
}

fn written(mut bytes: Vec<u8>, parts: Vec<(Kind, Vec<u8>)>) -> Result<Vec<u8>, Fault> {
    for (kind, raw) in parts {
        chunk::write(&mut bytes, kind, &raw).map_err(|source| Fault::Io {
            doing: "packing",
            source,
        })?;
    }
    Ok(bytes)
}

fn knot_vector(degree: usize, raw: &[u8], budget: &mut Budget) -> Result<KnotVector, Fault> {
    let knots = values::<f64>(raw, budget)?;
    KnotVector::new(degree, knots).map_err(|e| wrong("the knots of an axis", e.to_string()))
}

fn raw<T: Real>(values: &[T]) -> Vec<u8> {
    let mut raw = Vec::with_capacity(size_of_val(values));
    values.iter().for_each(|v| v.extend_le_bytes(&mut raw));
    raw
}

fn values<T: Stored>(raw: &[u8], budget: &mut Budget) -> Result<Vec<T>, Fault> {
    if !raw.len().is_multiple_of(T::BYTES) {
        return Err(damaged("a list ends within a number"));
    }
    let count = raw.len() / T::BYTES;
    budget.reserve("a list of numbers", count as u64, T::BYTES)?;
    let one = |part: &[u8]| T::from_bytes(|i| part[i]);
    Ok(raw.chunks_exact(T::BYTES).map(one).collect())
}

fn wrong(what: &'static str, value: String) -> Fault {
    written_wrongly(Wrong { what, value })
}

fn damaged(what: &str) -> Fault {
    Fault::Damaged { what: what.into() }
}

#[cfg(test)]
#[path = "knots_tests.rs"]
mod tests;
