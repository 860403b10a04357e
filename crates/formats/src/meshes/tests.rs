use glam::DVec3;

use super::*;
use crate::atomic::tests::survives_a_full_disk;
use crate::{ReadLimits, points};

/// A tetrahedron with outward faces.
fn tetrahedron(offset: DVec3) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let vertices = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z]
        .map(|v| v + offset)
        .to_vec();
    (vertices, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
}

fn bytes(mesh: &Mesh, format: MeshFormat) -> Vec<u8> {
    let mut out = Vec::new();
    write(&mut out, mesh, format).unwrap();
    out
}

#[test]
fn ply_and_obj_come_back_through_the_readers() {
    let (vertices, triangles) = tetrahedron(DVec3::new(0.1, 0.25, -3.0));
    let colors = [[1, 2, 3]; 4];
    for colors in [None, Some(&colors[..])] {
        let mesh = Mesh {
            vertices: &vertices,
            triangles: &triangles,
            colors,
            unit: Unit::Unknown,
        };
        let limits = ReadLimits::default();
        let ply = points::parse_ply(&bytes(&mesh, MeshFormat::Ply), &limits).unwrap();
        let obj = points::parse_obj(&bytes(&mesh, MeshFormat::Obj), &limits).unwrap();
        for cloud in [ply, obj] {
            assert_eq!((cloud.positions.len(), cloud.face_count), (4, 4));
            for (p, v) in cloud.positions.iter().zip(&vertices) {
                // Single precision of numbers below 4; OBJ prints those, so its digits are an f32's too.
                assert!((*p - *v).abs().max_element() < 2e-7, "{p} {v}");
            }
            let corner = cloud.normals.unwrap()[0];
            assert!(
                (corner + DVec3::ONE.normalize()).length() < 1e-6,
                "outward at the right angle: {corner}"
            );
        }
    }
}

#[test]
fn the_bytes_of_a_ply_are_those_that_simple_readers_take() {
    let (vertices, triangles) = tetrahedron(DVec3::ZERO);
    let ply = bytes(
        &Mesh {
            vertices: &vertices,
            triangles: &triangles[..1],
            colors: None,
            unit: Unit::Unknown,
        },
        MeshFormat::Ply,
    );
    let header = "ply\nformat binary_little_endian 1.0\ncomment isoclay\nelement vertex 4\nproperty float x\n\
                  property float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\n\
                  end_header\n";
    assert!(ply.starts_with(header.as_bytes()));
    assert_eq!(ply.len(), header.len() + 4 * 12 + 13);
    assert_eq!(ply[ply.len() - 13..], [3, 0, 0, 0, 0, 2, 0, 0, 0, 1, 0, 0, 0]);
}

#[test]
fn stl_holds_normals_and_corners() {
    let (vertices, triangles) = tetrahedron(DVec3::ZERO);
    let stl = bytes(
        &Mesh {
            vertices: &vertices,
            triangles: &triangles,
            colors: None,
            unit: Unit::Unknown,
        },
        MeshFormat::Stl,
    );
    assert_eq!(stl.len(), 84 + 4 * 50);
    assert!(!stl.starts_with(b"solid"));
    assert_eq!(stl[80..84], 4u32.to_le_bytes());
    let number = |i: usize| f32::from_le_bytes(stl[84 + 4 * i..88 + 4 * i].try_into().unwrap());
    let first: Vec<f32> = (0..12).map(number).collect();
    assert_eq!(first, [0., 0., -1., 0., 0., 0., 0., 1., 0., 1., 0., 0.]);
}

/// A part of 1 mm in map coordinates: single precision would round by 0.25 there.
#[test]
fn far_from_the_origin_coordinates_are_double() {
    let offset = DVec3::new(5_400_000.0, 350_000.1, 12.0);
    let (vertices, triangles) = tetrahedron(offset);
    let mesh = Mesh {
        vertices: &vertices,
        triangles: &triangles,
        colors: None,
        unit: Unit::Unknown,
    };
    let ply = points::parse_ply(&bytes(&mesh, MeshFormat::Ply), &ReadLimits::default()).unwrap();
    let obj = points::parse_obj(&bytes(&mesh, MeshFormat::Obj), &ReadLimits::default()).unwrap();
    assert_eq!(ply.positions, vertices);
    assert_eq!(obj.positions, vertices);
    let directory = tempfile::tempdir().unwrap();
    let notes = save(&directory.path().join("a.stl"), &mesh).unwrap();
    assert!(notes[0].contains("STL rounds"), "{notes:?}");
}

#[test]
fn points_with_colours_and_normals_come_back() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("map.ply");
    let points = [DVec3::new(1.0, 2.0, 3.0), DVec3::new(-1.0, 0.5, 0.0)];
    save_points(
        &path,
        &points,
        Some(&[DVec3::X, DVec3::Y]),
        Some(&[[255, 0, 0], [0, 255, 0]]),
    )
    .unwrap();
    let cloud = points::read(&path, &ReadLimits::default()).unwrap();
    assert_eq!(cloud.positions, points);
    assert_eq!(cloud.normals.unwrap(), [DVec3::X, DVec3::Y]);
    assert!(std::fs::read(&path).unwrap().ends_with(&[0, 255, 0]));
    assert!(save_points(&directory.path().join("map.stl"), &points, None, None).is_err());
}

#[test]
fn an_unknown_name_says_what_is_supported() {
    for name in ["a.step", "a", "a.ply.gz"] {
        let e = MeshFormat::from_path(Path::new(name)).unwrap_err().to_string();
        assert!(e.starts_with(name) && e.contains(".ply, .stl, .obj, .glb"), "{e}");
    }
}

#[test]
fn a_disk_that_fills_at_any_offset_keeps_the_old_mesh() {
    let (vertices, triangles) = tetrahedron(DVec3::ZERO);
    let mesh = Mesh {
        vertices: &vertices,
        triangles: &triangles,
        colors: None,
        unit: Unit::Unknown,
    };
    for format in [MeshFormat::Ply, MeshFormat::Stl, MeshFormat::Obj] {
        survives_a_full_disk(|out| write(out, &mesh, format));
    }
}

#[test]
#[should_panic(expected = "vertex index Some(4) with 4 vertices")]
fn an_index_out_of_range_is_a_broken_invariant() {
    let (vertices, _) = tetrahedron(DVec3::ZERO);
    bytes(
        &Mesh {
            vertices: &vertices,
            triangles: &[[0, 1, 4]],
            colors: None,
            unit: Unit::Unknown,
        },
        MeshFormat::Ply,
    );
}
