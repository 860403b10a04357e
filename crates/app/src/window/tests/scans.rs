//! Scans that are opened, and what panels offer for them, are what `fit`, `new` and `sculpt` make of the same.

use std::ffi::OsString;
use std::path::PathBuf;

use egui::accesskit::Role;
use egui::{Key, Modifiers};
use formats::volumes::{VolumeOptions, peek};
use serde_json::json;

use super::*;
use crate::cli::quantity::{human_bytes, human_count};

/// A head of 24 voxels along each axis.
fn head(directory: &Path) -> PathBuf {
    let scan = directory.join("head.nii");
    command_line("phantom", &[&"head", &"-o", &scan, &"--size", &"24"]);
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
    window.get_by_role_and_label(Role::Button, "Open a part").click();
    wait_for(&mut window, "Every so many voxels");
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
    let sheet = until(&mut window, "fitted", |sheet| sheet.is_untitled);
    assert_eq!(
        on_disk(&sheet, scratch.path()).state().sha256(),
        by_command_line(&scan, &["--region", "2:20,0:24,4:24", "--stride", "2"], &[])
    );
}

/// Presets of a CT: the surface of bone, and stiffness by density.
#[test]
fn presets_of_a_scan_are_strokes_of_a_script() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let scan = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/head.nii.gz"));
    let options = ["--stride", "4"];
    let mut window = window_of(home.path(), TALL);
    window.step();
    let part = options.map(OsString::from).to_vec();
    window.state().bench().order(Order::OpenPart(scan.clone(), part));
    let sheet = until(&mut window, "fitted", |sheet| sheet.is_untitled);
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
