//! Writes a mesh and a cloud in every format, near the origin and in map coordinates, with `expected.json` beside
//! them, for the independent readers of `tests/interop`.
//!
//! `cargo run --release -p formats --example write_scans -- DIR`

use std::path::PathBuf;

use formats::points::PointCloud;
use formats::{Unit, meshes, points};
use glam::DVec3;
use serde_json::json;

/// Vertices around the ring, and around the tube.
const AROUND: u32 = 24;
const TUBE: u32 = 12;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let directory = PathBuf::from(std::env::args().nth(1).ok_or("name a directory")?);
    std::fs::create_dir_all(&directory)?;
    let (near, normals) = torus();
    let triangles: Vec<[u32; 3]> = (0..AROUND * TUBE).flat_map(quad).collect();
    let colors: Vec<[u8; 3]> = (0..near.len()).map(|i| [i as u8, 100, 255 - i as u8]).collect();
    let far: Vec<DVec3> = near.iter().map(|v| *v + DVec3::new(1e6, 5.4e6, 120.0)).collect();
    for (place, vertices) in [("near", &near), ("far", &far)] {
        let mesh = meshes::Mesh {
            vertices,
            triangles: &triangles,
            colors: Some(&colors),
            unit: Unit::Millimetre,
        };
        for format in ["ply", "stl", "obj", "glb", "gltf", "3mf", "wrl"] {
            meshes::save(&directory.join(format!("mesh_{place}.{format}")), &mesh)?;
        }
        let cloud = PointCloud {
            positions: vertices.clone(),
            normals: Some(normals.clone()),
            unit: Unit::Millimetre,
            ..Default::default()
        };
        for format in ["ply", "pcd", "xyz", "las", "laz", "e57"] {
            points::save(&directory.join(format!("cloud_{place}.{format}")), &cloud)?;
        }
    }
    let list = |all: &[DVec3]| all.iter().map(|v| v.to_array()).collect::<Vec<_>>();
    let expected = json!({
        "unit": "mm", "near": list(&near), "far": list(&far), "normals": list(&normals), "triangles": triangles,
        "colors": colors,
    });
    std::fs::write(directory.join("expected.json"), expected.to_string())?;
    Ok(())
}

/// Vertices and normals of a torus of radii 20 and 5 mm.
fn torus() -> (Vec<DVec3>, Vec<DVec3>) {
    (0..AROUND * TUBE)
        .map(|i| {
            let turn = |k: u32, n: u32| (f64::from(k) * std::f64::consts::TAU / f64::from(n)).sin_cos();
            let ((s, c), (t, u)) = (turn(i / TUBE, AROUND), turn(i % TUBE, TUBE));
            let normal = DVec3::new(u * c, u * s, t);
            (DVec3::new(20.0 * c, 20.0 * s, 0.0) + 5.0 * normal, normal)
        })
        .unzip()
}

/// The two triangles after vertex `i`, counterclockwise from outside.
fn quad(i: u32) -> [[u32; 3]; 2] {
    let (ring, spot) = (i / TUBE, i % TUBE);
    let (next_ring, next) = ((ring + 1) % AROUND * TUBE, (spot + 1) % TUBE);
    let [a, b, c, d] = [i, next_ring + spot, next_ring + next, ring * TUBE + next];
    [[a, b, c], [a, c, d]]
}
