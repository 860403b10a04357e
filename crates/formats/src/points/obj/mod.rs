//! OBJ in and out. Read are `v`, `vn` and `f`; everything else is skipped.

mod write;

use glam::{DVec3, Vec3};

use super::cloud::PointCloud;
use super::normals;
use crate::error::excerpt;
use crate::limits::{Budget, Counted};
use crate::raw::{Faces, NO_NORMAL, RawShape, Wanted};
use crate::text::{Lines, integer, number, utf8};
use crate::{Fault, ReadLimits};

pub(crate) use write::write;

/// Reads the text of an OBJ file.
///
/// Faces may have any number of corners and negative (relative) indices, and a line may go on after `\`. Normals:
/// from the corners (`v//vn`) where the faces name them, otherwise angle-weighted from the faces; without faces
/// the `vn` lines pair with the `v` lines if there are as many.
///
/// # Errors
/// A [`Fault`] with the line for a word that is no number or an index beyond the vertices or normals.
pub fn parse_obj(bytes: &[u8], limits: &ReadLimits) -> Result<PointCloud, Fault> {
    let mut budget = Budget::new(limits);
    normals::finish(parse(bytes, Wanted::Cloud, &mut budget)?, &mut budget)
}

const INDEX_REMEDY: &str =
    "indices count from 1, or from -1 backwards, and stay within what the file defines";

pub(crate) fn parse(bytes: &[u8], wanted: Wanted, budget: &mut Budget) -> Result<RawShape, Fault> {
    if bytes.is_empty() {
        return Err(Fault::Empty);
    }
    let bytes = &*utf8(bytes, budget)?;
    let mut positions = Counted::new("points");
    let mut vertex_normals = Counted::new("normals");
    let mut faces = Faces::new();
    let mut colors = Counted::new("colours");
    let mut corner_normals = Counted::new("normals of corners");
    let mut names_normals = false;
    // Largest index that no vertex or normal so far has: faces may stand before what they name.
    let mut furthest = [(0u32, 0u64); 2];
    let mut raw = RawShape::default();
    let mut corners: Vec<[u32; 2]> = Vec::new();
    let mut joined = Vec::new();
    let mut lines = Lines::new(bytes);
    while let Some(mut text) = lines.next() {
        let line = lines.line;
        if text.ends_with(b"\\") {
            joined.clear();
            loop {
                let goes_on = text.ends_with(b"\\");
                joined.extend_from_slice(text.strip_suffix(b"\\").unwrap_or(text));
                joined.push(b' ');
                match (goes_on, goes_on.then(|| lines.next()).flatten()) {
                    (true, Some(next)) => text = next,
                    _ => break,
                }
            }
            text = &joined;
        }
        let mut words = text.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
        match words.next() {
            Some(b"v") => {
                let colored = words.clone().skip(3);
                positions.push(three(words, line)?, budget)?;
                if wanted == Wanted::Mesh && colored.clone().nth(2).is_some() {
                    colors.push(three(colored, line)?.as_vec3(), budget)?;
                }
            }
            Some(b"vn") => vertex_normals.push(three(words, line)?, budget)?,
            Some(b"f") => {
                corners.clear();
                let defined = [positions.items.len(), vertex_normals.items.len()];
                for word in words {
                    let corner = corner(word, defined, line)?;
                    for i in 0..2 {
                        if corner[i] != NO_NORMAL && corner[i] >= furthest[i].0 {
                            furthest[i] = (corner[i] + 1, line);
                        }
                    }
                    corners.push(corner);
                }
                faces.push(corners.iter().map(|c| c[0]), budget)?;
                if wanted == Wanted::Mesh {
                    continue;
                }
                for i in 2..corners.len() {
                    let fan = [corners[0], corners[i - 1], corners[i]];
                    if !names_normals && fan.iter().any(|c| c[1] != NO_NORMAL) {
                        names_normals = true;
                        let earlier = faces.triangles.items.len() + i - corners.len();
                        for _ in 0..earlier {
                            corner_normals.push([NO_NORMAL; 3], budget)?;
                        }
                    }
                    if names_normals {
                        corner_normals.push(fan.map(|c| c[1]), budget)?;
                    }
                }
            }
            _ => {}
        }
    }
    for (i, defined) in [positions.items.len(), vertex_normals.items.len()]
        .into_iter()
        .enumerate()
    {
        let (needed, line) = furthest[i];
        if needed as usize > defined {
            let what = ["vertex", "normal"][i];
            return Err(Fault::line(
                line,
                format!("{what} {needed} is named, the file has {defined}"),
                INDEX_REMEDY,
            ));
        }
    }
    if positions.items.is_empty() {
        return Err(Fault::Value {
            what: "the number of vertices",
            value: "0".into(),
            remedy: "an OBJ file holds a line \"v x y z\" for each; is this one?",
        });
    }
    if faces.count == 0 && !vertex_normals.items.is_empty() {
        if vertex_normals.items.len() == positions.items.len() {
            raw.normals = Some(std::mem::take(&mut vertex_normals.items));
        } else {
            raw.notes.push(format!(
                "{} normals for {} vertices and no faces to pair them; the normals were skipped",
                vertex_normals.items.len(),
                positions.items.len()
            ));
        }
    }
    if names_normals {
        raw.corner_normals = Some((corner_normals.items, vertex_normals.items));
    }
    raw.positions = positions.items;
    raw.colors = (colors.items.len() == raw.positions.len()).then(|| bytes_of(&colors.items));
    faces.finish(&mut raw);
    Ok(raw)
}

