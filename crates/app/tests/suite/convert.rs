//! `isoclay convert`: what goes through a chain of formats comes back as it was.

use crate::common::{Bench, data};
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
fn what_a_cloud_loses_is_named() {
    let bench = Bench::new();
    bench.write(
        "colours.xyz",
        "x y z nx ny nz red intensity\n0 0 0 0 0 1 255 7\n1 0 0 0 0 1 9 8\n",
    );
    let run = bench.run("convert colours.xyz 1.ply");
    assert!(run.stdout.contains("left out: red, intensity"), "{}", run.stdout);
    let run = bench.run("convert 1.ply 2.ply");
    assert!(!run.stdout.contains("left out"), "{}", run.stdout);
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
        (format!("{bunny} out.nii"), ".glb"),
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

/// The input itself under any name, and the files that a header or a directory stands for.
#[test]
fn no_input_is_ever_overwritten() {
    let bench = Bench::new();
    bench.json("phantom sphere -o cloud.ply --count 100");
    bench.json("phantom head -o head.nii --size 8");
    let link = |to: &str, name: &str| std::os::unix::fs::symlink(to, bench.path(name)).unwrap();
    std::fs::create_dir(bench.path("d")).unwrap();
    link("cloud.ply", "link.ply");
    link("d/../link.ply", "twice.ply");
    std::fs::hard_link(bench.path("cloud.ply"), bench.path("hard.ply")).unwrap();
    let header = "NRRD0005\ntype: uint8\ndimension: 3\nsizes: 4 4 4\nencoding: raw\n";
    bench.write("one.nhdr", format!("{header}data file: my voxels.raw\n\n"));
    bench.write("my voxels.raw", [7; 64]);
    link("my voxels.raw", "voxels.nii");
    bench.write("many.nhdr", format!("{header}data file: slice%02d.raw 1 4 1\n\n"));
    (1..5).for_each(|i| bench.write(&format!("slice{i:02}.raw"), [i as u8; 16]));
    link("slice03.raw", "slice.nii");
    let mut pair = std::fs::read(bench.path("head.nii")).unwrap();
    bench.write("pair.img", pair.split_off(352));
    pair[344..348].copy_from_slice(b"ni1\0");
    pair[108..112].copy_from_slice(&0f32.to_le_bytes());
    bench.write("pair.hdr", pair);
    link("pair.img", "image.nii");
    for file in std::fs::read_dir(dicom("ct")).unwrap().flatten() {
        std::fs::copy(file.path(), bench.path("d").join(file.file_name())).unwrap();
    }
    let slice = std::fs::read_dir(bench.path("d"))
        .unwrap()
        .next()
        .unwrap()
        .unwrap();
    link(slice.path().to_str().unwrap(), "ct.nii");
    let before: Vec<_> = bench
        .files()
        .iter()
        .map(|f| (f.clone(), std::fs::read(bench.path(f)).ok()))
        .collect();
    for (arguments, word) in [
        ("cloud.ply cloud.ply", "itself"),
        ("cloud.ply d/../cloud.ply", "itself"),
        ("cloud.ply link.ply", "itself"),
        ("twice.ply cloud.ply", "itself"),
        ("hard.ply link.ply", "itself"),
        ("one.nhdr voxels.nii", "holds data of one.nhdr"),
        ("many.nhdr slice.nii", "holds data of many.nhdr"),
        ("pair.hdr image.nii", "holds data of pair.hdr"),
        ("d ct.nii", "one of the files of d"),
    ] {
        let run = bench.run(&format!("convert {arguments}"));
        assert_eq!(run.code, 2, "{arguments}: {}{}", run.stdout, run.stderr);
        assert!(run.stderr.contains(word), "{arguments}: {}", run.stderr);
    }
    let after: Vec<_> = bench
        .files()
        .iter()
        .map(|f| (f.clone(), std::fs::read(bench.path(f)).ok()))
        .collect();
    assert!(before == after, "a file changed");
    // What is no input may be replaced, also beside one.
    for _ in 0..2 {
        bench.json("convert one.nhdr out.nii");
        bench.json("convert d d/out.nii");
    }
}

fn dicom(name: &str) -> String {
    format!(
        "{}/../formats/tests/data/dicom/{name}",
        env!("CARGO_MANIFEST_DIR")
    )
}

/// Options of voxels without a header, next to --as, whose name inside the program was the same.
#[test]
fn voxels_without_a_header_are_fitted_and_converted() {
    let bench = Bench::new();
    bench.write(
        "v.raw",
        (0..1000u16)
            .flat_map(|i| (i % 97).to_le_bytes())
            .collect::<Vec<u8>>(),
    );
    let raw = "--shape 10,10,10 --voxel uint16 --spacing 2";
    bench.json(&format!("convert v.raw v.nii {raw}"));
    let info = bench.json("info v.nii");
    assert_eq!(info["spacing"], serde_json::json!([2.0, 2.0, 2.0]));
    assert_eq!(
        bench.json(&format!("fit v.raw -o v.iclay {raw} --method interpolate"))["input_count"],
        1000
    );
    assert_eq!(
        bench.json(&format!("check v.iclay v.raw {raw}"))["input_count"],
        1000
    );
}

#[test]
fn a_sampled_volume_keeps_the_box_and_the_type_of_the_other() {
    let bench = Bench::new();
    let head = data("head.nii.gz");
    bench.json(&format!(
        "convert {head} part.nii --region 20:60,30:70,10:40 --store int16"
    ));
    bench.json("fit part.nii -o field.iclay --max-depth 1");
    let part = bench.json("info part.nii");
    let ends = |info: &Value| -> Vec<f64> {
        let m = &info["world_from_voxel"];
        let dims = &info["dims"];
        let at = |i: usize, far: bool| {
            let voxel = |a: usize| {
                if far {
                    dims[a].as_f64().unwrap() - 0.5
                } else {
                    -0.5
                }
            };
            (0..3).map(|a| m[i][a].as_f64().unwrap() * voxel(a)).sum::<f64>() + m[i][3].as_f64().unwrap()
        };
        (0..6).map(|k| at(k % 3, k > 2)).collect()
    };
    for (spacing, voxel, out) in [
        ("", "", "out.nii"),
        ("--spacing 3", "", "out.nrrd"),
        ("--spacing 0.9,2,5", "--store float32", "out.mha"),
    ] {
        bench.json(&format!(
            "sample field.iclay --like part.nii -o {out} {spacing} {voxel}"
        ));
        let info = bench.json(&format!("info {out}"));
        assert_eq!(
            info["stored"],
            if voxel.is_empty() {
                part["stored"].clone()
            } else {
                "float32".into()
            },
            "{out}"
        );
        for (a, b) in ends(&part).iter().zip(ends(&info)) {
            assert!((a - b).abs() < 1e-3, "{spacing}: the box moved from {a} to {b}");
        }
        if spacing.is_empty() {
            assert_eq!(info["dims"], part["dims"]);
        }
    }
    let clipped = bench.json("sample field.iclay --like part.nii -o out.nii --store uint8");
    let note = clipped["notes"].to_string();
    assert!(
        note.contains("rounded to whole numbers") && note.contains("held to 0 or 255"),
        "{note}"
    );
    let range = bench.json("info out.nii")["range"].clone();
    assert!(range[0] == 0.0 && range[1].as_f64() <= Some(255.0), "{range}");
    // A distance is no density: whole numbers would leave nothing of it.
    bench.json("phantom sphere -o cloud.ply --count 500");
    bench.json("fit cloud.ply -o ball.iclay --max-depth 6");
    bench.json("sample ball.iclay --like part.nii -o ball.nii");
    assert_eq!(bench.json("info ball.nii")["stored"], "float32");
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
