//! The header of a LAS file and its records, every promise checked against the bytes there are.

use glam::DVec3;

use crate::Fault;
use crate::error::excerpt;

/// Bytes of a record of each point format [ASPRS, LAS Specification 1.4-R15, tables 5 to 16].
const LEAST_RECORD: [u16; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];
/// Bytes of the header up to 1.2, and of 1.4.
const HEADER_1_0: usize = 227;
const HEADER_1_4: usize = 375;
/// Bytes of a record's head: a variable length one, and an extended one at the end of the file.
const VLR_HEAD: usize = 54;
const EVLR_HEAD: usize = 60;

#[derive(Debug)]
pub(in crate::points) struct Header<'a> {
    /// Point format, 0 to 10.
    pub format: u8,
    pub is_compressed: bool,
    /// Bytes of a point.
    pub record_bytes: usize,
    pub point_count: u64,
    /// Byte at which the points start.
    pub points_at: usize,
    pub scale: DVec3,
    pub offset: DVec3,
    pub records: Vec<Record<'a>>,
}

/// Something else that the file says.
#[derive(Clone, Copy, Debug)]
pub(in crate::points) struct Record<'a> {
    pub user: &'a [u8],
    pub id: u16,
    pub data: &'a [u8],
}

pub(in crate::points) fn u16_at(b: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([b[at], b[at + 1]])
}

pub(in crate::points) fn u32_at(b: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(b[at..at + 4].try_into().expect("four bytes"))
}

pub(in crate::points) fn u64_at(b: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(b[at..at + 8].try_into().expect("eight bytes"))
}

fn cut(what: impl Into<String>, needed: u64, found: usize) -> Fault {
    Fault::Truncated {
        what: what.into(),
        needed,
        found: found as u64,
    }
}

pub(in crate::points) fn read(bytes: &[u8]) -> Result<Header<'_>, Fault> {
    if !bytes.starts_with(b"LASF") {
        return Err(Fault::Value {
            what: "the start of the file",
            value: excerpt(&bytes[..bytes.len().min(4)]),
            remedy: "a LAS file starts with LASF",
        });
    }
    if bytes.len() < HEADER_1_0 {
        return Err(cut("the header", HEADER_1_0 as u64, bytes.len()));
    }
    let version = (bytes[24], bytes[25]);
    let is_1_4 = version.0 == 1 && version.1 >= 4;
    if version.0 != 1 || version.1 > 5 {
        return Err(Fault::Value {
            what: "the version of LAS",
            value: format!("{}.{}", version.0, version.1),
            remedy: "1.0 to 1.5 are read",
        });
    }
    let header_bytes = usize::from(u16_at(bytes, 94));
    let least = if is_1_4 { HEADER_1_4 } else { HEADER_1_0 };
    if header_bytes < least || header_bytes > bytes.len() {
        return Err(cut("the header", header_bytes.max(least) as u64, bytes.len()));
    }
    let (format, record_bytes) = (bytes[104] & 0x3f, u16_at(bytes, 105));
    let Some(needed) = LEAST_RECORD.get(usize::from(format)) else {
        return Err(Fault::Value {
            what: "the point format",
            value: format.to_string(),
            remedy: "0 to 10 are read",
        });
    };
    if record_bytes < *needed {
        return Err(Fault::Damaged {
            what: format!("points of format {format} take {needed} bytes, the header says {record_bytes}"),
        });
    }
    let legacy_count = u64::from(u32_at(bytes, 107));
    let point_count = match is_1_4.then(|| u64_at(bytes, 247)) {
        Some(n) if n > 0 => n,
        _ => legacy_count,
    };
    let points_at = u32_at(bytes, 96) as usize;
    if points_at < header_bytes || points_at > bytes.len() {
        return Err(cut(
            "the part before the points",
            points_at.max(header_bytes) as u64,
            bytes.len(),
        ));
    }
    let is_compressed = bytes[104] & 0xc0 != 0;
    let points_bytes = point_count.saturating_mul(u64::from(record_bytes));
    if !is_compressed && points_bytes > (bytes.len() - points_at) as u64 {
        let what = format!("{point_count} points of {record_bytes} bytes");
        return Err(cut(what, points_bytes, bytes.len() - points_at));
    }
    let three = |at: usize| {
        let x = |i: usize| f64::from_bits(u64_at(bytes, at + 8 * i));
        DVec3::new(x(0), x(1), x(2))
    };
    let mut header = Header {
        format,
        is_compressed,
        record_bytes: usize::from(record_bytes),
        point_count,
        points_at,
        scale: three(131),
        offset: three(155),
        records: Vec::new(),
    };
    if !header.scale.is_finite() || !header.offset.is_finite() || header.scale.min_element() <= 0.0 {
        return Err(Fault::Value {
            what: "the scale or offset of the coordinates",
            value: format!("{} and {}", header.scale, header.offset),
            remedy: "scales are positive numbers; write the file again",
        });
    }
    read_records(
        &bytes[header_bytes..points_at],
        u64::from(u32_at(bytes, 100)),
        VLR_HEAD,
        &mut header.records,
    )?;
    if is_1_4 && u32_at(bytes, 243) > 0 {
        let (start, count) = (u64_at(bytes, 235), u64::from(u32_at(bytes, 243)));
        let tail = usize::try_from(start).ok().and_then(|s| bytes.get(s..));
        let tail = tail.ok_or_else(|| cut("the records after the points", start, bytes.len()))?;
        read_records(tail, count, EVLR_HEAD, &mut header.records)?;
    }
    Ok(header)
}

