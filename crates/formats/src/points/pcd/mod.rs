//! PCD in and out, the format of the Point Cloud Library: ascii, binary and compressed rows.
//!
//! An own reader: crate pcd-rs names no licence that can be checked, and allocates what a header promises.

pub(super) mod header;
pub(super) mod lzf;

use std::io::{self, Write};

use glam::DVec3;

use self::header::{Column, Encoding, Header};
use super::cloud::PointCloud;
use super::normals;
use crate::limits::{Budget, Counted};
use crate::raw::RawShape;
use crate::text::{Lines, number};
use crate::{Fault, ReadLimits};

/// Reads the text or bytes of a PCD file.
///
/// Taken are `x y z` and `normal_x normal_y normal_z` of any type; points that are not finite (holes of an
/// organised cloud) are left out and counted. The viewpoint moves nothing, as in the library.
///
/// # Errors
/// A [`Fault`] with the line for a broken header or row, a count beyond the bytes there are, a compressed part
/// that does not hold, or no usable point.
pub fn parse_pcd(bytes: &[u8], limits: &ReadLimits) -> Result<PointCloud, Fault> {
    let mut budget = Budget::new(limits);
    normals::finish(parse(bytes, &mut budget)?, &mut budget)
}

pub(crate) fn looks_like_pcd(head: &[u8]) -> bool {
    head.starts_with(b"# .PCD")
        || head.starts_with(b"VERSION ") && memchr::memmem::find(head, b"FIELDS ").is_some()
}

pub(super) fn parse(bytes: &[u8], budget: &mut Budget) -> Result<RawShape, Fault> {
    if bytes.is_empty() {
        return Err(Fault::Empty);
    }
    let mut header = header::read(bytes)?;
    let mut raw = RawShape {
        notes: std::mem::take(&mut header.notes),
        left_out_attributes: std::mem::take(&mut header.others),
        ..Default::default()
    };
    let body = &bytes[header.body..];
    match header.encoding {
        Encoding::Ascii => ascii(body, &header, budget, &mut raw)?,
        Encoding::Binary => {
            let needed = reserve(&header, body.len() as u64, budget)?;
            let rows = &body[..needed];
            let place = |c: &Column, row: usize| c.offset + row * header.stride;
            columns(rows, &header, place, &mut raw);
        }
        Encoding::Compressed => {
            let whole = unpack(body, &header, budget)?;
            // All values of the first field, then all of the second, and so on.
            let place = |c: &Column, row: usize| c.offset * header.points as usize + row * c.kind.size();
            columns(&whole, &header, place, &mut raw);
        }
    }
    Ok(raw)
}

/// Books the points of rows in bytes; the bytes the rows take, which are no more than `available`.
fn reserve(header: &Header, available: u64, budget: &mut Budget) -> Result<usize, Fault> {
    let needed = header.points.saturating_mul(header.stride as u64);
    if needed > available {
        return Err(Fault::Truncated {
            what: format!("the rows of {} points of {} bytes", header.points, header.stride),
            needed,
            found: available,
        });
    }
    budget.reserve(
        "points",
        header.points,
        size_of::<DVec3>() * header.columns.len() / 3,
    )?;
    Ok(needed as usize)
}

fn columns(bytes: &[u8], header: &Header, place: impl Fn(&Column, usize) -> usize, raw: &mut RawShape) {
    let rows = header.points as usize;
    let gather = |columns: &[Column], row: usize| {
        let at = |c: &Column| c.kind.decode(&bytes[place(c, row)..]);
        DVec3::new(at(&columns[0]), at(&columns[1]), at(&columns[2]))
    };
    raw.positions = (0..rows).map(|row| gather(&header.columns[..3], row)).collect();
    let normal = header.columns.get(3..6);
    raw.normals = normal.map(|c| (0..rows).map(|row| gather(c, row)).collect());
}

