//! Scans that are opened, and what panels offer for them, are what `fit`, `new` and `sculpt` make of the same.

use std::ffi::OsString;
use std::path::PathBuf;

use egui::accesskit::Role;
use egui::{Key, Modifiers};
use formats::volumes::{StoreAs, VolumeOptions, peek};
use formats::{ReadLimits, Unit};
use serde_json::json;

use super::*;
use crate::cli::quantity::{human_bytes, human_count, human_number};

/// A head of 24 voxels along each axis.
fn head(directory: &Path) -> PathBuf {
    let scan = directory.join("head.nii");
    command_line("phantom", &[&"head", &"-o", &scan, &"--size", &"24"]);
    scan
}

/// The same with densities of a CT: air at -1000 HU, bone at 1000.
fn in_hounsfield(directory: &Path) -> PathBuf {
    let read = formats::volumes::read(
        &head(directory),
        &VolumeOptions::default(),
        &ReadLimits::default(),
    );
    let volume = read.unwrap();
    let values: Vec<f32> = volume.values.iter().map(|v| 2000.0 * v - 1000.0).collect();
    let (header, scan) = (&volume.header, directory.join("ct.nii"));
    let place = &header.world_from_voxel;
    let store = StoreAs::Float32;
    formats::volumes::save(&scan, header.dims, &values, place, Unit::Millimetre, store).unwrap();
    scan
}

/// The document that the command line makes of a scan by options of `fit`, and of strokes.
fn by_command_line(scan: &Path, options: &[&str], strokes: &[serde_json::Value]) -> [u8; 32] {
    let scratch = tempfile::tempdir().unwrap();
    let name = scan.file_name().unwrap().to_str().unwrap();
    let stem = name.split('.').next().unwrap();
    let field = scratch.path().join(format!("{stem}.iclay"));
    let document = scratch.path().join("made.isoclay");
    let mut fit: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&scan, &"-o", &field];
    fit.extend(options.iter().map(|option| option as &dyn AsRef<std::ffi::OsStr>));
    command_line("fit", &fit);
    command_line("new", &[&document, &field]);
    if !strokes.is_empty() {
        let script = scratch.path().join("strokes.jsonl");
        let lines: Vec<String> = strokes.iter().map(|stroke| stroke.to_string()).collect();
        std::fs::write(&script, lines.join("\n")).unwrap();
        command_line("sculpt", &[&document, &"--script", &script]);
    }
    opened(&document).state().sha256()
}

/// A window with the preview of a scan.
fn previewed(home: &Path, scan: &Path) -> Window {
    let mut window = window(home);
    window.step();
    window.key_press_modifiers(Modifiers::COMMAND | Modifiers::SHIFT, Key::O);
    window.run_steps(3);
    write(&mut window, Role::TextInput, "File", scan.to_str().unwrap());
    window.get_by_role_and_label(Role::Button, "Preview").click();
    window.run_steps(2);
    assert!(window.state().bench().asks.is_none());
    steps_until(&mut window, "known", |window| {
        window.query_by_label("Looking at it").is_none()
    });
    window.run_steps(2);
    window
}

/// The document of a part is that of `fit` with the same region and stride, and the figures of the preview are those of the reader.
#[test]
fn a_part_of_a_volume_is_what_fit_makes_of_it() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let scan = head(scratch.path());
    let mut window = previewed(home.path(), &scan);
    let ends = [
        ("from", "x", "2"),
        ("to", "x", "20"),
        ("from", "z", "4"),
        ("to", "z", "24"),
    ];
    for (end, axis, number) in ends {
        set(&mut window, (&format!("{axis} {end}"), 0), number);
    }
    set(&mut window, ("Every so many voxels", 0), "2");
    let part = VolumeOptions {
        region: Some([[2, 20], [0, 24], [4, 24]]),
        stride: [2; 3],
        ..VolumeOptions::default()
    };
    let read = peek(&scan, &part).unwrap();
    let voxels = format!("{} voxels", human_count(read.header.voxel_count()));
    assert!(window.query_by_label_contains(&voxels).is_some(), "{voxels}");
    let bytes = human_bytes(read.read_bytes);
    assert!(window.query_by_label_contains(&bytes).is_some(), "{bytes}");
    window.get_by_label("Open this part").click();
    let sheet = fitted(&mut window);
    assert_eq!(
        on_disk(&sheet, scratch.path()).state().sha256(),
        by_command_line(&scan, &["--region", "2:20,0:24,4:24", "--stride", "2"], &[])
    );
}

/// The document of a scan; what is seen of it before has the path of the scan.
fn fitted(window: &mut Window) -> Arc<Sheet> {
    until(window, "fitted", |sheet| {
        sheet.path.extension().is_some_and(|e| e == "isoclay")
    });
    steps_until(window, "done", |window| window.state().bench().busy.is_none());
    until(window, "fitted", |_| true)
}