/// Reads `count` records with heads of `head` bytes.
fn read_records<'a>(
    bytes: &'a [u8],
    count: u64,
    head: usize,
    out: &mut Vec<Record<'a>>,
) -> Result<(), Fault> {
    let mut rest = bytes;
    for i in 0..count {
        if rest.len() < head {
            return Err(cut(format!("record {i} of {count}"), head as u64, rest.len()));
        }
        let length = if head == VLR_HEAD {
            u64::from(u16_at(rest, 20))
        } else {
            u64_at(rest, 20)
        };
        let body = &rest[head..];
        let data = usize::try_from(length).ok().and_then(|n| body.get(..n));
        let data = data.ok_or_else(|| cut(format!("record {i} of {count}"), length, body.len()))?;
        let user = rest[2..18].split(|b| *b == 0).next().unwrap_or(b"");
        // Nobody writes more that matters; the list grows with the file at most.
        out.push(Record {
            user,
            id: u16_at(rest, 18),
            data,
        });
        rest = &body[data.len()..];
    }
    Ok(())
}

impl<'a> Header<'a> {
    pub fn record(&self, user: &str, id: u16) -> Option<&'a [u8]> {
        let found = self
            .records
            .iter()
            .find(|r| r.id == id && r.user.eq_ignore_ascii_case(user.as_bytes()));
        found.map(|r| r.data)
    }

    /// Whether a point is marked as deleted.
    pub fn is_withheld(&self, point: &[u8]) -> bool {
        point[15] & if self.format < 6 { 0x80 } else { 0x04 } != 0
    }

    /// The extra bytes that the file names, as far as their sizes are known and a point holds them.
    fn entries(&self) -> Vec<Extra> {
        let mut at = usize::from(LEAST_RECORD[usize::from(self.format)]);
        let mut found = Vec::new();
        for entry in self.record("LASF_Spec", 4).unwrap_or_default().chunks_exact(192) {
            let size = match entry[2] {
                0 => usize::from(entry[3]),
                1 | 2 => 1,
                3 | 4 => 2,
                5 | 6 | 9 => 4,
                7 | 8 | 10 => 8,
                // Deprecated pairs and triples.
                _ => break,
            };
            let name = entry[4..36].split(|b| *b == 0).next().unwrap_or(b"");
            if at + size > self.record_bytes {
                break;
            }
            found.push(Extra {
                name: String::from_utf8_lossy(name).into_owned(),
                kind: entry[2],
                at,
                size,
            });
            at += size;
        }
        found
    }

    /// The extra bytes that are no normal.
    pub fn extra_bytes(&self) -> Vec<Extra> {
        let normal = self.normal_columns();
        let is_normal = |e: &Extra| normal.is_some_and(|n| n.iter().any(|(at, _)| *at == e.at));
        let mut entries = self.entries();
        entries.retain(|e| !is_normal(e));
        entries
    }

    /// Where the components of a normal stand in a point, if it has any: 4-byte floats or 8-byte ones.
    pub fn normal_columns(&self) -> Option<[(usize, bool); 3]> {
        const NAMES: [[&str; 3]; 3] = [
            ["normalx", "normal_x", "nx"],
            ["normaly", "normal_y", "ny"],
            ["normalz", "normal_z", "nz"],
        ];
        let mut found = [None; 3];
        for entry in self.entries() {
            let name = entry.name.to_ascii_lowercase();
            if let (9 | 10, Some(axis)) = (entry.kind, NAMES.iter().position(|n| n.contains(&&name[..]))) {
                found[axis] = Some((entry.at, entry.kind == 10));
            }
        }
        let [x, y, z] = found;
        Some([x?, y?, z?])
    }
}

/// A number that a point holds beyond its format.
pub(in crate::points) struct Extra {
    pub name: String,
    /// Type of the number [ASPRS, LAS Specification 1.4-R15, table 24].
    kind: u8,
    /// First byte in a point, and how many.
    pub at: usize,
    pub size: usize,
}
