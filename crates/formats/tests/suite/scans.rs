//! Clouds and meshes that other programs wrote (`data/make_scans.py`), against what those programs say they hold.

use std::path::PathBuf;

use formats::{Kind, ReadLimits, detect, meshes, points};
use glam::DVec3;
use serde_json::Value;

fn data(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data")
        .join(name)
}

/// What a file holds, by its name.
fn expected() -> Vec<(String, Value)> {
    let text = std::fs::read(data("scans.json")).unwrap();
    let all: serde_json::Map<String, Value> = serde_json::from_slice(&text).unwrap();
    all.into_iter().collect()
}

fn vectors(list: &Value) -> Vec<DVec3> {
    let three = |v: &Value| DVec3::from_array(std::array::from_fn(|i| v[i].as_f64().unwrap()));
    list.as_array().unwrap().iter().map(three).collect()
}

#[test]
fn clouds_are_what_their_writers_say() {
    let mut count = 0;
    for (name, want) in expected().iter().filter(|(_, v)| v.get("positions").is_some()) {
        let kind = detect(&data(name)).unwrap();
        assert!(matches!(kind, Kind::Cloud(_)), "{name}");
        let cloud = points::read(&data(name), &ReadLimits::default()).unwrap();
        let tolerance = want["tolerance"].as_f64().unwrap();
        let positions = vectors(&want["positions"]);
        assert_eq!(cloud.positions.len(), positions.len(), "{name}");
        for (a, b) in cloud.positions.iter().zip(&positions) {
            assert!((*a - *b).abs().max_element() <= tolerance, "{name}: {a} for {b}");
        }
        assert_eq!(cloud.unit.symbol(), want["unit"].as_str().unwrap(), "{name}");
        let normals = Some(&want["normals"]).filter(|n| !n.is_null()).map(vectors);
        assert_eq!(cloud.normals.is_some(), normals.is_some(), "{name}");
        for (a, b) in cloud.normals.iter().flatten().zip(normals.iter().flatten()) {
            assert!((*a - *b).length() < 1e-6, "{name}: {a} for {b}");
        }
        count += 1;
    }
    assert_eq!(count, 16);
}

#[test]
fn the_notes_of_an_e57_file_name_its_scans() {
    let cloud = points::read(&data("scans_pye57.e57"), &ReadLimits::default()).unwrap();
    for part in [
        "scan 1 of 2 (\"station 0\"): 29 points",
        "scan 2 of 2 (\"station 1\"): 29 points, moved by its pose",
        "2 points are marked as invalid",
    ] {
        assert!(cloud.notes.iter().any(|n| n.contains(part)), "{:?}", cloud.notes);
    }
}

#[test]
fn meshes_are_what_their_writers_say() {
    let mut count = 0;
    for (name, want) in expected().iter().filter(|(_, v)| v.get("vertices").is_some()) {
        let mesh = meshes::read(&data(name), &ReadLimits::default()).unwrap();
        let tolerance = want["tolerance"].as_f64().unwrap();
        let vertices = vectors(&want["vertices"]);
        let mut left: Vec<[DVec3; 3]> = mesh
            .triangles
            .iter()
            .map(|t| t.map(|v| mesh.vertices[v as usize]))
            .collect();
        // In any order, and from any corner on; not turned over.
        for face in want["faces"].as_array().unwrap() {
            let face: [DVec3; 3] = std::array::from_fn(|i| vertices[face[i].as_u64().unwrap() as usize]);
            let is_face = |t: &[DVec3; 3]| {
                (0..3).any(|k| (0..3).all(|i| (t[(i + k) % 3] - face[i]).abs().max_element() <= tolerance))
            };
            let found = left.iter().position(is_face);
            left.swap_remove(found.unwrap_or_else(|| panic!("{name}: no face {face:?} in {left:?}")));
        }
        assert!(left.is_empty(), "{name}: {left:?}");
        assert_eq!(mesh.unit.symbol(), want["unit"].as_str().unwrap(), "{name}");
        let colors: Option<Vec<[u8; 3]>> = serde_json::from_value(want["colors"].clone()).unwrap();
        if let Some(colors) = colors {
            assert_eq!(mesh.colors.as_ref(), Some(&colors), "{name}");
        }
        assert_eq!(
            mesh.vertices.len() % 8,
            0,
            "{name}: corners at the same place are one vertex"
        );
        // As a cloud: its vertices, each with a normal outward.
        let cloud = points::read(&data(name), &ReadLimits::default()).unwrap();
        assert_eq!(cloud.positions, mesh.vertices, "{name}");
        assert_eq!(cloud.zero_normals, 0);
        count += 1;
    }
    assert_eq!(count, 13);
}

/// In the file from 0 to 1, as floats or bytes.
#[test]
fn colours_of_a_gltf_file_are_those_of_its_writer() {
    let mesh = meshes::read(&data("box_colors_open3d.glb"), &ReadLimits::default()).unwrap();
    let colors = mesh.colors.unwrap();
    // The vertices come in the order of the corners of the box, the colours in even steps.
    for (i, c) in colors.iter().flatten().enumerate() {
        let want = 255.0 * i as f64 / 23.0;
        assert!((f64::from(*c) - want).abs() <= 1.0, "{i}: {c} for {want}");
    }
}
