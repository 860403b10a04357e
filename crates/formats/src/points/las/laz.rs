//! Compressed points, by crate laz. What it would allocate on the word of the file is checked before.

use std::io::Cursor;

use laz::laszip::{LasZipCompressor, LasZipDecompressor, LazVlr};
use laz::record::{LayeredPointRecordDecompressor, RecordDecompressor};

use super::header::{Header, u16_at, u32_at};
use crate::limits::Budget;
use crate::{Fault, guard};

/// Compressors of the format [Isenburg, LASzip, 2013].
const POINT_WISE: u16 = 1;
const CHUNKED: u16 = 2;
const LAYERED: u16 = 3;
/// Kinds of items that have layers, and how many [LASzip, layered chunks].
const BYTES: u16 = 0;
const BYTES_14: u16 = 14;
const LAYERS: [(u16, usize); 4] = [(10, 9), (11, 1), (12, 2), (13, 1)];
/// A format has at most five items.
const MAX_ITEMS: usize = 8;
/// Bytes that the models of one extra byte of a point take, contexts and all, and those of everything else.
const MODEL_OF_BYTE: u64 = 1 << 14;
const MODELS: u64 = 1 << 22;
/// Points unpacked at once, in bytes.
const BATCH: usize = 1 << 16;

/// The record that says how the points are compressed.
fn scheme<'a>(header: &Header<'a>) -> Result<&'a [u8], Fault> {
    header
        .record("laszip encoded", 22204)
        .ok_or_else(|| Fault::Damaged {
            what: "the record that says how the points are compressed is missing".into(),
        })
}

/// `head`, which is all that stands before the points, with `points` compressed behind it as a record of `header` says.
///
/// # Errors
/// [`Fault::Value`] for the first scheme of LAZ, without chunks, which nobody writes any more.
pub(in crate::points) fn pack(head: &[u8], points: &[u8], header: &Header) -> Result<Vec<u8>, Fault> {
    let no = |e: String| Fault::Value {
        what: "the compression of the scan",
        value: e,
        remedy: "it is read and not written: unpack the scan to .las and fit that",
    };
    let vlr = LazVlr::from_buffer(scheme(header)?).map_err(|e| no(e.to_string()))?;
    let mut out = Cursor::new(head.to_vec());
    out.set_position(head.len() as u64);
    let mut compressor = LasZipCompressor::new(&mut out, vlr).map_err(|e| no(e.to_string()))?;
    let packed = compressor.compress_many(points).and_then(|()| compressor.done());
    packed.map_err(|e| no(e.to_string()))?;
    drop(compressor);
    Ok(out.into_inner())
}

/// Calls `each` with the bytes of every point.
pub(in crate::points) fn unpack(
    bytes: &[u8],
    header: &Header,
    budget: &mut Budget,
    mut each: impl FnMut(&[u8], &mut Budget) -> Result<(), Fault>,
) -> Result<(), Fault> {
    let damaged = |what: String| Fault::Damaged { what };
    let data = scheme(header)?;
    if data.len() < 34 {
        return Err(damaged(format!(
            "the record of the compression has {} bytes of 34 at least",
            data.len()
        )));
    }
    let (compressor, chunk_size, item_count) =
        (u16_at(data, 0), u32_at(data, 12), usize::from(u16_at(data, 32)));
    // Kind and size.
    let items: Vec<(u16, u16)> = data[34..]
        .chunks_exact(6)
        .take(item_count)
        .map(|i| (u16_at(i, 0), u16_at(i, 2)))
        .collect();
    let size: usize = items.iter().map(|i| usize::from(i.1)).sum();
    if items.len() != item_count || item_count > MAX_ITEMS || size != header.record_bytes {
        return Err(damaged(format!(
            "{item_count} compressed items of {size} bytes in all, a point has {}",
            header.record_bytes
        )));
    }
    let extra: u64 = items
        .iter()
        .filter(|i| matches!(i.0, BYTES | BYTES_14))
        .map(|i| u64::from(i.1))
        .sum();
    budget.reserve("the models of the decoder", MODELS + extra * MODEL_OF_BYTE, 1)?;
    let vlr = || {
        guard::decode("decoder of LAZ", || {
            LazVlr::from_buffer(data).map_err(|e| damaged(format!("its compression is not known: {e}")))
        })
    };
    match compressor {
        POINT_WISE | CHUNKED => {
            if compressor == CHUNKED {
                check_chunk_table(bytes, header.points_at, budget)?;
            }
            let mut source = Cursor::new(bytes);
            source.set_position(header.points_at as u64);
            let vlr = vlr()?;
            let mut decoder = guard::decode("decoder of LAZ", || {
                LasZipDecompressor::new(source, vlr)
                    .map_err(|e| damaged(format!("the compressed points do not hold: {e}")))
            })?;
            batches(
                header.point_count,
                header,
                budget,
                |out| decoder.decompress_many(out),
                &mut each,
            )
        }
        LAYERED => layered(bytes, header, &vlr()?, &items, chunk_size, budget, &mut each),
        other => Err(damaged(format!("compressor {other} is not known"))),
    }
}

