use super::*;
use crate::ReadLimits;
use crate::meshes::{self, Mesh, MeshFormat, TriangleMesh};

const LIMITS: ReadLimits = ReadLimits { max_bytes: 1 << 20 };

fn read(document: &str) -> Result<TriangleMesh, Fault> {
    meshes::parse_gltf(document.as_bytes(), &LIMITS)
}

/// A document over one buffer; `nodes` and what follows are the caller's.
fn document(rest: &str, buffer: &[u8]) -> String {
    use base64::Engine;
    let text = base64::engine::general_purpose::STANDARD.encode(buffer);
    format!(
        "{{\"asset\":{{\"version\":\"2.0\"}},{rest},\"buffers\":[{{\"byteLength\":{},\"uri\":\"data:;base64,{text}\"}}]}}",
        buffer.len()
    )
}

/// Four points of a unit square and six indices of every size.
fn square() -> Vec<u8> {
    let mut bytes = Vec::new();
    for x in [0f32, 0., 0., 1., 0., 0., 0., 1., 0., 1., 1., 0.] {
        bytes.extend(x.to_le_bytes());
    }
    let list = [0u8, 1, 2, 2, 1, 3];
    bytes.extend(list);
    bytes.extend([0; 2]);
    bytes.extend(list.iter().flat_map(|i| u16::from(*i).to_le_bytes()));
    bytes.extend(list.iter().flat_map(|i| u32::from(*i).to_le_bytes()));
    bytes
}

const ACCESSORS: &str = "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\"},\
     {\"bufferView\":1,\"componentType\":5121,\"count\":6,\"type\":\"SCALAR\"},\
     {\"bufferView\":2,\"componentType\":5123,\"count\":6,\"type\":\"SCALAR\"},\
     {\"bufferView\":3,\"byteOffset\":12,\"componentType\":5125,\"count\":3,\"type\":\"SCALAR\"}],\
     \"bufferViews\":[{\"buffer\":0,\"byteLength\":48},{\"buffer\":0,\"byteOffset\":48,\"byteLength\":6},\
     {\"buffer\":0,\"byteOffset\":56,\"byteLength\":12},{\"buffer\":0,\"byteOffset\":68,\"byteLength\":24}]";

fn scene(nodes: &str, primitive: &str) -> String {
    document(
        &format!(
            "\"nodes\":[{nodes}],\"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":0}}{primitive}}}]}}],{ACCESSORS}"
        ),
        &square(),
    )
}

fn normals(mesh: &TriangleMesh) -> Vec<DVec3> {
    mesh.triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| mesh.vertices[v as usize]);
            (b - a).cross(c - a).normalize()
        })
        .collect()
}

#[test]
fn indices_of_three_sizes_strips_fans_and_plain_lists_are_triangles() {
    for (primitive, count) in [
        (",\"indices\":1", 2),
        (",\"indices\":2", 2),
        (",\"indices\":3", 1),
        (",\"mode\":4", 1),
        (",\"mode\":5", 2),
        (",\"mode\":6", 2),
    ] {
        let mesh = read(&scene("{\"mesh\":0}", primitive)).unwrap();
        assert_eq!(mesh.triangles.len(), count, "{primitive}");
        let expected = if primitive.contains('6') {
            [1.0, -1.0]
        } else {
            [1.0, 1.0]
        };
        for (n, z) in normals(&mesh).iter().zip(expected) {
            assert_eq!(n.z, z, "{primitive}");
        }
        let furthest = mesh.vertices.iter().map(|v| v.x).fold(0.0, f64::max);
        assert_eq!((mesh.unit, furthest), (Unit::Millimetre, 1000.0));
    }
}

#[test]
fn transforms_of_nodes_multiply_and_a_mirror_keeps_faces_outward() {
    let child = "{\"mesh\":0,\"translation\":[1,0,0],\"scale\":[1,2,1]}";
    let turned = format!("{{\"children\":[1],\"rotation\":[0,0,0.70710678,0.70710678]}},{child}");
    let matrix = format!("{{\"children\":[1],\"matrix\":[0,1,0,0,-1,0,0,0,0,0,1,0,0,0,0,1]}},{child}");
    for nodes in [turned, matrix] {
        let mesh = read(&scene(&nodes, "")).unwrap();
        for (v, expected) in mesh
            .vertices
            .iter()
            .zip([[0.0, 1000.0], [0.0, 2000.0], [-2000.0, 1000.0]])
        {
            assert!(
                (*v - DVec3::new(expected[0], expected[1], 0.0)).length() < 1e-9,
                "{v}"
            );
        }
    }
    let mirrored = read(&scene("{\"mesh\":0,\"scale\":[-1,1,1]}", "")).unwrap();
    assert_eq!(normals(&mirrored), [DVec3::Z]);
    // Two instances side by side share an edge.
    let twice = read(&scene(
        "{\"mesh\":0},{\"mesh\":0,\"translation\":[1,0,0]}",
        ",\"mode\":5",
    ))
    .unwrap();
    assert_eq!((twice.triangles.len(), twice.vertices.len()), (4, 6));
    assert!(twice.notes[0].contains("2 vertices"), "{:?}", twice.notes);
}

