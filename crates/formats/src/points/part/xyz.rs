//! Lines of an XYZ file.

use super::Layout;
use super::rows::Rows;
use crate::points::xyz::Line;

/// All of it is lines. The first ones may tell how many points there are, and what the columns are called.
pub fn layout(head: &[u8], length: u64) -> Option<Layout> {
    let (mut count, mut start, mut is_first) = (None, 0, true);
    let mut told = Vec::new();
    for line in head.split_inclusive(|b| *b == b'\n') {
        match Line::of(line.trim_ascii(), &mut is_first) {
            Line::Point => break,
            Line::Count(n) => count = Some(u64::try_from(n).ok()?),
            Line::Names | Line::Nothing => told.extend_from_slice(line),
        }
        start += line.len();
    }
    Some(Layout {
        rows: Rows {
            start: start as u64,
            end: length,
            stride: None,
        },
        count,
        faces: 0,
        head: Box::new(move |_| told.clone()),
    })
}
