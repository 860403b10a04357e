use super::{CloudChanges, Placed, Row, Rows, words};
use crate::Fault;
use crate::ReadLimits;
use crate::limits::Budget;
use crate::points::xyz::{Apart, Columns, Line, parse_columns};

/// The bytes of the file with its changes.
pub fn revised(bytes: &[u8], changes: &CloudChanges) -> Result<Vec<u8>, Fault> {
    let (_, columns) = parse_columns(bytes, &mut Budget::new(&ReadLimits::default()))?;
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
            Row::Moves(placed) => out.extend(placed_line(line, placed, &columns)),
            Row::Goes => {}
        }
        points.push(line);
    }
    for placed in &changes.added {
        if !out.ends_with(b"\n") {
            out.push(b'\n');
        }
        out.extend(placed_line(points[placed.row], placed, &columns));
    }
    Ok(out)
}

fn placed_line(line: &[u8], placed: &Placed, columns: &Columns) -> Vec<u8> {
    let mut new: Vec<_> = columns
        .position
        .into_iter()
        .zip(placed.position.to_array())
        .collect();
    let normal = columns.normal.into_iter().flatten();
    new.extend(normal.zip(placed.normal.to_array()));
    let has_decimal_commas = Apart::of(line.trim_ascii()).has_decimal_commas();
    let is_between = |c| matches!(c, b' ' | b'\t' | b';' | b'\r' | b'\n') || c == b',' && !has_decimal_commas;
    let mark = if has_decimal_commas { "," } else { "." };
    words(line, is_between, &new, mark)
}