#[test]
fn normalized_positions_and_colours_are_shares_of_their_range() {
    let bytes = [0u8, 0, 0, 0, 255, 0, 51, 0, 0, 255, 0, 0];
    let rest = "\"nodes\":[{\"mesh\":0}],\
        \"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"COLOR_0\":0}}]}],\
        \"accessors\":[{\"bufferView\":0,\"componentType\":5121,\"normalized\":true,\"count\":3,\"type\":\"VEC3\"}],\
        \"bufferViews\":[{\"buffer\":0,\"byteLength\":12,\"byteStride\":4}]";
    let mesh = read(&document(rest, &bytes)).unwrap();
    assert_eq!(mesh.vertices[1], DVec3::new(1000.0, 0.0, 200.0));
    assert_eq!(mesh.colors.unwrap(), [[0, 0, 0], [255, 0, 51], [0, 255, 0]]);
}

#[test]
fn buffers_beside_the_document_are_read_and_others_are_not() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.gltf");
    std::fs::create_dir(directory.path().join("parts")).unwrap();
    std::fs::write(directory.path().join("parts/a b.bin"), square()).unwrap();
    let write = |uri: &str| {
        let text = scene("{\"mesh\":0}", ",\"indices\":1");
        let start = text.find("data:").unwrap();
        let end = start + text[start..].find('"').unwrap();
        std::fs::write(&path, format!("{}{uri}{}", &text[..start], &text[end..])).unwrap();
        meshes::read(&path, &LIMITS)
    };
    assert_eq!(write("parts/a%20b.bin").unwrap().triangles.len(), 2);
    for uri in [
        "../a.bin",
        "/etc/passwd",
        "file:///etc/passwd",
        "C:/a.bin",
        "parts/%2e%2e/%2e%2e/a.bin",
        "a%2",
    ] {
        let e = write(uri).unwrap_err().to_string();
        assert!(e.contains("the place of a buffer"), "{uri}: {e}");
    }
    assert!(write("lost.bin").unwrap_err().to_string().contains("lost.bin"));
}

#[test]
fn contradictions_and_cycles_are_named() {
    let with = |from: &str, to: &str| scene("{\"mesh\":0}", ",\"indices\":1").replacen(from, to, 1);
    let many = "{\"children\":[1,1]},{\"mesh\":0}";
    for (text, part) in [
        (
            scene("{\"children\":[1]},{\"children\":[0],\"mesh\":0}", ""),
            "0 of 0",
        ),
        (scene(many, ""), "node 1: it has two parents"),
        (
            with("\"nodes\"", "\"scenes\":[{\"nodes\":[0,0]}],\"nodes\""),
            "node 0: it has two parents",
        ),
        (
            with("\"nodes\"", "\"scenes\":[{\"nodes\":[7]}],\"nodes\""),
            "node 7: the document has 1",
        ),
        (
            with("\"nodes\"", "\"scene\":3,\"scenes\":[{}],\"nodes\""),
            "default scene is 3 of 1",
        ),
        (with("\"mesh\":0", "\"mesh\":9"), "mesh 9 of 1"),
        (with("\"indices\":1", "\"indices\":8"), "accessor 8"),
        (with("\"indices\":1", "\"indices\":0"), "no whole numbers"),
        (with("\"count\":4", "\"count\":3"), "vertex 3 of 3"),
        (
            with("\"count\":4", "\"count\":1000000000000"),
            "needs 12000000000000",
        ),
        (with("\"count\":4", "\"sparse\":{},\"count\":4"), "sparse"),
        (with("5126", "5124"), "component type 5124"),
        (with("\"bufferView\":0,", ""), "compressed"),
        (with("\"bufferView\":0,", "\"bufferView\":7,"), "buffer view 7"),
        (
            with("\"byteLength\":48", "\"byteLength\":48,\"byteStride\":8"),
            "a stride of 8",
        ),
        (
            with(
                "\"byteLength\":48",
                "\"byteLength\":18446744073709551615,\"byteOffset\":2",
            ),
            "accessor 0",
        ),
        (with("\"2.0\"", "\"1.0\""), "version of glTF is \"1.0\""),
        (
            "{\"asset\":{\"version\":\"1.0\"},\"accessors\":{\"a\":{\"count\":1}},\"nodes\":{}}".into(),
            "version of glTF is \"1.0\"",
        ),
        (with("\"2.0\"", "0.8"), "version of glTF is \"0.8\""),
        (
            with(
                "\"nodes\"",
                "\"extensionsRequired\":[\"KHR_draco_mesh_compression\"],\"nodes\"",
            ),
            "KHR_draco",
        ),
        (with("base64,", "base64,*"), "not base64"),
        (with("\"nodes\"", "nodes"), "JSON"),
    ] {
        let e = read(&text).unwrap_err().to_string();
        assert!(e.contains(part), "{part}: {e}");
    }
}

