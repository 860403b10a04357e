//! Rows of a PCD file.

use super::Layout;
use super::rows::Rows;
use crate::points::pcd::header::{self, Encoding};

/// None where they are compressed: that is one piece.
pub fn layout(head: &[u8], length: u64) -> Option<Layout> {
    let header = header::read(head).ok()?;
    let start = header.body as u64;
    let (end, stride) = match header.encoding {
        Encoding::Ascii => (length, None),
        Encoding::Binary if header.stride > 0 => {
            let stride = header.stride as u64;
            (
                start.checked_add(header.points.checked_mul(stride)?)?,
                Some(stride),
            )
        }
        _ => return None,
    };
    let text = head[..header.body].to_vec();
    Some(Layout {
        rows: Rows { start, end, stride },
        count: Some(header.points),
        faces: 0,
        head: Box::new(move |count| with(&text, count)),
    })
}

/// The text of a header for so many points.
fn with(text: &[u8], count: u64) -> Vec<u8> {
    let lines = text.split_inclusive(|b| *b == b'\n').flat_map(|line| {
        let key = line.split(u8::is_ascii_whitespace).find(|word| !word.is_empty());
        match key {
            Some(b"WIDTH") => format!("WIDTH {count}\n").into_bytes(),
            Some(b"HEIGHT") => b"HEIGHT 1\n".to_vec(),
            Some(b"POINTS") => format!("POINTS {count}\n").into_bytes(),
            _ => line.to_vec(),
        }
    });
    lines.collect()
}