/// Decodes `count` points and hands each on.
fn batches(
    count: u64,
    header: &Header,
    budget: &mut Budget,
    mut decode: impl FnMut(&mut [u8]) -> std::io::Result<()>,
    each: &mut impl FnMut(&[u8], &mut Budget) -> Result<(), Fault>,
) -> Result<(), Fault> {
    let size = header.record_bytes;
    let batch = (BATCH / size).max(1);
    let mut out = vec![0; batch * size];
    let mut left = count;
    while left > 0 {
        let n = left.min(batch as u64) as usize;
        let part = &mut out[..n * size];
        guard::decode("decoder of LAZ", || {
            decode(part).map_err(|e| Fault::Damaged {
                what: format!("the compressed points do not hold, {left} before their end: {e}"),
            })
        })?;
        for point in part.chunks_exact(size) {
            each(point, budget)?;
        }
        left -= n as u64;
    }
    Ok(())
}

/// Refuses a table of more chunks than there are bytes, for which the decoder would make room.
fn check_chunk_table(bytes: &[u8], start: usize, budget: &mut Budget) -> Result<(), Fault> {
    let offset = |at: usize| {
        let b = bytes.get(at..at + 8)?;
        Some(i64::from_le_bytes(b.try_into().expect("eight bytes"))).filter(|o| *o > start as i64)
    };
    // A writer that could not go back leaves the place of the table at the end.
    let Some(table) = offset(start).or_else(|| offset(bytes.len().saturating_sub(8))) else {
        return Ok(());
    };
    let Some(head) = usize::try_from(table)
        .ok()
        .and_then(|t| bytes.get(t..t.saturating_add(8)))
    else {
        return Ok(());
    };
    let chunks = u32_at(head, 4);
    if chunks as usize > bytes.len() {
        return Err(Fault::Damaged {
            what: format!("its table names {chunks} chunks in {} bytes", bytes.len()),
        });
    }
    budget.reserve("the table of chunks", u64::from(chunks), 16)
}

/// Decodes chunks whose fields stand one after the other.
///
/// A chunk is one point as it is, the count of its points, the bytes of each layer, and the layers; the decoder
/// makes room for the layers on the word of the file, so they are checked here, chunk by chunk.
fn layered(
    bytes: &[u8],
    header: &Header,
    vlr: &LazVlr,
    items: &[(u16, u16)],
    chunk_size: u32,
    budget: &mut Budget,
    each: &mut impl FnMut(&[u8], &mut Budget) -> Result<(), Fault>,
) -> Result<(), Fault> {
    let layer_count: usize = items
        .iter()
        .map(|(kind, size)| match LAYERS.iter().find(|l| l.0 == *kind) {
            Some((_, layers)) => *layers,
            None => usize::from(*size),
        })
        .sum();
    let head_bytes = header.record_bytes + 4 + 4 * layer_count;
    // The place of the chunk table is not needed.
    let mut at = header.points_at + 8;
    let mut left = header.point_count;
    while left > 0 {
        let rest = bytes.get(at..).unwrap_or(&[]);
        let cut = |needed: u64| Fault::Truncated {
            what: format!("the chunk of compressed points at byte {at}"),
            needed,
            found: rest.len() as u64,
        };
        if rest.len() < head_bytes {
            return Err(cut(head_bytes as u64));
        }
        let sizes = rest[header.record_bytes + 4..head_bytes].chunks_exact(4);
        let layers: u64 = sizes.map(|b| u64::from(u32_at(b, 0))).sum();
        let whole = head_bytes as u64 + layers;
        if whole > rest.len() as u64 {
            return Err(cut(whole));
        }
        let stored = u64::from(u32_at(rest, header.record_bytes));
        let is_variable = matches!(chunk_size, 0 | u32::MAX);
        let count = if is_variable {
            stored
        } else {
            u64::from(chunk_size)
        }
        .min(left);
        if count == 0 {
            return Err(Fault::Damaged {
                what: format!("the chunk of compressed points at byte {at} is empty"),
            });
        }
        let mut decoder = LayeredPointRecordDecompressor::new(Cursor::new(&rest[..whole as usize]));
        guard::decode("decoder of LAZ", || {
            decoder.set_fields_from(vlr.items()).map_err(|e| Fault::Damaged {
                what: format!("its compression is not known: {e}"),
            })
        })?;
        if decoder.record_size() != header.record_bytes {
            return Err(Fault::Damaged {
                what: format!(
                    "compressed points of {} bytes, {} expected",
                    decoder.record_size(),
                    header.record_bytes
                ),
            });
        }
        batches(count, header, budget, |out| decoder.decompress_many(out), each)?;
        left -= count;
        at += whole as usize;
    }
    Ok(())
}
