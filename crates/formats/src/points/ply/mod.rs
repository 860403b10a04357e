//! PLY in and out. Read are ascii and both binary encodings, any types and order of properties, extra ones skipped.

mod body;
pub(super) mod header;
mod write;

use glam::DVec3;

use self::body::{Binary, Values, check_count, walk};
use self::header::{Element, Encoding, Header, Scalar, Shape};
use super::cloud::PointCloud;
use super::normals;
use crate::error::Place;
use crate::limits::Budget;
use crate::raw::{Faces, RawShape, Wanted};
use crate::text::Words;
use crate::{Fault, ReadLimits};

pub use write::save_points;
pub(crate) use write::{write, write_points};

/// Reads the text or bytes of a PLY file.
///
/// Taken are `x y z`, `nx ny nz` of element `vertex`, the lists `vertex_indices` or `vertex_index` of `face`, and
/// `tristrips`. Points that are not finite are left out and counted.
///
/// # Errors
/// A [`Fault`] with line, row or byte for a broken header, missing coordinates, a count beyond the bytes there
/// are, an index beyond the vertices, or no usable point.
pub fn parse_ply(bytes: &[u8], limits: &ReadLimits) -> Result<PointCloud, Fault> {
    let mut budget = Budget::new(limits);
    normals::finish(parse(bytes, Wanted::Cloud, &mut budget)?, &mut budget)
}

pub(crate) fn parse(bytes: &[u8], wanted: Wanted, budget: &mut Budget) -> Result<RawShape, Fault> {
    if bytes.is_empty() {
        return Err(Fault::Empty);
    }
    let header = header::read(bytes)?;
    let body = &bytes[header.body..];
    match header.encoding {
        Encoding::Ascii => read_elements(
            Words::new(body, header.lines + 1),
            &header,
            wanted,
            budget,
            Words::left,
            None,
        ),
        Encoding::Little => binary::<false>(body, &header, wanted, budget),
        Encoding::Big => binary::<true>(body, &header, wanted, budget),
    }
}

fn binary<const BIG: bool>(
    body: &[u8],
    header: &Header,
    wanted: Wanted,
    budget: &mut Budget,
) -> Result<RawShape, Fault> {
    let fast: Gather<Binary<'_, BIG>> = gather_vertices;
    read_elements(
        Binary::<BIG> { bytes: body, at: 0 },
        header,
        wanted,
        budget,
        |v| v.bytes.len() - v.at,
        Some(fast),
    )
}

/// A quick way through an element whose rows all have the same length.
type Gather<V> = fn(&mut V, &Element, &Columns, usize, &mut RawShape);

fn read_elements<V: Values>(
    mut values: V,
    header: &Header,
    wanted: Wanted,
    budget: &mut Budget,
    left: impl Fn(&V) -> usize,
    gather: Option<Gather<V>>,
) -> Result<RawShape, Fault> {
    let vertex = header
        .elements
        .iter()
        .find(|e| e.name == "vertex")
        .ok_or_else(|| Fault::Value {
            what: "the list of elements",
            value: names(&header.elements),
            remedy: "a point cloud needs an element \"vertex\"",
        })?;
    let columns = Columns::of(vertex, wanted)?;
    let mut raw = RawShape::default();
    if wanted == Wanted::Cloud {
        let unused = vertex
            .properties
            .iter()
            .zip(&columns.slots)
            .filter(|(_, s)| s.is_none());
        raw.left_out_attributes = unused.map(|(p, _)| p.name.clone()).collect();
    }
    let mut faces = Faces::new();
    for element in &header.elements {
        check_count(element, header, left(&values))?;
        let none = vec![None; element.properties.len()];
        match element.name.as_str() {
            "vertex" => {
                if element.count >= u64::from(u32::MAX) {
                    return Err(Fault::Value {
                        what: "the number of vertices",
                        value: element.count.to_string(),
                        remedy: "fewer than 4294967295 can be read; split the cloud",
                    });
                }
                let row = size_of::<DVec3>() * if columns.has_normals { 2 } else { 1 };
                let row = row + if columns.has_colors { 3 } else { 0 };
                budget.reserve("points", element.count, row)?;
                raw.positions.reserve_exact(element.count as usize);
                if columns.has_normals {
                    raw.normals = Some(Vec::with_capacity(element.count as usize));
                }
                if columns.has_colors {
                    raw.colors = Some(Vec::with_capacity(element.count as usize));
                }
                match (gather, element.fixed_stride()) {
                    (Some(gather), Some(stride)) if !columns.has_colors => {
                        gather(&mut values, element, &columns, stride, &mut raw)
                    }
                    _ => walk(
                        &mut values,
                        element,
                        &columns.slots,
                        None,
                        budget,
                        |_, v, _, _| {
                            raw.positions.push(DVec3::new(v[0], v[1], v[2]));
                            if let Some(n) = &mut raw.normals {
                                n.push(DVec3::new(v[3], v[4], v[5]));
                            }
                            if let Some(c) = &mut raw.colors {
                                c.push([v[6], v[7], v[8]].map(|x| (x * columns.color_scale).round() as u8));
                            }
                            Ok(())
                        },
                    )?,
                }
            }
            "face" => {
                let list = ["vertex_indices", "vertex_index"]
                    .iter()
                    .find_map(|n| element.find(n));
                let list = list.filter(|p| matches!(element.properties[*p].shape, Shape::List { .. }));
                if list.is_none() && element.count > 0 {
                    raw.notes.push(
                        "the element \"face\" has no list \"vertex_indices\"; faces were not used".into(),
                    );
                }
                walk(
                    &mut values,
                    element,
                    &none,
                    list,
                    budget,
                    |row, _, corners, budget| {
                        if list.is_some() {
                            check_corners(corners, vertex.count, "face", row)?;
                            faces.push(corners.iter().map(|v| *v as u32), budget)?;
                        }
                        Ok(())
                    },
                )?;
            }
            "tristrips" => {
                let list = ["vertex_indices", "vertex_index"]
                    .iter()
                    .find_map(|n| element.find(n));
                walk(
                    &mut values,
                    element,
                    &none,
                    list,
                    budget,
                    |row, _, strip, budget| {
                        for run in strip.split(|v| *v == -1.0) {
                            check_corners(run, vertex.count, "tristrips", row)?;
                            for i in 2..run.len() {
                                let (a, b) = if i % 2 == 0 {
                                    (i - 2, i - 1)
                                } else {
                                    (i - 1, i - 2)
                                };
                                let tri = [run[a], run[b], run[i]].map(|v| v as u32);
                                // A repeated corner is how a strip turns, not a broken face.
                                if tri[0] != tri[1] && tri[1] != tri[2] && tri[2] != tri[0] {
                                    faces.push(tri.into_iter(), budget)?;
                                }
                            }
                        }
                        Ok(())
                    },
                )?;
            }
            _ => walk(&mut values, element, &none, None, budget, |_, _, _, _| Ok(()))?,
        }
    }
    faces.finish(&mut raw);
    let rows = header.elements.iter().filter(|e| e.count > 0);
    let row = rows.map(|e| e.least_row(header.encoding)).max().unwrap_or(0);
    let behind = left(&values) as u64;
    // Some programs end files with a line end.
    if row > 0 && behind >= row {
        raw.notes.push(format!(
            "{behind} bytes behind the last row that the header tells of were not read; if they are rows, its counts are wrong"
        ));
    }
    Ok(raw)
}

