use super::{CloudChanges, Placed, text_rows, words};
use crate::Fault;
use crate::points::ply::header::{self, Element, Encoding, Header, Scalar, Shape};

/// Names of what is written of a point.
const NAMES: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];

/// Whether rows of this element may name vertices by number: by a list, by a whole number called after a vertex, as the
/// `vertex1` and `vertex2` of an edge, or by those of an edge under any name.
fn names_vertices(element: &Element) -> bool {
    element.properties.iter().any(|p| match p.shape {
        Shape::List { .. } => true,
        Shape::One(Scalar::F32 | Scalar::F64) => false,
        Shape::One(_) => p.name.starts_with("vertex") || element.name == "edge",
    })
}

/// The bytes of the file with its changes.
pub fn revised(bytes: &[u8], changes: &CloudChanges) -> Result<Vec<u8>, Fault> {
    let header = header::read(bytes)?;
    let not = |what, value: String, remedy| Err(Fault::Value { what, value, remedy });
    let Some((vertex, others)) = header.elements.split_first().filter(|(v, _)| v.name == "vertex") else {
        return not(
            "the first element of the file",
            "no vertex".into(),
            "convert the scan by isoclay convert and fit that",
        );
    };
    let counts_change = !changes.removed.is_empty() || !changes.added.is_empty();
    let naming = others.iter().filter(|e| e.count > 0 && names_vertices(e));
    let names: Vec<_> = naming.map(|e| e.name.as_str()).collect();
    if counts_change && !names.is_empty() {
        return not(
            "what names the vertices by number",
            names.join(", "),
            "points come or go; write the vertices alone into a file and fit that",
        );
    }
    let columns = Columns::of(vertex)?;
    let mut out = Vec::with_capacity(bytes.len());
    let count = vertex.count as usize - changes.removed.len() + changes.added.len();
    put_header(&bytes[..header.body], count, &mut out);
    let body = &bytes[header.body..];
    match header.encoding {
        Encoding::Ascii => ascii(body, vertex, &columns, changes, &mut out),
        _ => binary(body, &header, vertex, &columns, changes, &mut out)?,
    }
    Ok(out)
}

/// Place and type of the numbers of a point among the properties; a normal is there as a whole or not at all.
struct Columns(Vec<(usize, Scalar)>);

impl Columns {
    fn of(vertex: &Element) -> Result<Self, Fault> {
        let column = |name: &&str| {
            let at = vertex.find(name)?;
            match vertex.properties[at].shape {
                Shape::One(scalar @ (Scalar::F32 | Scalar::F64)) => Some((at, scalar)),
                _ => None,
            }
        };
        let of = |names: &[&str]| names.iter().map(column).collect::<Option<Vec<_>>>();
        let mut found = of(&NAMES[..3]).ok_or_else(|| Fault::Value {
            what: "the type of the coordinates",
            value: "a whole number".into(),
            remedy: "edited points need float or double; convert the scan by isoclay convert and fit that",
        })?;
        found.extend(of(&NAMES[3..]).unwrap_or_default());
        Ok(Self(found))
    }

    fn numbers(&self, placed: &Placed) -> impl Iterator<Item = (usize, Scalar, f64)> {
        let all = [placed.position, placed.normal].map(|v| v.to_array());
        let all = all.into_iter().flatten();
        self.0
            .iter()
            .zip(all)
            .map(|((at, scalar), value)| (*at, *scalar, value))
    }
}

/// The header with another number of vertices.
fn put_header(header: &[u8], count: usize, out: &mut Vec<u8>) {
    for line in header.split_inclusive(|c| *c == b'\n') {
        let mut parts = line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
        match (parts.next(), parts.next()) {
            (Some(b"element"), Some(b"vertex")) => {
                let end = if line.ends_with(b"\r\n") { "\r\n" } else { "\n" };
                out.extend_from_slice(format!("element vertex {count}{end}").as_bytes());
            }
            _ => out.extend_from_slice(line),
        }
    }
}

fn ascii(body: &[u8], vertex: &Element, columns: &Columns, changes: &CloudChanges, out: &mut Vec<u8>) {
    let placed_line = |line: &[u8], placed: &Placed| {
        let new: Vec<_> = columns
            .numbers(placed)
            .map(|(at, scalar, value)| match scalar {
                Scalar::F32 => (at, f64::from(value as f32)),
                _ => (at, value),
            })
            .collect();
        words(line, |c| c.is_ascii_whitespace(), &new, ".")
    };
    text_rows(body, vertex.count, changes, placed_line, out);
}

fn binary(
    body: &[u8],
    header: &Header,
    vertex: &Element,
    columns: &Columns,
    changes: &CloudChanges,
    out: &mut Vec<u8>,
) -> Result<(), Fault> {
    let stride = vertex.fixed_stride().ok_or_else(|| Fault::Value {
        what: "the properties of the points",
        value: "a list".into(),
        remedy: "points with lists are not written back; convert the scan by isoclay convert and fit that",
    })?;
    let length = stride * vertex.count as usize;
    let (points, rest) = body.split_at_checked(length).ok_or_else(|| Fault::Truncated {
        what: "the points".into(),
        needed: length as u64,
        found: body.len() as u64,
    })?;
    let size = |shape: &Shape| match shape {
        Shape::One(scalar) => scalar.size(),
        Shape::List { .. } => 0,
    };
    let offset = |at: usize| {
        vertex.properties[..at]
            .iter()
            .map(|p| size(&p.shape))
            .sum::<usize>()
    };
    let is_big = header.encoding == Encoding::Big;
    let placed_row = |row: &[u8], placed: &Placed| {
        let mut row = row.to_vec();
        for (at, scalar, value) in columns.numbers(placed) {
            let mut number = match scalar {
                Scalar::F32 => (value as f32).to_le_bytes().to_vec(),
                _ => value.to_le_bytes().to_vec(),
            };
            if is_big {
                number.reverse();
            }
            row[offset(at)..][..number.len()].copy_from_slice(&number);
        }
        row
    };
    super::binary_rows(points, stride, changes, placed_row, out);
    out.extend_from_slice(rest);
    Ok(())
}
