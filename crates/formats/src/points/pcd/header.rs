//! The header of a PCD file: which bytes or columns of a row are what.

use crate::Fault;
use crate::error::excerpt;
use crate::text::{Lines, integer};

/// Type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::points) enum Scalar {
    F4,
    F8,
    I(u8),
    U(u8),
}

impl Scalar {
    /// The number in `b`, little-endian. Whole numbers of eight bytes lose what an `f64` cannot hold.
    pub fn decode(self, b: &[u8]) -> f64 {
        let mut wide = [0; 8];
        let size = self.size();
        wide[..size].copy_from_slice(&b[..size]);
        let bits = u64::from_le_bytes(wide);
        let unused = 64 - 8 * size as u32;
        match self {
            Self::F4 => f64::from(f32::from_bits(bits as u32)),
            Self::F8 => f64::from_bits(bits),
            Self::U(_) => bits as f64,
            Self::I(_) => (((bits << unused) as i64) >> unused) as f64,
        }
    }

    pub fn size(self) -> usize {
        match self {
            Self::F4 => 4,
            Self::F8 => 8,
            Self::I(size) | Self::U(size) => usize::from(size),
        }
    }
}

/// One of x, y, z and the three of the normal.
#[derive(Clone, Copy, Debug)]
pub(in crate::points) struct Column {
    pub kind: Scalar,
    /// Bytes of a row before it.
    pub offset: usize,
    /// Words of a row before it.
    pub word: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::points) enum Encoding {
    Ascii,
    Binary,
    Compressed,
}

#[derive(Debug)]
pub(in crate::points) struct Header {
    pub encoding: Encoding,
    pub points: u64,
    /// `x y z`, and `normal_x normal_y normal_z` if there are all three.
    pub columns: Vec<Column>,
    /// Bytes and words of a row.
    pub stride: usize,
    pub words: usize,
    /// Bytes of each field.
    pub sizes: Vec<usize>,
    /// Byte at which the rows start, and the line of it.
    pub body: usize,
    pub line: u64,
    /// Names of the other fields.
    pub others: Vec<String>,
    pub notes: Vec<String>,
}

/// Fields of a position and a normal.
const NAMES: [&str; 6] = ["x", "y", "z", "normal_x", "normal_y", "normal_z"];
const FIELDS_REMEDY: &str = "FIELDS, SIZE, TYPE and COUNT have one word for each field";

pub(in crate::points) fn read(bytes: &[u8]) -> Result<Header, Fault> {
    let mut fields: Vec<String> = Vec::new();
    // Sizes, types and counts, each with its line.
    let mut entries: [Option<(u64, Vec<&[u8]>)>; 3] = [None, None, None];
    let (mut width, mut height, mut points) = (None, None, None);
    let mut notes = Vec::new();
    let mut lines = Lines::new(bytes);
    while let Some(text) = lines.next() {
        let line = lines.line;
        let bad = |remedy| Fault::line(line, format!("cannot use {}", excerpt(text)), remedy);
        let mut words = text.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
        let Some(key) = words.next().filter(|w| !w.starts_with(b"#")) else {
            continue;
        };
        let rest: Vec<&[u8]> = words.collect();
        let count = || match rest[..] {
            [n] => integer(n)
                .and_then(|n| u64::try_from(n).ok())
                .ok_or_else(|| bad("here stands one whole number")),
            _ => Err(bad("here stands one whole number")),
        };
        match key {
            b"VERSION" => {}
            b"FIELDS" | b"COLUMNS" => {
                fields = rest
                    .iter()
                    .map(|w| String::from_utf8_lossy(w).into_owned())
                    .collect();
            }
            b"SIZE" => entries[0] = Some((line, rest)),
            b"TYPE" => entries[1] = Some((line, rest)),
            b"COUNT" => entries[2] = Some((line, rest)),
            b"WIDTH" => width = Some(count()?),
            b"HEIGHT" => height = Some(count()?),
            b"POINTS" => points = Some(count()?),
            b"VIEWPOINT" => {
                let pose: Vec<_> = rest
                    .iter()
                    .map(|w| fast_float2::parse(w).unwrap_or(f64::NAN))
                    .collect();
                if pose != [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0] {
                    notes.push(format!(
                        "the viewpoint is {}; the points were not moved by it",
                        excerpt(text.strip_prefix(b"VIEWPOINT").unwrap_or(text).trim_ascii())
                    ));
                }
            }
            b"DATA" => {
                let encoding = match rest[..] {
                    [b"ascii"] => Encoding::Ascii,
                    [b"binary"] => Encoding::Binary,
                    [b"binary_compressed"] => Encoding::Compressed,
                    _ => return Err(bad("known are ascii, binary and binary_compressed")),
                };
                let product = width.unwrap_or(0).checked_mul(height.unwrap_or(1));
                let points = match (points, width.and(product)) {
                    (Some(n), None) | (None, Some(n)) => n,
                    (Some(n), Some(product)) if n == product => n,
                    _ => return Err(bad("before it stand WIDTH, HEIGHT and POINTS, their product")),
                };
                let mut sizes = Vec::new();
                let layout = layout(&fields, &entries, &mut sizes)?;
                let taken = &NAMES[..layout.0.len()];
                let is_taken = |f: &str| taken.iter().any(|n| n.eq_ignore_ascii_case(f));
                // Fields of that name are room between others.
                fields.retain(|f| f != "_" && !is_taken(f));
                return Ok(Header {
                    encoding,
                    points,
                    columns: layout.0,
                    stride: layout.1,
                    words: layout.2,
                    sizes,
                    body: bytes.len() - lines.left(),
                    line: line + 1,
                    others: fields,
                    notes,
                });
            }
            _ => {
                return Err(bad(
                    "a header holds VERSION, FIELDS, SIZE, TYPE, COUNT, WIDTH, HEIGHT, VIEWPOINT, POINTS and DATA",
                ));
            }
        }
    }
    Err(Fault::Truncated {
        what: "the header (up to \"DATA\")".into(),
        needed: bytes.len() as u64 + 1,
        found: bytes.len() as u64,
    })
}