fn names(elements: &[Element]) -> String {
    let all: Vec<_> = elements
        .iter()
        .take(8)
        .map(|e| e.name.chars().take(20).collect::<String>())
        .collect();
    format!("[{}]", all.join(", "))
}

fn check_corners(corners: &[f64], vertices: u64, element: &'static str, row: u64) -> Result<(), Fault> {
    match corners
        .iter()
        .find(|v| !(**v >= 0.0 && **v < vertices as f64 && v.fract() == 0.0))
    {
        None => Ok(()),
        Some(v) => Err(Fault::Syntax {
            place: Place::Row(element, row),
            what: format!("vertex index {v} with {vertices} vertices"),
            remedy: "indices run from 0 to one below the number of vertices; export the mesh again",
        }),
    }
}

fn gather_vertices<const BIG: bool>(
    values: &mut Binary<'_, BIG>,
    element: &Element,
    columns: &Columns,
    stride: usize,
    raw: &mut RawShape,
) {
    let rows = element.count as usize;
    let at = columns.at;
    match &mut raw.normals {
        None => values.gather(rows, stride, &[at[0], at[1], at[2]], |p| {
            raw.positions.push(p.into())
        }),
        Some(normals) => values.gather(rows, stride, &at, |v| {
            raw.positions.push(DVec3::new(v[0], v[1], v[2]));
            normals.push(DVec3::new(v[3], v[4], v[5]));
        }),
    }
}

/// Which properties of `vertex` are coordinates and normals.
struct Columns {
    /// For each property its place in `x y z nx ny nz red green blue`.
    slots: Vec<Option<usize>>,
    /// Byte offset and type of each of the six in a row without lists.
    at: [(usize, Scalar); 6],
    has_normals: bool,
    has_colors: bool,
    /// Of a stored colour to a byte.
    color_scale: f64,
}

impl Columns {
    fn of(vertex: &Element, wanted: Wanted) -> Result<Self, Fault> {
        let names = ["x", "y", "z", "nx", "ny", "nz", "red", "green", "blue"];
        let found = names.map(|name| {
            vertex.find(name).and_then(|p| match vertex.properties[p].shape {
                Shape::One(kind) => Some((p, kind)),
                Shape::List { .. } => None,
            })
        });
        if found[..3].iter().any(Option::is_none) {
            let names: Vec<_> = vertex
                .properties
                .iter()
                .take(12)
                .map(|p| p.name.chars().take(20).collect::<String>())
                .collect();
            return Err(Fault::Value {
                what: "the list of vertex properties",
                value: format!("[{}]", names.join(", ")),
                remedy: "a point cloud needs x, y and z",
            });
        }
        let has_all = |slots: &[Option<(usize, Scalar)>]| slots.iter().all(Option::is_some);
        let has_normals = wanted == Wanted::Cloud && has_all(&found[3..6]);
        let has_colors = wanted == Wanted::Mesh && has_all(&found[6..]);
        let color_scale = match found[6] {
            Some((_, Scalar::F32 | Scalar::F64)) => 255.0,
            Some((_, Scalar::U16)) => 255.0 / 65535.0,
            _ => 1.0,
        };
        let mut columns = Self {
            slots: vec![None; vertex.properties.len()],
            at: [(0, Scalar::F32); 6],
            has_normals,
            has_colors,
            color_scale,
        };
        for (slot, found) in found.iter().enumerate() {
            let is_wanted = match slot {
                0..3 => true,
                3..6 => has_normals,
                _ => has_colors,
            };
            if let (Some((p, kind)), true) = (*found, is_wanted) {
                let before = vertex.properties[..p].iter().map(|q| match q.shape {
                    Shape::One(s) => s.size(),
                    Shape::List { .. } => 0,
                });
                columns.slots[p] = Some(slot);
                if slot < 6 {
                    columns.at[slot] = (before.sum(), kind);
                }
            }
        }
        Ok(columns)
    }
}

#[cfg(test)]
mod tests;