/// Colours are written from 0 to 1 by most programs, from 0 to 255 by some.
fn bytes_of(colors: &[Vec3]) -> Vec<[u8; 3]> {
    let is_unit = colors.iter().all(|c| c.max_element() <= 1.0);
    let scale = if is_unit { 255.0 } else { 1.0 };
    colors
        .iter()
        .map(|c| c.to_array().map(|x| (x * scale).round() as u8))
        .collect()
}

fn three<'a>(words: impl Iterator<Item = &'a [u8]>, line: u64) -> Result<DVec3, Fault> {
    let mut v = [0.0; 3];
    let mut found = 0;
    for (slot, word) in v.iter_mut().zip(words) {
        *slot = number(word, line)?;
        found += 1;
    }
    if found < 3 {
        return Err(Fault::line(
            line,
            format!("{found} coordinates"),
            "a \"v\" or \"vn\" line holds three numbers",
        ));
    }
    Ok(v.into())
}

/// Vertex and normal of a corner `v`, `v/t`, `v//n` or `v/t/n`, counted from 0.
fn corner(word: &[u8], defined: [usize; 2], line: u64) -> Result<[u32; 2], Fault> {
    let mut parts = word.split(|c| *c == b'/');
    let vertex = index(parts.next().unwrap_or(b""), defined[0]);
    let normal = match (parts.next(), parts.next()) {
        (_, None | Some(b"")) => Some(NO_NORMAL),
        (_, Some(n)) => index(n, defined[1]),
    };
    match (vertex, normal) {
        (Some(v), Some(n)) => Ok([v, n]),
        _ => Err(Fault::line(
            line,
            format!("cannot use the corner {}", excerpt(word)),
            INDEX_REMEDY,
        )),
    }
}

fn index(word: &[u8], defined: usize) -> Option<u32> {
    let from_zero = match integer(word)? {
        0 => return None,
        n if n > 0 => n - 1,
        n => defined as i64 + n,
    };
    u32::try_from(from_zero).ok().filter(|n| *n < NO_NORMAL)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::NormalSource;

    fn read(text: &str) -> Result<PointCloud, Fault> {
        parse_obj(text.as_bytes(), &ReadLimits::default())
    }

    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    #[test]
    fn quads_negative_and_forward_indices_give_the_same_cloud() {
        let plain = read(&format!("{SQUARE}f 1 2 3 4\n")).unwrap();
        assert_eq!(plain.normals.as_ref().unwrap(), &[DVec3::Z; 4]);
        for text in [
            format!("{SQUARE}f -4 -3 -2 -1\n"),
            format!("f 1/1 2/1 3/2 4/9\n{SQUARE}"),
            format!("o thing\n{SQUARE}s off\nf 1 2 \\\n3 4\n"),
            format!("{SQUARE}f 1// 2// 3// 4//"),
        ] {
            assert_eq!(read(&text).unwrap(), plain, "{text}");
        }
    }

    #[test]
    fn text_of_windows_is_read_too() {
        let text = format!("# ä\r\n{SQUARE}f 1 2 3 4\n");
        let plain = read(&text).unwrap();
        let wide: Vec<u8> = [0xfeff]
            .into_iter()
            .chain(text.encode_utf16())
            .flat_map(u16::to_le_bytes)
            .collect();
        assert_eq!(parse_obj(&wide, &ReadLimits::default()).unwrap(), plain);
        assert_eq!(
            read(&text.replace("\r\n", "\n").replace('\n', "\r")).unwrap(),
            plain
        );
    }

    #[test]
    fn normals_of_corners_win_over_faces_and_pair_up_without_faces() {
        let c = read(&format!("{SQUARE}vn 1 0 0\nf 1//1 2//1 3//-1\nf 1 3 4\n")).unwrap();
        let n = c.normals.unwrap();
        assert_eq!(c.normal_source, NormalSource::Stored);
        assert_eq!((n[1], n[3]), (DVec3::X, DVec3::Z));
        let c = read("v 0 0 0 1 0 0\nvn 0 0 2\n").unwrap();
        assert_eq!(c.normals.unwrap(), [DVec3::Z]);
        let c = read("v 0 0 0\nv 1 0 0\nvn 0 0 2\n").unwrap();
        assert!(c.normals.is_none() && c.notes[0].contains("1 normals for 2 vertices"));
    }

    #[test]
    fn faults_name_the_line_and_the_word() {
        for (text, part) in [
            ("v 0 0\n", "line 1: 2 coordinates"),
            ("v 0 0 zero\n", "line 1: \"zero\" is not a number"),
            ("v 0 0 0\nf 1 2 3\n", "line 2: vertex 3 is named, the file has 1"),
            (
                "v 0 0 0\nf 1//1 1//1 1//1\n",
                "line 2: normal 1 is named, the file has 0",
            ),
            ("v 0 0 0\nf 0 1 1\n", "corner \"0\""),
            ("v 0 0 0\nf -2 1 1\n", "corner \"-2\""),
            ("v 0 0 0\nf 1.5 1 1\n", "corner \"1.5\""),
            ("v 0 0 0\nf 4294967296 1 1\n", "corner \"4294967296\""),
            ("# nothing\n", "number of vertices is 0"),
        ] {
            let e = read(text).unwrap_err().to_string();
            assert!(e.contains(part), "{text:?}: {e}");
        }
    }
}
