//! A cloud written again with some points changed: every other row of the file stays as it is, to the bit.

#[cfg(feature = "lidar")]
mod las;
mod obj;
mod pcd;
mod ply;
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

/// Writes the cloud `like` (PLY, PCD, LAS, OBJ or XYZ) to `output`, of the same format, with `changes`. New points follow the last one.
/// LAS has whole multiples of its step: edited points are rounded to them.
///
/// # Errors
/// Those of [`read`](super::read); [`Fault::Value`] for what is not written back: E57 and LAZ, coordinates that are whole numbers,
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
            Kind::Cloud(PointFormat::Las) => (las::revised(&bytes, changes)?, "las"),
            other => {
                return Err(Fault::Value {
                    what: "the format of the scan",
                    value: other.to_string(),
                    remedy: "edited clouds are written as PLY, PCD, LAS, OBJ or XYZ; convert the scan to .ply and fit that",
                });
            }
        };
        let known = ["ply", "pcd", "las", "laz", "obj", "e57"];
        let is_text = name == "xyz" && !known.contains(&extension(output).as_str());
        if is_gz_name(output) || extension(output) != name && !is_text {
            return Err(Fault::Value {
                what: "the name of the output",
                value: output.display().to_string(),
                remedy: "an edited cloud is written in the format of the scan, not compressed",
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

/// Words of a line with some in new words' place.
fn words(line: &[u8], separator: impl Fn(u8) -> bool, new: &[(usize, f64)]) -> Vec<u8> {
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
            Some((_, value)) => out.extend_from_slice(format!("{value:?}").as_bytes()),
            None => out.extend_from_slice(&line[at..end]),
        }
        word += 1;
        at = end;
    }
    out
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::points;

    fn changes() -> CloudChanges {
        let placed = |row, x: f64| Placed {
            row,
            position: DVec3::new(x, 0.25, -1.5),
            normal: DVec3::Z,
        };
        CloudChanges {
            moved: vec![placed(1, 7.0)],
            removed: vec![0],
            added: vec![placed(2, 9.0)],
        }
    }

    fn revised(name: &str, bytes: &[u8], changes: &CloudChanges) -> (Vec<u8>, points::PointCloud) {
        let directory = tempfile::tempdir().unwrap();
        let (like, output) = (
            directory.path().join(name),
            directory.path().join(format!("out_{name}")),
        );
        fs::write(&like, bytes).unwrap();
        save_revised(&like, changes, &output, &ReadLimits::default()).unwrap();
        let cloud = points::read(&output, &ReadLimits::default()).unwrap();
        (fs::read(&output).unwrap(), cloud)
    }

    /// Three points with a normal and an attribute, in each encoding.
    fn files() -> Vec<(&'static str, Vec<u8>)> {
        let header = |format: &str| {
            format!(
                "ply\nformat {format} 1.0\ncomment kept\nelement vertex 3\nproperty uchar tag\nproperty double x\nproperty \
                 double y\nproperty double z\nproperty float nx\nproperty float ny\nproperty float nz\nend_header\n"
            )
        };
        let rows: [[f64; 6]; 3] = [
            [1.5, 2.0, 3.0, 1.0, 0.0, 0.0],
            [4.0, 5.0, 6.0, 0.0, 1.0, 0.0],
            [7.0, 8.0, 9.5, 0.0, 0.0, -1.0],
        ];
        let binary = |big: bool| {
            let mut out = Vec::new();
            for (n, row) in rows.iter().enumerate() {
                out.push(10 + n as u8);
                for (at, v) in row.iter().enumerate() {
                    let mut bytes = if at < 3 {
                        v.to_le_bytes().to_vec()
                    } else {
                        (*v as f32).to_le_bytes().to_vec()
                    };
                    if big {
                        bytes.reverse();
                    }
                    out.extend(bytes);
                }
            }
            out
        };
        let ascii: String = (rows.iter().enumerate())
            .map(|(n, r)| {
                format!(
                    "{} {} {}  {} {} {} {}\n",
                    10 + n,
                    r[0],
                    r[1],
                    r[2],
                    r[3],
                    r[4],
                    r[5]
                )
            })
            .collect();
        let xyz: String = (rows.iter().enumerate())
            .map(|(n, r)| {
                format!(
                    "{}, {}, {}; {} {} {} tag{n}\n",
                    r[0], r[1], r[2], r[3], r[4], r[5]
                )
                .replace("tag", "1")
            })
            .collect();
        vec![
            (
                "ascii.ply",
                [header("ascii").into_bytes(), ascii.into_bytes()].concat(),
            ),
            (
                "little.ply",
                [header("binary_little_endian").into_bytes(), binary(false)].concat(),
            ),
            (
                "big.ply",
                [header("binary_big_endian").into_bytes(), binary(true)].concat(),
            ),
            ("cloud.xyz", [b"# kept\n3\n".to_vec(), xyz.into_bytes()].concat()),
        ]
    }

    /// The same points, the tag behind them, in the other formats.
    fn others() -> Vec<(&'static str, Vec<u8>)> {
        let rows: [[f32; 6]; 3] = [
            [1.5, 2.0, 3.0, 1.0, 0.0, 0.0],
            [4.0, 5.0, 6.0, 0.0, 1.0, 0.0],
            [7.0, 8.0, 9.5, 0.0, 0.0, -1.0],
        ];
        let pcd = |data: &str, body: Vec<u8>| {
            let head = format!(
                "# .PCD v0.7 kept\nVERSION 0.7\nFIELDS x y z normal_x normal_y normal_z tag\nSIZE 4 4 4 4 4 4 1\nTYPE F F F F F F U\n\
                 COUNT 1 1 1 1 1 1 1\nWIDTH 3\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3\nDATA {data}\n"
            );
            [head.into_bytes(), body].concat()
        };
        let tag = |n: usize| 10 + n as u8;
        let text: String = (rows.iter().enumerate())
            .map(|(n, r)| {
                format!(
                    "{} {} {} {} {} {} {}\n",
                    r[0],
                    r[1],
                    r[2],
                    r[3],
                    r[4],
                    r[5],
                    tag(n)
                )
            })
            .collect();
        let binary: Vec<u8> = (rows.iter().enumerate())
            .flat_map(|(n, r)| {
                r.iter()
                    .flat_map(|v| v.to_le_bytes())
                    .chain([tag(n)])
                    .collect::<Vec<_>>()
            })
            .collect();
        let columns: Vec<u8> = (0..6)
            .flat_map(|c| rows.iter().flat_map(move |r| r[c].to_le_bytes()))
            .chain((0..3).map(tag))
            .collect();
        let packed = points::pcd::lzf::stored(&columns);
        let sizes = [packed.len() as u32, columns.len() as u32]
            .map(u32::to_le_bytes)
            .concat();
        let obj: String = (rows.iter().enumerate())
            .map(|(n, r)| {
                format!(
                    "v {} {} {} {}\nvn {} {} {}\n",
                    r[0],
                    r[1],
                    r[2],
                    tag(n),
                    r[3],
                    r[4],
                    r[5]
                )
            })
            .collect();
        vec![
            ("ascii.pcd", pcd("ascii", text.into_bytes())),
            ("binary.pcd", pcd("binary", binary)),
            ("packed.pcd", pcd("binary_compressed", [sizes, packed].concat())),
            ("cloud.obj", [b"# kept\n".to_vec(), obj.into_bytes()].concat()),
        ]
    }

    #[test]
    fn other_formats_follow_too() {
        for (name, bytes) in others() {
            assert_eq!(revised(name, &bytes, &CloudChanges::default()).0, bytes, "{name}");
            let (new, cloud) = revised(name, &bytes, &changes());
            let places: Vec<_> = cloud.positions.iter().map(|p| p.to_array()).collect();
            let expected = [[7.0, 0.25, -1.5], [7.0, 8.0, 9.5], [9.0, 0.25, -1.5]];
            assert_eq!(places, expected, "{name}");
            assert_eq!(
                cloud.normals.unwrap(),
                [DVec3::Z, DVec3::NEG_Z, DVec3::Z],
                "{name}"
            );
            assert!(new.windows(4).any(|w| w == b"kept"), "{name}");
            let tags: Vec<u8> = match name {
                "ascii.pcd" | "cloud.obj" => String::from_utf8(new)
                    .unwrap()
                    .lines()
                    .filter(|l| l.starts_with("v ") || name == "ascii.pcd")
                    .filter_map(|l| l.rsplit(' ').next().unwrap().parse().ok())
                    .collect::<Vec<u8>>()
                    .into_iter()
                    .rev()
                    .take(3)
                    .rev()
                    .collect(),
                "binary.pcd" => new[new.len() - 75..]
                    .iter()
                    .skip(24)
                    .step_by(25)
                    .copied()
                    .collect(),
                _ => new[new.len() - 3..].to_vec(),
            };
            assert_eq!(tags, [11, 12, 12], "{name}");
        }
        // A raster keeps its shape, or is refused.
        let (_, raster) = &others()[1];
        let raster = String::from_utf8_lossy(&raster[..raster.len() - 75])
            .replace("WIDTH 3\nHEIGHT 1", "WIDTH 1\nHEIGHT 3");
        let rows = [
            raster.into_bytes(),
            others()[1].1[others()[1].1.len() - 75..].to_vec(),
        ]
        .concat();
        let e = pcd::revised(
            &rows,
            &CloudChanges {
                removed: vec![0],
                ..CloudChanges::default()
            },
        );
        assert!(e.unwrap_err().to_string().contains("raster"));
    }

    /// Two points of LAS 1.2 and one that is withheld, at steps of a hundredth; the second is a second return.
    #[cfg(feature = "lidar")]
    #[test]
    fn las_keeps_records_attributes_and_what_is_withheld() {
        let cloud = points::PointCloud {
            positions: vec![
                DVec3::new(1.5, 2.0, 3.0),
                DVec3::new(4.0, 5.0, 6.0),
                DVec3::new(7.0, 8.0, 9.5),
                DVec3::ONE,
            ],
            ..Default::default()
        };
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.las");
        points::save(&path, &cloud).unwrap();
        let mut bytes = fs::read(&path).unwrap();
        let at = u32::from_le_bytes(bytes[96..100].try_into().unwrap()) as usize;
        for (n, point) in bytes[at..].chunks_exact_mut(20).enumerate() {
            point[12] = 50 + n as u8;
            point[14] = if n == 2 { 0b010_010 } else { 0b001_001 };
            point[15] = if n == 3 { 0x80 } else { 0 };
        }
        bytes.extend(b"what follows the points");
        fs::write(&path, &bytes).unwrap();
        assert_eq!(revised("a.las", &bytes, &CloudChanges::default()).0, bytes);
        let (new, cloud) = revised("a.las", &bytes, &changes());
        for (found, expected) in
            cloud
                .positions
                .iter()
                .zip([[7.0, 0.25, -1.5], [7.0, 8.0, 9.5], [9.0, 0.25, -1.5]])
        {
            assert!(found.distance(expected.into()) < 1e-6, "{found}");
        }
        let points: Vec<&[u8]> = new[at..].chunks_exact(20).take(4).collect();
        assert_eq!(
            points[1],
            &bytes[at + 40..at + 60],
            "what was not edited stays to the bit"
        );
        assert_eq!(points[2], &bytes[at + 60..at + 80], "what is withheld stays");
        let told: Vec<u8> = points.iter().map(|p| p[12]).collect();
        assert_eq!(told, [51, 52, 53, 52]);
        let count = |at: usize| u32::from_le_bytes(new[at..at + 4].try_into().unwrap());
        assert_eq!([count(107), count(111), count(115)], [4, 2, 2]);
        let high = f64::from_le_bytes(new[179..187].try_into().unwrap());
        assert!((high - 9.0).abs() < 1e-6 && new.ends_with(b"what follows the points"));
        // Compressed points are refused.
        points::save(&directory.path().join("a.laz"), &cloud).unwrap();
        let e = save_revised(
            &directory.path().join("a.laz"),
            &changes(),
            &directory.path().join("b.laz"),
            &ReadLimits::default(),
        );
        assert!(e.unwrap_err().to_string().contains("unpack the scan to .las"));
    }

    #[test]
    fn without_changes_files_are_the_same_to_the_bit() {
        for (name, bytes) in files() {
            assert_eq!(revised(name, &bytes, &CloudChanges::default()).0, bytes, "{name}");
        }
    }

    #[test]
    fn rows_move_go_and_come_and_the_others_stay() {
        for (name, bytes) in files() {
            let (new, cloud) = revised(name, &bytes, &changes());
            let places: Vec<_> = cloud.positions.iter().map(|p| p.to_array()).collect();
            assert_eq!(
                places,
                [[7.0, 0.25, -1.5], [7.0, 8.0, 9.5], [9.0, 0.25, -1.5]],
                "{name}"
            );
            assert_eq!(
                cloud.normals.unwrap(),
                [DVec3::Z, DVec3::NEG_Z, DVec3::Z],
                "{name}"
            );
            let kept = [&b"comment kept"[..], b"# kept"];
            assert!(
                kept.iter().any(|k| new.windows(k.len()).any(|w| w == *k)),
                "{name}"
            );
            // The attributes: of the point that moved its own, of the new one those of the third.
            let tags: Vec<u8> = match name {
                "little.ply" | "big.ply" => {
                    let body = &new[new.len() - 3 * 37..];
                    body.iter().step_by(37).copied().collect()
                }
                "ascii.ply" => String::from_utf8(new)
                    .unwrap()
                    .lines()
                    .rev()
                    .take(3)
                    .map(|l| l.split(' ').next().unwrap().parse().unwrap())
                    .collect::<Vec<u8>>()
                    .into_iter()
                    .rev()
                    .collect(),
                _ => String::from_utf8(new)
                    .unwrap()
                    .lines()
                    .rev()
                    .take(3)
                    .map(|l| l.rsplit(' ').next().unwrap().parse().unwrap())
                    .collect::<Vec<u8>>()
                    .into_iter()
                    .rev()
                    .collect(),
            };
            assert_eq!(tags, [11, 12, 12], "{name}");
        }
    }

    #[test]
    fn what_cannot_be_written_back_is_refused() {
        let directory = tempfile::tempdir().unwrap();
        let told = |name: &str, bytes: &[u8], output: &str| {
            let like = directory.path().join(name);
            fs::write(&like, bytes).unwrap();
            let output = directory.path().join(output);
            let e = save_revised(&like, &changes(), &output, &ReadLimits::default()).unwrap_err();
            assert!(!output.exists());
            e.to_string()
        };
        let faces = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n\
                      property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
        assert!(told("faces.ply", faces, "out.ply").contains("vertices alone"));
        let whole = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty int x\nproperty int y\nproperty int z\nend_header\n0 0 0\n1 0 0\n0 1 0\n";
        assert!(told("whole.ply", whole, "out.ply").contains("float or double"));
        let (name, bytes) = &files()[1];
        assert!(told(name, bytes, "out.xyz").contains("format of the scan"));
        assert!(told("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\np 1 2 3\n", "out.obj").contains("vertices alone"));
    }
}
