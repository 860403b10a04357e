//! A cloud written again with some points changed: every other row of the file stays as it is, to the bit.

#[cfg(feature = "lidar")]
mod e57;
#[cfg(feature = "lidar")]
mod las;
mod obj;
mod pcd;
mod ply;
#[cfg(test)]
mod tests;
mod xyz;

use std::path::Path;

use glam::DVec3;

use crate::detect::kind_of;
use crate::file_name::{extension, is_gz_name};
use crate::kind::{Kind, PointFormat};
use crate::limits::Budget;
use crate::{Fault, FormatError, ReadLimits, atomic, input};

/// A point with its outward normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// Row of the point that it was, or whose attributes it gets.
    pub row: usize,
    /// Where it is.
    pub position: DVec3,
    /// Of unit length; written where the file has normals.
    pub normal: DVec3,
}

/// What became of the points of a cloud; rows are counted from 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CloudChanges {
    /// Points that went elsewhere, rows ascending.
    pub moved: Vec<Placed>,
    /// Rows of points that are no more, ascending.
    pub removed: Vec<usize>,
    /// Points that were not there; they get the attributes of the row that they name.
    pub added: Vec<Placed>,
}

/// Writes the cloud `like` (PLY, PCD, LAS, LAZ, E57, OBJ or XYZ) to `output`, of the same format, with `changes`. New points follow the last one
/// (of E57 the last of their scan). LAS, and E57 where it says so, has whole multiples of a step: edited points are rounded to them.
///
/// # Errors
/// Those of [`read`](super::read); [`Fault::Value`] for what is not written back: coordinates that are whole numbers,
/// points that come or go where others name them by number, or in a raster; I/O. The target is whole or untouched.
///
/// # Panics
/// If a row is beyond the cloud.
pub fn save_revised(
    like: &Path,
    changes: &CloudChanges,
    output: &Path,
    limits: &ReadLimits,
) -> Result<(), FormatError> {
    let revised = || {
        let mut budget = Budget::new(limits);
        let bytes = input::open(like)?.read_all(&mut budget)?;
        budget.reserve("the cloud that is written", bytes.len() as u64, 1)?;
        let (revised, name) = match kind_of(&bytes, like)? {
            Kind::Cloud(PointFormat::Ply) => (ply::revised(&bytes, changes)?, "ply"),
            Kind::Cloud(PointFormat::Xyz) => (xyz::revised(&bytes, changes)?, "xyz"),
            Kind::Cloud(PointFormat::Pcd) => (pcd::revised(&bytes, changes)?, "pcd"),
            Kind::Cloud(PointFormat::Obj) => (obj::revised(&bytes, changes)?, "obj"),
            #[cfg(feature = "lidar")]
            Kind::Cloud(PointFormat::Las) => (
                las::revised(&bytes, changes, &mut budget)?,
                las::extension(&bytes),
            ),
            #[cfg(feature = "lidar")]
            Kind::Cloud(PointFormat::E57) => (e57::revised(&bytes, changes, &mut budget)?, "e57"),
            other => {
                return Err(Fault::Value {
                    what: "the format of the scan",
                    value: other.to_string(),
                    remedy: "edited clouds are written as PLY, PCD, LAS, LAZ, E57, OBJ or XYZ; convert the scan to .ply and fit that",
                });
            }
        };
        let known = ["ply", "pcd", "las", "laz", "obj", "e57"];
        let is_text = name == "xyz" && !known.contains(&extension(output).as_str());
        if is_gz_name(output) || extension(output) != name && !is_text {
            return Err(Fault::Value {
                what: "the name of the output",
                value: output.display().to_string(),
                remedy: "an edited cloud is written in the format of the scan, and not as .gz",
            });
        }
        Ok(revised)
    };
    let bytes = revised().map_err(|fault| fault.at(like))?;
    atomic::replace(output, |out| out.write_all(&bytes))
}

/// Rows of a file: those that stay, those that are rewritten, and those that go.
struct Rows<'a> {
    changes: &'a CloudChanges,
    moved: usize,
    removed: usize,
}

/// What becomes of a row.
enum Row<'a> {
    Stays,
    Moves(&'a Placed),
    Goes,
}

impl<'a> Rows<'a> {
    fn of(changes: &'a CloudChanges) -> Self {
        Self {
            changes,
            moved: 0,
            removed: 0,
        }
    }

    /// What becomes of `row`; asked for one after the other.
    fn next(&mut self, row: usize) -> Row<'a> {
        if self.changes.removed.get(self.removed) == Some(&row) {
            self.removed += 1;
            return Row::Goes;
        }
        match self.changes.moved.get(self.moved) {
            Some(placed) if placed.row == row => {
                self.moved += 1;
                Row::Moves(placed)
            }
            _ => Row::Stays,
        }
    }
}

/// Points that are lines of text with their changes: those that come stand behind the last of `count`, before all that follows.
fn text_rows(
    body: &[u8],
    count: u64,
    changes: &CloudChanges,
    placed_line: impl Fn(&[u8], &Placed) -> Vec<u8>,
    out: &mut Vec<u8>,
) {
    let mut rows = Rows::of(changes);
    let mut points: Vec<&[u8]> = Vec::new();
    let mut lines = body.split_inclusive(|c| *c == b'\n');
    while (points.len() as u64) < count
        && let Some(line) = lines.next()
    {
        if line.trim_ascii().is_empty() {
            out.extend_from_slice(line);
            continue;
        }
        match rows.next(points.len()) {
            Row::Stays => out.extend_from_slice(line),
            Row::Moves(placed) => out.extend(placed_line(line, placed)),
            Row::Goes => {}
        }
        points.push(line);
    }
    for placed in &changes.added {
        if !out.ends_with(b"\n") {
            out.push(b'\n');
        }
        out.extend(placed_line(points[placed.row], placed));
    }
    lines.for_each(|line| out.extend_from_slice(line));
}

/// Rows of `stride` bytes with their changes; `placed_row` puts a point into a row.
fn binary_rows(
    points: &[u8],
    stride: usize,
    changes: &CloudChanges,
    placed_row: impl Fn(&[u8], &Placed) -> Vec<u8>,
    out: &mut Vec<u8>,
) {
    let mut rows = Rows::of(changes);
    for (n, row) in points.chunks_exact(stride).enumerate() {
        match rows.next(n) {
            Row::Stays => out.extend_from_slice(row),
            Row::Moves(placed) => out.extend(placed_row(row, placed)),
            Row::Goes => {}
        }
    }
    for placed in &changes.added {
        out.extend(placed_row(&points[placed.row * stride..][..stride], placed));
    }
}

/// Words of a line with some in new words' place, with this decimal mark.
fn words(line: &[u8], separator: impl Fn(u8) -> bool, new: &[(usize, f64)], mark: &str) -> Vec<u8> {
    let mut out = Vec::with_capacity(line.len() + 16);
    let (mut word, mut at) = (0, 0);
    while at < line.len() {
        let end = at
            + line[at..]
                .iter()
                .position(|c| separator(*c))
                .unwrap_or(line.len() - at);
        if end == at {
            out.push(line[at]);
            at += 1;
            continue;
        }
        match new.iter().find(|(n, _)| *n == word) {
            Some((_, value)) => out.extend_from_slice(format!("{value:?}").replace('.', mark).as_bytes()),
            None => out.extend_from_slice(&line[at..end]),
        }
        word += 1;
        at = end;
    }
    out
}
