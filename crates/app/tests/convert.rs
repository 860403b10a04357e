//! `isoclay convert`: what goes through a chain of formats comes back as it was.

mod common;

use common::{Bench, data};
use serde_json::Value;

/// Formats of meshes, each read again by the next; the first and the last are the same.
#[test]
fn a_mesh_keeps_its_triangles_through_every_format() {
    let bench = Bench::new();
    let bunny = data("bunny.obj.gz");
    let said = bench.json(&format!("convert {bunny} 0.ply"));
    let counts = (said["vertices"].as_u64(), said["triangles"].as_u64());
    assert_eq!(counts.0, Some(1839));
    let chain = [
        "0.ply", "1.stl", "2.obj", "3.glb", "4.gltf", "5.3mf", "6.wrl", "7.ply",
    ];
    for pair in chain.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        // Formats of metres and millimetres keep the size of what they are told the size of.
        let unit = match bench.json(&format!("info {from}"))["unit"].as_str() {
            Some("mm") => "",
            _ => "--unit mm",
        };
        let said = bench.json(&format!("convert {from} {to} {unit}"));
        assert_eq!(
            (said["vertices"].as_u64(), said["triangles"].as_u64()),
            counts,
            "{to}"
        );
    }
    let corners = |name: &str| bench.json(&format!("info {name}"))["box"].clone();
    close(&corners("0.ply"), &corners("7.ply"), 1e-6);
}

#[test]
fn a_cloud_keeps_points_and_normals_through_every_format() {
    let bench = Bench::new();
    bench.json("phantom sphere -o 0.ply --count 400");
    for pair in ["0.ply", "1.xyz", "2.pcd", "3.ply"].windows(2) {
        bench.json(&format!("convert {} {}", pair[0], pair[1]));
    }
    let (first, last) = (bench.json("info 0.ply"), bench.json("info 3.ply"));
    assert_eq!(first["points"], last["points"]);
    assert_eq!(last["normals"], "stored");
    close(&first["box"], &last["box"], 1e-6);
}

#[test]
fn a_volume_keeps_voxels_type_and_place_through_every_format() {
    let bench = Bench::new();
    let head = data("head.nii.gz");
    bench.json(&format!(
        "convert {head} 0.nii.gz --region 20:50,30:60,10:30 --stride 1,2,1"
    ));
    for pair in ["0.nii.gz", "1.nrrd", "2.mha", "3.nii"].windows(2) {
        bench.json(&format!("convert {} {}", pair[0], pair[1]));
    }
    let (first, last) = (bench.json("info 0.nii.gz"), bench.json("info 3.nii"));
    for key in ["dims", "stored", "range", "unit"] {
        assert_eq!(first[key], last[key], "{key}");
    }
    assert_eq!(first["dims"], serde_json::json!([30, 15, 20]));
    close(&first["world_from_voxel"], &last["world_from_voxel"], 1e-6);
    bench.json("convert 3.nii 4.nii.gz");
    assert_eq!(inflate(&bench, "0.nii.gz"), inflate(&bench, "4.nii.gz"));
}

#[test]
fn what_makes_no_sense_is_refused_with_the_remedy() {
    let bench = Bench::new();
    let (bunny, head) = (data("bunny.obj.gz"), data("head.nii.gz"));
    bench.json("phantom sphere -o cloud.ply --count 400");
    bench.json("convert cloud.ply cloud.xyz");
    bench.json("fit cloud.xyz -o field.iclay --max-depth 6");
    for (arguments, word) in [
        ("field.iclay mesh.ply".into(), "isoclay mesh"),
        (format!("{head} out.ply"), ".nrrd"),
        (format!("{bunny} out.nii"), ".ply"),
        (format!("{bunny} out.ply --stride 2"), "volumes"),
        (format!("{bunny} out.ply --store int16"), "voxels"),
        (format!("{head} out.nii --as mesh"), "--as"),
        (format!("{head} out.nii --store int8"), "wider"),
        (format!("{head} out.nii --unit m"), "unit"),
        ("cloud.xyz out.stl".into(), ".pcd"),
    ] {
        let run = bench.run(&format!("convert {arguments}"));
        assert_eq!(run.code, 2, "{arguments}: {}{}", run.stdout, run.stderr);
        assert!(
            run.stderr.contains(word),
            "{arguments}: no {word:?} in {}",
            run.stderr
        );
    }
    assert_eq!(bench.files(), ["cloud.ply", "cloud.xyz", "field.iclay"]);
}

/// Voxels as they are evaluated: nothing of a file's compression.
fn inflate(bench: &Bench, name: &str) -> Vec<u8> {
    bench.json(&format!("convert {name} plain.nii"));
    std::fs::read(bench.path("plain.nii")).unwrap()
}

fn close(a: &Value, b: &Value, relative: f64) {
    match (a, b) {
        (Value::Array(a), Value::Array(b)) => {
            assert_eq!(a.len(), b.len());
            a.iter().zip(b).for_each(|(a, b)| close(a, b, relative));
        }
        _ => {
            let (a, b) = (a.as_f64().unwrap(), b.as_f64().unwrap());
            assert!((a - b).abs() <= relative * a.abs().max(1.0), "{a} became {b}");
        }
    }
}
