use super::{CloudChanges, Placed, Row, Rows, words};
use crate::Fault;
use crate::points::xyz::Line;

/// The bytes of the file with its changes.
pub fn revised(bytes: &[u8], changes: &CloudChanges) -> Result<Vec<u8>, Fault> {
    let has_normals = crate::points::parse_xyz(bytes, &crate::ReadLimits::default())?
        .normals
        .is_some();
    let mut rows = Rows::of(changes);
    let mut out = Vec::with_capacity(bytes.len());
    let mut points: Vec<&[u8]> = Vec::new();
    let mut is_first = true;
    let counts_change = !changes.removed.is_empty() || !changes.added.is_empty();
    for line in bytes.split_inclusive(|c| *c == b'\n') {
        match Line::of(line.trim_ascii(), &mut is_first) {
            Line::Point => {}
            // It would no longer be right.
            Line::Count(_) if counts_change => continue,
            _ => {
                out.extend_from_slice(line);
                continue;
            }
        }
        match rows.next(points.len()) {
            Row::Stays => out.extend_from_slice(line),
            Row::Moves(placed) => out.extend(placed_line(line, placed, has_normals)),
            Row::Goes => {}
        }
        points.push(line);
    }
    for placed in &changes.added {
        if !out.ends_with(b"\n") {
            out.push(b'\n');
        }
        out.extend(placed_line(points[placed.row], placed, has_normals));
    }
    Ok(out)
}

fn placed_line(line: &[u8], placed: &Placed, has_normals: bool) -> Vec<u8> {
    let numbers = [placed.position, placed.normal].map(|v| v.to_array());
    let count = if has_normals { 6 } else { 3 };
    let new: Vec<_> = numbers.into_iter().flatten().enumerate().take(count).collect();
    words(
        line,
        |c| matches!(c, b' ' | b'\t' | b',' | b';' | b'\r' | b'\n'),
        &new,
    )
}
