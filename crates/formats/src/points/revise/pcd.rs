use super::{CloudChanges, Placed, text_rows, words};
use crate::limits::Budget;
use crate::points::pcd::header::{self, Column, Encoding, Header, Scalar};
use crate::points::pcd::{lzf, unpack};
use crate::{Fault, ReadLimits};

/// The bytes of the file with its changes.
pub fn revised(bytes: &[u8], changes: &CloudChanges) -> Result<Vec<u8>, Fault> {
    let header = header::read(bytes)?;
    if header
        .columns
        .iter()
        .any(|c| !matches!(c.kind, Scalar::F4 | Scalar::F8))
    {
        return Err(Fault::Value {
            what: "the type of the coordinates",
            value: "a whole number".into(),
            remedy: "edited points need type F; convert the scan by isoclay convert and fit that",
        });
    }
    let count = header.points as usize - changes.removed.len() + changes.added.len();
    let mut out = Vec::with_capacity(bytes.len());
    put_header(&bytes[..header.body], count, &mut out)?;
    let body = &bytes[header.body..];
    match header.encoding {
        Encoding::Ascii => ascii(body, &header, changes, &mut out),
        Encoding::Binary => {
            let end = header.points as usize * header.stride;
            let (points, rest) = body.split_at_checked(end).ok_or_else(|| Fault::Truncated {
                what: "the rows".into(),
                needed: end as u64,
                found: body.len() as u64,
            })?;
            rows(points, &header, changes, &mut out);
            out.extend_from_slice(rest);
        }
        Encoding::Compressed => {
            let whole = unpack(body, &header, &mut Budget::new(&ReadLimits::default()))?;
            let mut new = Vec::with_capacity(whole.len());
            rows(
                &turned(&whole, &header, header.points as usize, false),
                &header,
                changes,
                &mut new,
            );
            let packed = lzf::stored(&turned(&new, &header, count, true));
            for size in [packed.len(), new.len()] {
                out.extend_from_slice(&(size as u32).to_le_bytes());
            }
            out.extend(packed);
        }
    }
    Ok(out)
}

/// The header with another number of points.
fn put_header(header: &[u8], count: usize, out: &mut Vec<u8>) -> Result<(), Fault> {
    for line in header.split_inclusive(|c| *c == b'\n') {
        let mut parts = line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
        let (key, value) = (parts.next(), parts.next().map(String::from_utf8_lossy));
        let is = |n: usize| value.as_ref().is_some_and(|v| **v == n.to_string());
        match key {
            Some(b"HEIGHT") if !is(1) && !is(count) => {
                return Err(Fault::Value {
                    what: "the height of the cloud",
                    value: value.unwrap_or_default().into_owned(),
                    remedy: "rows of points in a raster are not written back; convert the scan by isoclay convert and fit that",
                });
            }
            Some(key @ (b"WIDTH" | b"POINTS")) if !is(count) => {
                let end = if line.ends_with(b"\r\n") { "\r\n" } else { "\n" };
                out.extend_from_slice(key);
                out.extend_from_slice(format!(" {count}{end}").as_bytes());
            }
            _ => out.extend_from_slice(line),
        }
    }
    Ok(())
}

fn numbers<'a>(header: &'a Header, placed: &Placed) -> impl Iterator<Item = (&'a Column, f64)> {
    let all = [placed.position, placed.normal].map(|v| v.to_array());
    header.columns.iter().zip(all.into_iter().flatten())
}

fn ascii(body: &[u8], header: &Header, changes: &CloudChanges, out: &mut Vec<u8>) {
    let placed_line = |line: &[u8], placed: &Placed| {
        let new: Vec<_> = numbers(header, placed)
            .map(|(column, value)| match column.kind {
                Scalar::F4 => (column.word, f64::from(value as f32)),
                _ => (column.word, value),
            })
            .collect();
        words(line, |c| c.is_ascii_whitespace(), &new, ".")
    };
    text_rows(body, header.points, changes, placed_line, out);
}

/// Rows of bytes with their changes.
fn rows(points: &[u8], header: &Header, changes: &CloudChanges, out: &mut Vec<u8>) {
    let placed_row = |row: &[u8], placed: &Placed| {
        let mut row = row.to_vec();
        for (column, value) in numbers(header, placed) {
            let to = &mut row[column.offset..][..column.kind.size()];
            match column.kind {
                Scalar::F4 => to.copy_from_slice(&(value as f32).to_le_bytes()),
                _ => to.copy_from_slice(&value.to_le_bytes()),
            }
        }
        row
    };
    super::binary_rows(points, header.stride, changes, placed_row, out);
}

/// All values of the first field, then all of the second, made rows, or (`back`) the other way round.
fn turned(bytes: &[u8], header: &Header, count: usize, back: bool) -> Vec<u8> {
    let mut out = vec![0; bytes.len()];
    let mut start = 0;
    for size in &header.sizes {
        for row in 0..count {
            let (column, place) = (start * count + row * size, row * header.stride + start);
            let (from, to) = if back { (place, column) } else { (column, place) };
            out[to..to + size].copy_from_slice(&bytes[from..from + size]);
        }
        start += size;
    }
    out
}
