use glam::DVec3;

use super::*;
use crate::limits::Budget;
use crate::raw::Wanted;
use crate::{ReadLimits, points};

const LIMITS: ReadLimits = ReadLimits { max_bytes: 1 << 20 };

/// A box of 2 × 3 × 4 about (10, 20, 30), outward.
fn box_mesh() -> TriangleMesh {
    let vertices = (0..8)
        .map(|i| {
            DVec3::new(
                9.0 + 2.0 * f64::from(i & 1),
                18.5 + 1.5 * f64::from(i & 2),
                28.0 + f64::from(i & 4),
            )
        })
        .collect();
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    TriangleMesh {
        vertices,
        triangles: quads
            .iter()
            .flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]])
            .collect(),
        ..Default::default()
    }
}

/// Six times the volume, by the divergence theorem.
fn six_volumes(mesh: &TriangleMesh) -> f64 {
    let at = |v: u32| mesh.vertices[v as usize];
    mesh.triangles
        .iter()
        .map(|t| at(t[0]).dot(at(t[1]).cross(at(t[2]))))
        .sum()
}

#[test]
fn ply_obj_and_stl_come_back_as_the_mesh_that_was_written() {
    let directory = tempfile::tempdir().unwrap();
    let mut mesh = box_mesh();
    mesh.colors = Some((0..8).map(|i| [i, 100 + i, 255]).collect());
    for name in ["box.ply", "box.obj", "box.stl"] {
        let path = directory.path().join(name);
        save(&path, &mesh.as_mesh()).unwrap();
        let back = read(&path, &LIMITS).unwrap();
        assert_eq!(back.colors.is_some(), name == "box.ply");
        assert_eq!(
            (back.face_count, back.notes.len()),
            (12, 0),
            "{name}: {:?}",
            back.notes
        );
        // STL numbers vertices as they come.
        if name != "box.stl" {
            assert_eq!(
                (&back.vertices, &back.triangles),
                (&mesh.vertices, &mesh.triangles),
                "{name}"
            );
        }
        let corners = |m: &TriangleMesh| -> Vec<_> {
            m.triangles
                .iter()
                .map(|t| t.map(|v| m.vertices[v as usize]))
                .collect()
        };
        assert_eq!(
            (corners(&back), back.vertices.len()),
            (corners(&mesh), 8),
            "{name}"
        );
        assert_eq!(six_volumes(&back), 6.0 * 24.0, "{name}");
        let cloud = points::read(&path, &LIMITS).unwrap();
        assert_eq!(cloud.positions, back.vertices);
        assert_eq!(cloud.normal_source, points::NormalSource::Faces);
    }
}

#[test]
fn colours_of_ply_and_obj_are_bytes_whatever_they_are_stored_as() {
    let ply = |kind: &str, values: [&str; 3]| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty {kind} red\nproperty {kind} green\n\
             property {kind} blue\nproperty float y\nproperty float z\nelement face 1\n\
             property list uchar int vertex_indices\nend_header\n0 {0} 0 0\n1 {1} 0 0\n0 {2} 1 0\n3 0 1 2\n",
            values[0], values[1], values[2]
        )
    };
    let obj = |values: [&str; 3]| {
        let [a, b, c] = values;
        format!("v 0 0 0 {a}\nv 1 0 0 {b}\nv 0 1 0 {c}\nf 1 2 3\n")
    };
    let expected = vec![[0, 0, 0], [255, 0, 51], [0, 255, 102]];
    let bytes = ["0 0 0", "255 0 51", "0 255 102"];
    let shares = ["0 0 0", "1 0 0.2", "0 1 0.4"];
    let wide = ["0 0 0", "65535 0 13107", "0 65535 26214"];
    let directory = tempfile::tempdir().unwrap();
    for (name, text) in [
        ("a.ply", ply("uchar", bytes)),
        ("a.ply", ply("float", shares)),
        ("a.ply", ply("ushort", wide)),
        ("a.obj", obj(bytes)),
        ("a.obj", obj(shares)),
    ] {
        let path = directory.path().join(name);
        std::fs::write(&path, &text).unwrap();
        assert_eq!(read(&path, &LIMITS).unwrap().colors.unwrap(), expected, "{text}");
    }
}

#[test]
fn polygons_that_fold_are_cut_so_that_they_do_not() {
    // An arrow head whose first corner does not see the others; corner normals go with their corners.
    let text = "v 2 -1 0\nv 0 3 0\nv -2 -1 0\nv 0 0 0\nvn 1 0 0\nvn 0 0 1\nf 1//1 2//2 3//2 4//2\n";
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("arrow.obj");
    std::fs::write(&path, text).unwrap();
    let mesh = read(&path, &LIMITS).unwrap();
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|v| mesh.vertices[v as usize]);
        assert!((b - a).cross(c - a).z > 0.0, "{t:?}");
    }
    let cloud = points::read(&path, &LIMITS).unwrap();
    let normals = cloud.normals.unwrap();
    assert_eq!(normals, [DVec3::X, DVec3::Z, DVec3::Z, DVec3::Z]);
}