/// The wanted columns, and the bytes and words of a row; the bytes of each field go to `sizes`.
fn layout(
    fields: &[String],
    entries: &[Option<(u64, Vec<&[u8]>)>; 3],
    sizes: &mut Vec<usize>,
) -> Result<(Vec<Column>, usize, usize), Fault> {
    let mut found = [None; 6];
    let (mut stride, mut words) = (0usize, 0usize);
    // Files older than the three lines hold floats.
    let word = |entry: usize, field: usize, default: &'static [u8]| match &entries[entry] {
        None => Ok((0, default)),
        Some((line, list)) if list.len() == fields.len() => Ok((*line, list[field])),
        Some((line, list)) => Err(Fault::line(
            *line,
            format!("{} words for {} fields", list.len(), fields.len()),
            FIELDS_REMEDY,
        )),
    };
    for (i, name) in fields.iter().enumerate() {
        let ((line, size), (_, kind), (count_line, count)) =
            (word(0, i, b"4")?, word(1, i, b"F")?, word(2, i, b"1")?);
        let kind = match (kind, size) {
            (b"F", b"4") => Scalar::F4,
            (b"F", b"8") => Scalar::F8,
            (b"I", b"1" | b"2" | b"4" | b"8") => Scalar::I(size[0] - b'0'),
            (b"U", b"1" | b"2" | b"4" | b"8") => Scalar::U(size[0] - b'0'),
            _ => {
                let what = format!("type {} of {} bytes", excerpt(kind), excerpt(size));
                return Err(Fault::line(
                    line,
                    what,
                    "known are F of 4 and 8, I and U of 1, 2, 4 and 8",
                ));
            }
        };
        let count = integer(count)
            .and_then(|n| u16::try_from(n).ok())
            .ok_or_else(|| {
                Fault::line(
                    count_line,
                    format!("count {}", excerpt(count)),
                    "a count is a whole number below 65536",
                )
            })?;
        if let (Some(slot), 1) = (NAMES.iter().position(|n| n.eq_ignore_ascii_case(name)), count) {
            found[slot] = found[slot].or(Some(Column {
                kind,
                offset: stride,
                word: words,
            }));
        }
        sizes.push(kind.size() * usize::from(count));
        stride += kind.size() * usize::from(count);
        words += usize::from(count);
    }
    if found[..3].iter().any(Option::is_none) {
        let list: Vec<_> = fields.iter().take(12).map(|f| excerpt(f.as_bytes())).collect();
        return Err(Fault::Value {
            what: "the list of fields",
            value: format!("[{}]", list.join(", ")),
            remedy: "a point cloud needs x, y and z",
        });
    }
    let wanted = if found.iter().all(Option::is_some) { 6 } else { 3 };
    Ok((found[..wanted].iter().flatten().copied().collect(), stride, words))
}
