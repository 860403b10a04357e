//! What stands beside a field, whatever it is made of: the same bytes in every file.

use bspline::Real;

use super::chunk::{Chunk, Kind};
use super::cursor::Cursor;
use super::kinds::{END, NOTES, PROVENANCE, REPORT};
use super::valid::{Wrong, written_wrongly};
use super::{FieldMeta, SourceKind};
use crate::error::excerpt;
use crate::limits::Budget;
use crate::{Fault, Unit};

/// The first four bytes of a header: precision, source, unit, whether there is an iso-value.
pub(super) fn marks<T: Real>(meta: &FieldMeta) -> [u8; 4] {
    [
        size_of::<T>() as u8,
        meta.source as u8,
        meta.unit as u8,
        u8::from(meta.iso.is_some()),
    ]
}

/// Bytes of a value, what stands beside the field as far as the four bytes tell, and whether there is an iso-value.
pub(super) fn of_marks(
    [bytes_per_value, source, unit, has_iso]: [u8; 4],
) -> Result<(u8, FieldMeta, bool), Fault> {
    let bad = |what, value| Err(written_wrongly(Wrong { what, value }));
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
    let meta = FieldMeta {
        source,
        unit,
        ..Default::default()
    };
    Ok((bytes_per_value, meta, has_iso == 1))
}

/// A text as it stands in a chunk: its length, then UTF-8.
pub(super) fn put_text(raw: &mut Vec<u8>, s: &str) {
    raw.extend((s.len() as u32).to_le_bytes());
    raw.extend(s.as_bytes());
}

/// The chunks of report, notes and provenance, as far as there are any.
pub(super) fn texts(meta: &FieldMeta) -> Vec<(Kind, Vec<u8>)> {
    let mut all = Vec::new();
    if !meta.report.is_empty() {
        all.push((REPORT, meta.report.as_bytes().to_vec()));
    }
    if !meta.notes.is_empty() {
        let mut raw = (meta.notes.len() as u32).to_le_bytes().to_vec();
        meta.notes.iter().for_each(|note| put_text(&mut raw, note));
        all.push((NOTES, raw));
    }
    if !meta.provenance.is_empty() {
        all.push((PROVENANCE, meta.provenance.as_bytes().to_vec()));
    }
    all
}

/// Reads a chunk that is one of [`texts`]; false for any other.
pub(super) fn take_text(meta: &mut FieldMeta, chunk: &Chunk, budget: &mut Budget) -> Result<bool, Fault> {
    match chunk.kind {
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
        _ => return Ok(false),
    }
    Ok(true)
}

fn text(raw: Vec<u8>) -> Result<String, Fault> {
    String::from_utf8(raw).map_err(|_| Fault::Damaged {
        what: "a text chunk is no UTF-8".into(),
    })
}

/// All chunks from byte `at` of a file to its last one, which counts them and is not among them.
pub(super) fn chunks<'a>(
    mut rest: &'a [u8],
    mut at: u64,
    budget: &mut Budget,
) -> Result<Vec<Chunk<'a>>, Fault> {
    let mut chunks = Vec::new();
    let end = loop {
        let chunk = Chunk::take(&mut rest, at)?;
        at += chunk.stored_length();
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
    match count == chunks.len() {
        true => Ok(chunks),
        false => Err(Fault::Damaged {
            what: format!("{} chunks are there, {count} are stated", chunks.len()),
        }),
    }
}

/// Refuses a first chunk that is no header.
pub(super) fn header<'a, 'b>(
    chunks: &'b [Chunk<'a>],
    kind: Kind,
) -> Result<(&'b Chunk<'a>, &'b [Chunk<'a>]), Fault> {
    match chunks.split_first() {
        Some((first, others)) if first.kind == kind => Ok((first, others)),
        first => Err(Fault::Damaged {
            what: format!(
                "the first chunk is {}, not {}",
                excerpt(&first.map_or(END, |(first, _)| first.kind)),
                excerpt(&kind)
            ),
        }),
    }
}
