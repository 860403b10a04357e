//! STL in: ascii and binary. Triangles share no vertices there; corners at the same place become one.

use glam::DVec3;

use crate::Fault;
use crate::error::excerpt;
use crate::limits::Budget;
use crate::meshes::weld::Welder;
use crate::raw::{Faces, RawShape};
use crate::text::{Lines, number};

/// Bytes before the first triangle of a binary file, and of each triangle.
const HEAD: u64 = 84;
const ROW: u64 = 50;

pub(in crate::meshes) fn parse(bytes: &[u8], budget: &mut Budget) -> Result<RawShape, Fault> {
    if bytes.is_empty() {
        return Err(Fault::Empty);
    }
    let count = bytes
        .get(80..84)
        .map(|b| u64::from(u32::from_le_bytes(b.try_into().expect("four bytes"))));
    // Some binary files start with "solid", too: the length tells.
    let fits = count.is_some_and(|n| HEAD + ROW * n == bytes.len() as u64);
    if !fits
        && bytes
            .trim_ascii_start()
            .get(..5)
            .is_some_and(|b| b.eq_ignore_ascii_case(b"solid"))
    {
        return ascii(bytes, budget);
    }
    let needed = HEAD + ROW * count.unwrap_or(0);
    if count.is_none() || needed > bytes.len() as u64 {
        return Err(Fault::Truncated {
            what: format!("a binary STL file of {} triangles", count.unwrap_or(0)),
            needed,
            found: bytes.len() as u64,
        });
    }
    let mut raw = binary(&bytes[HEAD as usize..needed as usize], budget)?;
    if needed < bytes.len() as u64 {
        raw.notes.push(format!(
            "{} bytes after the last triangle were skipped",
            bytes.len() as u64 - needed
        ));
    }
    Ok(raw)
}

fn binary(rows: &[u8], budget: &mut Budget) -> Result<RawShape, Fault> {
    let mut welder = Welder::new();
    let mut faces = Faces::new();
    for row in rows.chunks_exact(ROW as usize) {
        let mut corners = [0; 3];
        for (corner, b) in corners.iter_mut().zip(row[12..48].chunks_exact(12)) {
            let x = |i: usize| {
                let b = b[4 * i..4 * i + 4].try_into().expect("four bytes");
                f64::from(f32::from_le_bytes(b))
            };
            *corner = welder.vertex(DVec3::new(x(0), x(1), x(2)), budget)?;
        }
        faces.push(corners.into_iter(), budget)?;
    }
    Ok(join(welder, faces))
}

fn ascii(bytes: &[u8], budget: &mut Budget) -> Result<RawShape, Fault> {
    let mut welder = Welder::new();
    let mut faces = Faces::new();
    let mut corners: Vec<u32> = Vec::new();
    let (mut is_in_loop, mut is_closed) = (false, false);
    let mut lines = Lines::new(bytes);
    while let Some(text) = lines.next() {
        let line = lines.line;
        let mut words = text.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
        while let Some(word) = words.next() {
            let misplaced = |word| {
                Fault::line(
                    line,
                    format!("{} stands where it cannot", excerpt(word)),
                    "a facet is \"facet normal\", \"outer loop\", three lines \"vertex x y z\", \"endloop\", \
                     \"endfacet\"",
                )
            };
            let mut three = || -> Result<DVec3, Fault> {
                let mut v = [0.0; 3];
                for slot in &mut v {
                    *slot = number(words.next().ok_or_else(|| misplaced(word))?, line)?;
                }
                Ok(v.into())
            };
            match word.to_ascii_lowercase().as_slice() {
                // A name of any words follows.
                b"solid" if !is_in_loop => {
                    is_closed = false;
                    break;
                }
                b"endsolid" if !is_in_loop => {
                    is_closed = true;
                    break;
                }
                b"facet" | b"outer" | b"endfacet" if !is_in_loop => {}
                b"normal" => _ = three()?,
                b"loop" if !is_in_loop => is_in_loop = true,
                b"vertex" if is_in_loop => corners.push(welder.vertex(three()?, budget)?),
                b"endloop" if is_in_loop => {
                    faces.push(corners.iter().copied(), budget)?;
                    corners.clear();
                    is_in_loop = false;
                }
                _ => return Err(misplaced(word)),
            }
        }
    }
    if is_in_loop {
        return Err(Fault::Truncated {
            what: format!("the facet that ends at line {}", lines.line),
            needed: bytes.len() as u64 + 1,
            found: bytes.len() as u64,
        });
    }
    let mut raw = join(welder, faces);
    if !is_closed {
        raw.notes
            .push("the file ends without \"endsolid\": was it copied whole?".into());
    }
    Ok(raw)
}

fn join(welder: Welder, faces: Faces) -> RawShape {
    let mut raw = RawShape {
        positions: welder.positions.items,
        ..Default::default()
    };
    faces.finish(&mut raw);
    raw
}
