use glam::DVec3;

use super::{CloudChanges, Row, Rows, words};
use crate::Fault;

/// The bytes of a file of points with their changes: lines `v`, and lines `vn` in their order where there is one a point.
pub fn revised(bytes: &[u8], changes: &CloudChanges) -> Result<Vec<u8>, Fault> {
    let not = |what, value: &str, remedy| {
        Err(Fault::Value {
            what,
            value: value.into(),
            remedy,
        })
    };
    let lines: Vec<&[u8]> = bytes.split_inclusive(|c| *c == b'\n').collect();
    let key = |line: &[u8]| {
        let mut words = line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
        words.next().unwrap_or_default().to_vec()
    };
    let of = |name: &[u8]| {
        lines
            .iter()
            .copied()
            .filter(|line| key(line) == name)
            .collect::<Vec<_>>()
    };
    let (points, normals) = (of(b"v"), of(b"vn"));
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return not(
            "the text of the scan",
            "UTF-16",
            "write it as UTF-8, or convert the scan by isoclay convert, and fit that",
        );
    }
    if lines.iter().any(|line| line.trim_ascii_end().ends_with(b"\\")) {
        return not(
            "a line of the scan",
            "one that goes on after \\",
            "convert the scan by isoclay convert and fit that",
        );
    }
    let counts_change = !changes.removed.is_empty() || !changes.added.is_empty();
    let names_points = |line: &[u8]| matches!(&key(line)[..], b"f" | b"p" | b"l");
    if counts_change && lines.iter().any(|line| names_points(line)) {
        return not(
            "what names the vertices by number",
            "lines f, p or l",
            "points come or go; write the vertices alone into a file and fit that",
        );
    }
    let has_normals = normals.len() == points.len();
    let blank = |c: u8| c.is_ascii_whitespace();
    let placed_line = |line: &[u8], v: DVec3| {
        let new: Vec<_> = (1..4).zip(v.to_array()).collect();
        words(line, blank, &new, ".")
    };
    let mut out = Vec::with_capacity(bytes.len());
    let mut rows = [Rows::of(changes), Rows::of(changes)];
    let mut next = [0; 2];
    for line in lines {
        let of = match &key(line)[..] {
            b"v" => 0,
            b"vn" if has_normals => 1,
            _ => {
                out.extend_from_slice(line);
                continue;
            }
        };
        match rows[of].next(next[of]) {
            Row::Stays => out.extend_from_slice(line),
            Row::Moves(placed) => out.extend(placed_line(line, [placed.position, placed.normal][of])),
            Row::Goes => {}
        }
        next[of] += 1;
    }
    for placed in &changes.added {
        if !out.ends_with(b"\n") {
            out.push(b'\n');
        }
        out.extend(placed_line(points[placed.row], placed.position));
        if has_normals {
            if !out.ends_with(b"\n") {
                out.push(b'\n');
            }
            out.extend(placed_line(normals[placed.row], placed.normal));
        }
    }
    Ok(out)
}