#[test]
fn a_small_text_cannot_become_many_objects_beyond_the_ceiling() {
    let nodes = vec!["{}"; 3000].join(",");
    let e = read(&scene(&nodes, "")).unwrap_err();
    assert!(
        matches!(
            e,
            Fault::Limit {
                what: "the document",
                ..
            }
        ),
        "{e}"
    );
    let deep = format!("{{\"asset\":{}", "[".repeat(10_000));
    assert!(read(&deep).is_err());
}

/// An octahedron of 1 mm; far away, where floats are 0.25 apart, the node holds the offset.
fn octahedron(offset: DVec3, unit: Unit) -> TriangleMesh {
    let axes = [
        DVec3::X,
        DVec3::Y,
        DVec3::NEG_X,
        DVec3::NEG_Y,
        DVec3::Z,
        DVec3::NEG_Z,
    ];
    TriangleMesh {
        vertices: axes.map(|a| a + offset).to_vec(),
        triangles: (0..4)
            .flat_map(|i| [[i, (i + 1) % 4, 4], [(i + 1) % 4, i, 5]])
            .collect(),
        unit,
        ..Default::default()
    }
}

#[test]
fn what_is_written_comes_back_in_millimetres_near_and_far() {
    for (offset, slack) in [(DVec3::ZERO, 1e-7), (DVec3::new(5.4e6, 3.5e5, 12.0), 1e-7)] {
        for (unit, scale) in [
            (Unit::Millimetre, 1.0),
            (Unit::Metre, 1000.0),
            (Unit::Unknown, 1000.0),
        ] {
            let mut mesh = octahedron(offset, unit);
            for colors in [None, Some(vec![[9, 99, 255]; 6])] {
                mesh.colors = colors;
                for format in [MeshFormat::Glb, MeshFormat::Gltf] {
                    let mut bytes = Vec::new();
                    meshes::write(&mut bytes, &mesh.as_mesh(), format).unwrap();
                    let back = meshes::parse_gltf(&bytes, &LIMITS).unwrap();
                    assert_eq!((&back.triangles, &back.colors), (&mesh.triangles, &mesh.colors));
                    for (a, b) in back.vertices.iter().zip(&mesh.vertices) {
                        let error = (*a - *b * scale).abs().max_element();
                        assert!(error <= slack * scale, "{offset} {unit}: {error}");
                    }
                }
            }
        }
    }
}

/// A buffer is bare numbers: its first bytes may be those of gzip.
#[test]
fn a_buffer_beside_the_document_is_taken_as_it_is() {
    let directory = tempfile::tempdir().unwrap();
    let mut buffer = square();
    buffer[..4].copy_from_slice(&[0x1f, 0x8b, 0x08, 0x3f]);
    let text = scene("{\"mesh\":0}", ",\"indices\":1");
    let (head, tail) = text.split_once("data:").unwrap();
    let tail = tail.split_once('"').unwrap().1;
    let path = directory.path().join("a.gltf");
    std::fs::write(&path, format!("{head}a.bin\"{tail}")).unwrap();
    std::fs::write(directory.path().join("a.bin"), &buffer).unwrap();
    let mesh = meshes::read(&path, &LIMITS).unwrap();
    assert_eq!(
        mesh.vertices[0].x,
        f64::from(f32::from_le_bytes([0x1f, 0x8b, 0x08, 0x3f])) * 1000.0
    );
}

#[test]
fn a_container_cut_anywhere_is_refused() {
    let mesh = octahedron(DVec3::ZERO, Unit::Metre);
    let mut bytes = Vec::new();
    meshes::write(
        &mut bytes,
        &Mesh {
            colors: None,
            ..mesh.as_mesh()
        },
        MeshFormat::Glb,
    )
    .unwrap();
    for length in 0..bytes.len() {
        assert!(meshes::parse_gltf(&bytes[..length], &LIMITS).is_err(), "{length}");
    }
    bytes[4] = 1;
    let e = meshes::parse_gltf(&bytes, &LIMITS).unwrap_err().to_string();
    assert!(e.contains("container is 1"), "{e}");
}
