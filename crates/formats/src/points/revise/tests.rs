use std::fs;

use super::*;
use crate::points;

pub(super) fn changes() -> CloudChanges {
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

pub(super) fn revised(name: &str, bytes: &[u8], changes: &CloudChanges) -> (Vec<u8>, points::PointCloud) {
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
fn columns_of_text_stay_where_their_names_are_and_commas_decimal() {
    let text = b"id;Nz;Ny;Nx;Z;Y;X\n7;1;0;0;0,5;1,5;2,5\n8;1;0;0;1;2;3\n";
    let changes = CloudChanges {
        moved: vec![Placed {
            row: 0,
            position: DVec3::new(-4.5, 0.25, 6.0),
            normal: DVec3::X,
        }],
        ..Default::default()
    };
    let new = xyz::revised(text, &changes).unwrap();
    let expected = "id;Nz;Ny;Nx;Z;Y;X\n7;0,0;0,0;1,0;6,0;0,25;-4,5\n8;1;0;0;1;2;3\n";
    assert_eq!(String::from_utf8(new).unwrap(), expected);
}

/// A camera and a material name no vertex; an edge does.
#[test]
fn elements_that_name_no_vertices_are_copied() {
    for (format, body) in [
        ("ascii", b"1 2 3\n4 5 6\n7 8 9.5\n0.5 0.25 7\n3 4 5\n".to_vec()),
        ("binary_little_endian", {
            let numbers = [1.0f32, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.5, 0.5, 0.25];
            let mut out: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
            out.extend(7i32.to_le_bytes());
            out.extend([3, 4, 5]);
            out
        }),
    ] {
        let head = format!(
            "ply\nformat {format} 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement camera 1\n\
             property float view_px\nproperty float view_py\nproperty int viewportx\nelement material 1\nproperty uchar \
             red\nproperty uchar green\nproperty uchar blue\nend_header\n"
        );
        let tail = if format == "ascii" { 17 } else { 15 };
        let file = [head.as_bytes(), &body[..]].concat();
        let (new, cloud) = revised("camera.ply", &file, &changes());
        let places: Vec<_> = cloud.positions.iter().map(|p| p.to_array()).collect();
        assert_eq!(
            places,
            [[7.0, 0.25, -1.5], [7.0, 8.0, 9.5], [9.0, 0.25, -1.5]],
            "{format}"
        );
        assert!(new.ends_with(&body[body.len() - tail..]), "{format}");
    }
    let directory = tempfile::tempdir().unwrap();
    for property in ["list uchar int of", "int vertex1", "int from"] {
        let element = if property == "int from" { "edge" } else { "other" };
        let row = if property.starts_with("list") { "1 0" } else { "0" };
        let file = format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement {element} 1\n\
             property {property}\nend_header\n0 0 0\n1 0 0\n0 1 0\n{row}\n"
        );
        let like = directory.path().join("like.ply");
        fs::write(&like, file).unwrap();
        let output = directory.path().join("out.ply");
        let e = save_revised(&like, &changes(), &output, &ReadLimits::default()).unwrap_err();
        assert!(e.to_string().contains("by number"), "{property}: {e}");
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
