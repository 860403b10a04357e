//! Vertices of a PLY file that come first.

use super::Layout;
use super::rows::Rows;
use crate::points::ply::header::{self, Encoding};

/// None where something else comes first, or rows have no length of their own.
pub fn layout(head: &[u8], length: u64) -> Option<Layout> {
    let header = header::read(head).ok()?;
    let (vertices, others) = header.elements.split_first()?;
    if vertices.name != "vertex" {
        return None;
    }
    let start = header.body as u64;
    let (end, stride) = match header.encoding {
        // What comes after the vertices cannot be told from them.
        Encoding::Ascii if others.iter().any(|element| element.count > 0) => return None,
        Encoding::Ascii => (length, None),
        Encoding::Little | Encoding::Big => {
            let stride = vertices.fixed_stride().filter(|bytes| *bytes > 0)? as u64;
            (
                start.checked_add(vertices.count.checked_mul(stride)?)?,
                Some(stride),
            )
        }
    };
    let text = head[..header.body].to_vec();
    Some(Layout {
        rows: Rows { start, end, stride },
        count: Some(vertices.count),
        faces: others
            .iter()
            .find(|element| element.name == "face")
            .map_or(0, |faces| faces.count),
        head: Box::new(move |count| with(&text, count)),
    })
}

/// The text of a header for so many vertices and nothing else.
fn with(text: &[u8], count: u64) -> Vec<u8> {
    let lines = text.split_inclusive(|b| *b == b'\n').flat_map(|line| {
        let mut words = line
            .split(u8::is_ascii_whitespace)
            .filter(|word| !word.is_empty());
        match (words.next(), words.next()) {
            (Some(b"element"), Some(name)) => {
                let count = if name == b"vertex" { count } else { 0 };
                let name = String::from_utf8_lossy(name);
                format!("element {name} {count}\n").into_bytes()
            }
            _ => line.to_vec(),
        }
    });
    lines.collect()
}