/// Labels that are there.
fn assert_told(window: &Window, all: &[&str]) {
    for told in all {
        assert!(window.query_by_label_contains(told).is_some(), "{told}");
    }
}

/// What is told of points is what is in their file, and the document is that of `fit`.
#[test]
fn a_cloud_is_told_of_before_it_is_fitted() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let scan = scratch.path().join("ball.ply");
    command_line("phantom", &[&"sphere", &"-o", &scan, &"--count", &"3000"]);
    let cloud = formats::points::read(&scan, &ReadLimits::default()).unwrap();
    let (min, max) = cloud
        .positions
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), p| {
            (min.min(*p), max.max(*p))
        });
    let mut window = previewed(home.path(), &scan);
    let triple = |p: DVec3, between: &str| p.to_array().map(human_number).join(between);
    let size = format!("point cloud (PLY): {} of a unit", triple(max - min, " × "));
    let bounds = format!("From {} to {}", triple(min, ", "), triple(max, ", "));
    assert_told(
        &window,
        &["Open ball.ply?", "3 000 points, ", &size, &bounds, "With normals"],
    );
    window.get_by_label("Open it").click();
    let sheet = fitted(&mut window);
    assert_eq!(
        on_disk(&sheet, scratch.path()).state().sha256(),
        by_command_line(&scan, &[], &[])
    );
}

/// What is told of a volume that lies in a directory of slices, and the document of a part of it.
#[test]
fn a_dicom_series_is_told_of_before_it_is_read() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let series = concat!(env!("CARGO_MANIFEST_DIR"), "/../formats/tests/data/dicom/ct");
    let series = PathBuf::from(series);
    let read = peek(&series, &VolumeOptions::default()).unwrap();
    let mut window = previewed(home.path(), &series);
    let spacing = read.header.spacing().to_array();
    let about = format!(
        "DICOM, 10 × 8 voxels in 6 slices, {} mm apart: ",
        spacing.map(human_number).join(" × ")
    );
    let bytes = human_bytes(read.read_bytes);
    assert_told(
        &window,
        &["How much of ct?", &about, "its axes run ", "480 voxels", &bytes],
    );
    set(&mut window, ("z to", 0), "5");
    assert_told(&window, &["400 voxels"]);
    window.get_by_label("Open this part").click();
    let sheet = fitted(&mut window);
    assert_eq!(
        on_disk(&sheet, scratch.path()).state().sha256(),
        by_command_line(&series, &["--region", "0:10,0:8,0:5"], &[])
    );
    // Dropped on the window it is asked about too.
    assert!(crate::panels::is_large(&series));
}

/// What cannot be read says why, and can only be left.
#[test]
fn a_preview_of_what_is_no_scan_says_why() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let none = scratch.path().join("none.ply");
    std::fs::write(&none, "no cloud").unwrap();
    let mut window = previewed(home.path(), &none);
    assert_told(&window, &["none.ply:"]);
    assert!(window.query_by_label_contains("Open it").is_none());
    window.get_by_label("Cancel").click();
    window.run_steps(3);
    assert!(window.state().bench().part.is_none() && window.state().bench().sheet.is_none());
}

/// Presets of a CT: the surface of bone, and stiffness by density.
#[test]
fn presets_of_a_scan_are_strokes_of_a_script() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let scan = in_hounsfield(scratch.path());
    let options = ["--region", "0:24,0:24,2:22"];
    let mut window = window_of(home.path(), TALL);
    window.step();
    let part = options.map(OsString::from).to_vec();
    window.state().bench().order(Order::OpenPart(scan.clone(), part));
    let sheet = fitted(&mut window);
    assert_ne!(sheet.objects[0].iso, 300.0);
    window.run_steps(20);
    press(&mut window, "Bone");
    let sheet = edits(&mut window, 1);
    assert_eq!(sheet.objects[0].iso, 300.0);
    press(&mut window, "Material");
    press(&mut window, "Stiffness by density");
    edits(&mut window, 2);
    window.run_steps(3);
    press(&mut window, "Hardness of stiffness");
    let sheet = edits(&mut window, 3);
    let curve = json!([
        [-200.0, 0.5],
        [0.0, 1.0],
        [100.0, 2.0],
        [300.0, 10.0],
        [1000.0, 50.0]
    ]);
    let strokes = [
        json!({ "surface": { "iso": 300.0 } }),
        json!({ "paint": { "layer": "stiffness", "curve": curve } }),
        json!({ "paint": { "layer": "surface-stiffness", "of-stiffness": 200.0 } }),
    ];
    assert_eq!(
        on_disk(&sheet, scratch.path()).state().sha256(),
        by_command_line(&scan, &options, &strokes)
    );
}