#[test]
fn what_a_mesh_leaves_out_is_counted() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan 0 0\nv 5 5 5\nf 1 2 3\nf 1 2 4\nf 1 1 2\nf 1 2\n";
    let raw = obj::parse(text.as_bytes(), Wanted::Mesh, &mut Budget::new(&LIMITS)).unwrap();
    let mesh = triangle_mesh::finish(raw, &mut Budget::new(&LIMITS)).unwrap();
    assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (3, 1));
    assert_eq!(
        (
            mesh.face_count,
            mesh.invalid_faces,
            mesh.degenerate_faces,
            mesh.unused_vertices
        ),
        (4, 1, 2, 2)
    );
    assert_eq!(mesh.notes.len(), 3);
    let raw = obj::parse(b"v 0 0 0\n", Wanted::Mesh, &mut Budget::new(&LIMITS)).unwrap();
    let e = triangle_mesh::finish(raw, &mut Budget::new(&LIMITS)).unwrap_err();
    assert!(e.to_string().contains("0 of 0"), "{e}");
}

#[test]
fn a_unit_is_stated_once() {
    let mut mesh = box_mesh();
    mesh.to_mm(Unit::Metre).unwrap();
    assert_eq!((mesh.unit, mesh.vertices[0].x), (Unit::Millimetre, 9000.0));
    assert!(mesh.to_mm(Unit::Metre).unwrap_err().to_string().contains("in mm"));
}

const FACET: &str =
    "facet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 1 0 0\n  vertex 0 1 0\n endloop\nendfacet\n";

#[test]
fn ascii_stl_is_read_in_any_case_and_layout() {
    let plain = format!("solid a facet of words\n{FACET}endsolid a\n");
    for text in [
        plain.clone(),
        plain.to_uppercase(),
        plain.replace('\n', "\r\n"),
        plain.replace('\n', "\r"),
        format!("solid\n{}\nendsolid", FACET.replace('\n', " ")),
        format!("solid a\nendsolid a\n{plain}"),
    ] {
        let mesh = parse_stl(text.as_bytes(), &LIMITS).unwrap();
        assert_eq!(
            (mesh.triangles.as_slice(), mesh.vertices[1]),
            (&[[0, 1, 2]][..], DVec3::X),
            "{text}"
        );
        assert!(mesh.notes.is_empty());
    }
    let open = parse_stl(format!("solid\n{FACET}").as_bytes(), &LIMITS).unwrap();
    assert!(open.notes[0].contains("endsolid"));
}

#[test]
fn stl_faults_name_the_place_and_the_value() {
    let text =
        |from: &str, to: &str| format!("solid\n{}endsolid\n", FACET.replacen(from, to, 1)).into_bytes();
    let mut cut = vec![0; 84 + 50];
    cut[80] = 2;
    for (file, part) in [
        (
            text("vertex 1 0 0", "vertex 1 0"),
            "line 5: \"vertex\" stands where it cannot",
        ),
        (
            text("vertex 1 0 0", "vertex 1 0 no"),
            "line 5: \"no\" is not a number",
        ),
        (text(" outer loop\n", ""), "line 3: \"vertex\""),
        (text(" endloop\n", ""), "line 7: \"endfacet\""),
        (b"solid x\nendsolid x\n".to_vec(), "0 of 0"),
        (cut, "2 triangles needs 184 bytes, 134 are there"),
        (vec![0; 83], "needs 84 bytes"),
        (b"neither".to_vec(), "binary STL"),
    ] {
        let e = parse_stl(&file, &LIMITS).unwrap_err().to_string();
        assert!(e.contains(part), "{part}: {e}");
    }
}

#[test]
fn binary_stl_that_starts_with_solid_is_known_by_its_length() {
    let mesh = box_mesh();
    let mut bytes = Vec::new();
    write(&mut bytes, &mesh.as_mesh(), MeshFormat::Stl).unwrap();
    bytes[..5].copy_from_slice(b"solid");
    assert_eq!(parse_stl(&bytes, &LIMITS).unwrap().triangles.len(), 12);
    // Both zeros are one place.
    bytes[84 + 12..84 + 16].copy_from_slice(&(-0.0f32).to_le_bytes());
    bytes[84 + 50 + 12..84 + 50 + 16].copy_from_slice(&0f32.to_le_bytes());
    let mesh = parse_stl(&bytes, &LIMITS).unwrap();
    assert_eq!(mesh.triangles[0][0], mesh.triangles[1][0]);
    bytes[0] = b'-';
    bytes.extend([7; 9]);
    assert!(parse_stl(&bytes, &LIMITS).unwrap().notes[0].contains("9 bytes"));
}

#[test]
fn corners_are_counted_against_the_ceiling() {
    let mut bytes = Vec::new();
    write(&mut bytes, &box_mesh().as_mesh(), MeshFormat::Stl).unwrap();
    let e = parse_stl(&bytes, &ReadLimits { max_bytes: 10_000 }).unwrap_err();
    assert!(matches!(e, Fault::Limit { .. }), "{e}");
}
