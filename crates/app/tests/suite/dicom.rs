//! DICOM series from the command line.

use crate::common::Bench;

fn data(name: &str) -> String {
    format!(
        "{}/../formats/tests/data/dicom/{name}",
        env!("CARGO_MANIFEST_DIR")
    )
}

#[test]
fn a_directory_is_described_and_fitted_as_one_volume() {
    let bench = Bench::new();
    let ct = data("ct");
    let info = bench.json(&format!("info {ct}"));
    assert_eq!(info["kind"], "volume (DICOM)");
    assert_eq!(info["dims"], serde_json::json!([10, 8, 6]));
    assert_eq!(info["unit"], "mm");
    let fit = bench.json(&format!("fit {ct} -o ct.iclay --method interpolate"));
    assert_eq!(fit["input_count"], 480);
}

#[test]
fn odd_series_are_refused_until_an_option_says_what_to_do() {
    let bench = Bench::new();
    let uneven = data("uneven");
    let run = bench.run(&format!("info {uneven}"));
    assert_eq!(run.code, 3);
    assert!(run.stderr.contains("--uneven resample"), "{}", run.stderr);
    let info = bench.json(&format!("info {uneven} --uneven resample"));
    assert_eq!(info["dims"], serde_json::json!([6, 5, 7]));

    let tilted = data("tilted");
    let kept = bench.json(&format!("info {tilted}"));
    let upright = bench.json(&format!("info {tilted} --tilt resample"));
    assert_eq!(kept["dims"], serde_json::json!([8, 8, 5]));
    assert_eq!(upright["dims"], serde_json::json!([8, 13, 5]));

    // Every picture twice: a time series of two steps.
    let twice = bench.directory.path().join("twice");
    std::fs::create_dir(&twice).unwrap();
    for k in 0..6 {
        for step in ["a", "b"] {
            std::fs::copy(
                data(&format!("ct/IM000{k}.dcm")),
                twice.join(format!("{step}{k}")),
            )
            .unwrap();
        }
    }
    let run = bench.run("info twice");
    assert_eq!(run.code, 3);
    assert!(
        run.stderr.contains("counted from 0 (--volume N)"),
        "{}",
        run.stderr
    );
    assert_eq!(
        bench.json("info twice --volume 1")["dims"],
        serde_json::json!([10, 8, 6])
    );

    let several = data("syntax");
    let run = bench.run(&format!("info {several}"));
    assert_eq!(run.code, 3);
    assert!(run.stderr.contains("--series"), "{}", run.stderr);
    let one = bench.json(&format!("info {several} --series 30"));
    assert_eq!(one["dims"], serde_json::json!([16, 12, 1]));
}

/// A series is a directory, whatever its name ends in.
#[test]
fn an_edited_series_is_written_into_no_directory_that_is_called_a_file() {
    let bench = Bench::new();
    let ct = data("ct");
    bench.json(&format!("fit {ct} -o ct.iclay --method interpolate"));
    bench.json("new clay.isoclay ct.iclay");
    for name in ["edited.nii.gz", "edited.NRRD", "edited.dcm"] {
        let refused = bench.run(&format!("export clay.isoclay --like {ct} -o {name}"));
        assert_eq!(refused.code, 2, "{name}: {}", refused.stderr);
        assert!(refused.stderr.contains("into a directory"), "{}", refused.stderr);
        assert!(!bench.path(name).exists());
    }
    bench.json(&format!("export clay.isoclay --like {ct} -o edited.2026"));
    assert!(bench.path("edited.2026").is_dir());
}