pub(super) fn unpack(body: &[u8], header: &Header, budget: &mut Budget) -> Result<Vec<u8>, Fault> {
    let size = |at: usize| {
        let b = body.get(at..at + 4).ok_or(Fault::Truncated {
            what: "the sizes of the compressed rows".into(),
            needed: 8,
            found: body.len() as u64,
        })?;
        Ok(u64::from(u32::from_le_bytes(b.try_into().expect("four bytes"))))
    };
    let (packed, whole) = (size(0)?, size(4)?);
    let needed = header.points.saturating_mul(header.stride as u64);
    if whole != needed || packed.saturating_mul(lzf::MAX_RATIO) < whole {
        return Err(Fault::Damaged {
            what: format!(
                "{packed} compressed bytes are to become {whole}, {} points of {} bytes need {needed}",
                header.points, header.stride
            ),
        });
    }
    let stream = body[8..].get(..packed as usize).ok_or(Fault::Truncated {
        what: "the compressed rows".into(),
        needed: packed,
        found: body.len() as u64 - 8,
    })?;
    budget.reserve("the rows, inflated", whole, 1)?;
    reserve(header, whole, budget)?;
    let mut out = vec![0; whole as usize];
    lzf::unpack(stream, &mut out)?;
    Ok(out)
}

fn ascii(body: &[u8], header: &Header, budget: &mut Budget, raw: &mut RawShape) -> Result<(), Fault> {
    let mut positions = Counted::new("points");
    let mut normals = Counted::new("normals");
    let mut row: Vec<&[u8]> = Vec::new();
    let mut lines = Lines::new(body);
    while (positions.items.len() as u64) < header.points {
        let line = header.line + lines.line;
        let Some(text) = lines.next() else {
            return Err(Fault::Truncated {
                what: format!("the rows of {} points (in lines, not bytes)", header.points),
                needed: header.points,
                found: positions.items.len() as u64,
            });
        };
        row.clear();
        row.extend(
            text.split(u8::is_ascii_whitespace)
                .filter(|w| !w.is_empty())
                .take(header.words + 1),
        );
        if row.is_empty() {
            continue;
        }
        if row.len() != header.words {
            let found = if row.len() > header.words { "more" } else { "fewer" };
            return Err(Fault::line(
                line,
                format!("{found} than {} words", header.words),
                "each line holds the words that FIELDS and COUNT ask for",
            ));
        }
        let three = |c: &[Column]| -> Result<DVec3, Fault> {
            let at = |i: usize| number(row[c[i].word], line);
            Ok(DVec3::new(at(0)?, at(1)?, at(2)?))
        };
        positions.push(three(&header.columns[..3])?, budget)?;
        if let Some(c) = header.columns.get(3..6) {
            normals.push(three(c)?, budget)?;
        }
    }
    raw.positions = positions.items;
    raw.normals = (header.columns.len() == 6).then_some(normals.items);
    Ok(())
}

/// Writes binary rows: doubles if `double`, and normals as floats.
pub(super) fn write(out: &mut dyn Write, cloud: &PointCloud, double: bool) -> io::Result<()> {
    let count = cloud.positions.len();
    let n = if double { 8 } else { 4 };
    let (fields, sizes, kinds, counts) = match &cloud.normals {
        Some(_) => (" normal_x normal_y normal_z", " 4 4 4", " F F F", " 1 1 1"),
        None => ("", "", "", ""),
    };
    write!(
        out,
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z{fields}\nSIZE {n} {n} {n}{sizes}\n\
         TYPE F F F{kinds}\nCOUNT 1 1 1{counts}\nWIDTH {count}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\n\
         DATA binary\n"
    )?;
    for (i, p) in cloud.positions.iter().enumerate() {
        for x in p.to_array() {
            if double {
                out.write_all(&x.to_le_bytes())?;
            } else {
                out.write_all(&(x as f32).to_le_bytes())?;
            }
        }
        if let Some(normals) = &cloud.normals {
            for x in normals[i].to_array() {
                out.write_all(&(x as f32).to_le_bytes())?;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
