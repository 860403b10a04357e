//! Parts against whole files.

use std::path::PathBuf;

use glam::{DVec2, DVec3};

use super::*;
use crate::points::{read, save};

const POINTS: usize = 60_000;
const MOST: u64 = 100_000;

/// A screw of points with normals, in a file of a name.
fn written(scratch: &Path, name: &str) -> (PathBuf, PointCloud) {
    let place = |n: usize| {
        let around = 20.0 * DVec2::from_angle(n as f64 * 0.01);
        around.extend(n as f64 * 0.001)
    };
    let cloud = PointCloud {
        positions: (0..POINTS).map(place).collect(),
        normals: Some(
            (0..POINTS)
                .map(|n| DVec3::new(place(n).x, place(n).y, 0.0) / 20.0)
                .collect(),
        ),
        ..Default::default()
    };
    let path = scratch.join(name);
    save(&path, &cloud).unwrap();
    let whole = read(&path, &ReadLimits::default()).unwrap();
    (path, whole)
}

/// They are points of the file, from its first to its last, in its order.
fn is_part(part: &CloudPart, whole: &PointCloud) {
    let some = &part.cloud.positions;
    let mut rest = whole.positions.iter();
    assert!(some.iter().all(|p| rest.any(|q| q == p)), "points of its own");
    assert!((500..POINTS / 4).contains(&some.len()), "{} points", some.len());
    let last = |all: &[DVec3]| all[all.len() - 1];
    assert_eq!(
        (some[0], last(some)),
        (whole.positions[0], last(&whole.positions))
    );
    let gap = some
        .windows(2)
        .map(|pair| pair[1].z - pair[0].z)
        .fold(0.0, f64::max);
    assert!(gap < 2.0, "nothing of {gap} of 60");
    assert_eq!(part.cloud.normal_source, whole.normal_source);
    assert_eq!(part.cloud.unit, whole.unit);
    assert!(part.bytes < MOST + HEAD + 64 * 200, "{} bytes", part.bytes);
}

#[test]
fn parts_of_large_files_are_points_from_all_over_them() {
    let scratch = tempfile::tempdir().unwrap();
    let mut names = vec!["a.ply", "a.pcd", "a.xyz"];
    if cfg!(feature = "lidar") {
        names.push("a.las");
    }
    for name in names {
        let (path, whole) = written(scratch.path(), name);
        let part = read_part(&path, &ReadLimits::default(), MOST).unwrap();
        let part = part.unwrap_or_else(|| panic!("{name} is read as a whole"));
        is_part(&part, &whole);
        assert_eq!(part.is_guess, name == "a.xyz");
        let far = part.count.abs_diff(POINTS as u64);
        assert!(
            far <= if part.is_guess { 600 } else { 0 },
            "{name}: {} points",
            part.count
        );
        // A part that is as long is the whole.
        let all = read_part(&path, &ReadLimits::default(), 1 << 30).unwrap();
        assert!(all.is_none());
    }
}

/// Lines, with a count before them or without, in all three formats that have lines.
#[test]
fn parts_of_text_are_whole_lines() {
    let scratch = tempfile::tempdir().unwrap();
    let (_, whole) = written(scratch.path(), "lines.xyz");
    let lines = std::fs::read_to_string(scratch.path().join("lines.xyz")).unwrap();
    let columns = "property double x\nproperty double y\nproperty double z\nproperty double nx\nproperty double ny\nproperty double nz\n";
    let ply = format!(
        "ply\nformat ascii 1.0\nelement vertex {POINTS}\n{columns}element face 0\nproperty list uchar int vertex_indices\nend_header\n"
    );
    let pcd = format!(
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z normal_x normal_y normal_z\nSIZE 8 8 8 8 8 8\nTYPE F F F F F F\nCOUNT 1 1 1 1 1 1\nWIDTH 300\nHEIGHT {}\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {POINTS}\nDATA ascii\n",
        POINTS / 300
    );
    for (name, head) in [("b.ply", ply), ("b.pcd", pcd), ("b.xyz", format!("{POINTS}\n"))] {
        let path = scratch.path().join(name);
        std::fs::write(&path, head + lines.trim_end()).unwrap();
        let part = read_part(&path, &ReadLimits::default(), MOST).unwrap();
        let part = part.unwrap_or_else(|| panic!("{name} is read as a whole"));
        is_part(&part, &whole);
        assert_eq!((part.count, part.is_guess), (POINTS as u64, false), "{name}");
        assert!(part.cloud.notes.is_empty(), "{name}: {:?}", part.cloud.notes);
    }
}

/// Faces are told, not read; what is packed or has no rows is left to be read as a whole, and so is a file that promises more than it has.
#[test]
fn what_cannot_be_read_in_part_is_not() {
    let scratch = tempfile::tempdir().unwrap();
    let path = scratch.path().join("faces.ply");
    let head = |encoding: &str, count: usize| {
        format!(
            "ply\nformat {encoding} 1.0\nelement vertex {count}\nproperty float x\nproperty float y\nproperty float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
        )
    };
    let mut bytes = head("binary_little_endian", POINTS).into_bytes();
    for n in 0..3 * POINTS {
        bytes.extend((n as f32).to_le_bytes());
    }
    for corners in [[0, 1, 2], [1, 2, 3]] {
        bytes.push(3);
        corners.iter().for_each(|n: &i32| bytes.extend(n.to_le_bytes()));
    }
    std::fs::write(&path, &bytes).unwrap();
    let part = read_part(&path, &ReadLimits::default(), MOST).unwrap().unwrap();
    assert_eq!(
        (part.count, part.cloud.face_count, part.cloud.normal_source),
        (POINTS as u64, 2, NormalSource::Faces)
    );

    let none = |what: &str, bytes: &[u8], name: &str| {
        let path = scratch.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let part = read_part(&path, &ReadLimits::default(), MOST);
        assert!(part.unwrap().is_none(), "{what}");
    };
    bytes.truncate(bytes.len() / 2);
    none("a file that is cut", &bytes, "cut.ply");
    let text = head("ascii", POINTS) + &"1 2 3\n".repeat(POINTS) + "3 0 1 2\n3 0 1 2\n";
    none("faces in lines", text.as_bytes(), "faces.ply");
    none(
        "corners of a mesh",
        "v 1 2 3\n".repeat(POINTS).as_bytes(),
        "corners.obj",
    );
    if cfg!(feature = "lidar") {
        for name in ["packed.laz", "packed.e57"] {
            let (path, _) = written(scratch.path(), name);
            assert!(
                read_part(&path, &ReadLimits::default(), 1000).unwrap().is_none(),
                "{name}"
            );
        }
    }
}
