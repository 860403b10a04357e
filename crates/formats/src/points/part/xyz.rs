//! Lines of an XYZ file.

use super::Layout;
use super::rows::Rows;
use crate::points::xyz::Line;

/// All of it is lines; the first one may tell how many.
pub fn layout(head: &[u8], length: u64) -> Option<Layout> {
    let first = head.split_inclusive(|b| *b == b'\n').next()?;
    let (count, start) = match Line::of(first.trim_ascii(), &mut true) {
        Line::Count(count) => (Some(u64::try_from(count).ok()?), first.len() as u64),
        _ => (None, 0),
    };
    Some(Layout {
        rows: Rows {
            start,
            end: length,
            stride: None,
        },
        count,
        faces: 0,
        head: Box::new(|_| Vec::new()),
    })
}
