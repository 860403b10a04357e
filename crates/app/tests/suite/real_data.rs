//! The data of the repository through the whole program. Thresholds lie a factor of 1.3 to 2 above what was
//! measured when they were set.

use crate::common::{Bench, data, number, read_mesh};
use bspline::polygonize::check_mesh;

#[test]
fn bunny_becomes_a_closed_mesh_near_its_points() {
    let bench = Bench::new();
    let bunny = data("bunny.obj.gz");
    let fit = bench.json(&format!("fit {bunny} -o bunny.iclay"));
    bench.json("mesh bunny.iclay -o bunny.ply");
    let check = bench.json(&format!("check bunny.iclay {bunny} -o report"));
    // The diagonal is 15.76: p95 is 3.3e-4 of it. With heavier conditions between the samples it was 5.1e-4.
    assert!(number(&check, "p95") < 0.0065, "{check}");
    assert!(number(&check, "rms") < 0.0033, "{check}");
    // The fit and the check measure alike, each in its own way.
    assert!(
        (number(&check, "rms") / number(&fit, "rms") - 1.0).abs() < 0.05,
        "{check} {fit}"
    );
    assert_eq!(number(&check, "unsupported_components"), 0.0, "{check}");
    let facts = check_mesh(&read_mesh(&bench.path("bunny.ply")));
    assert!(facts.is_closed_manifold(), "{facts:?}");
    assert_eq!(
        (facts.components, facts.euler_characteristic),
        (1, 2),
        "{facts:?}"
    );
    // The volume of the triangles that came with the points.
    assert!((facts.volume / 194.29 - 1.0).abs() < 0.01, "{}", facts.volume);
    for name in ["error.ply", "octree.ply", "report.json"] {
        assert!(
            bench.path("report").join(name).metadata().unwrap().len() > 1000,
            "{name}"
        );
    }
    let report = std::fs::read(bench.path("report/report.json")).unwrap();
    let report: serde_json::Value = serde_json::from_slice(&report).unwrap();
    assert_eq!(report["errors"]["rms"], check["rms"]);
}

#[test]
fn head_is_fitted_within_its_tolerance_and_sampled_back() {
    let bench = Bench::new();
    let head = data("head.nii.gz");
    let fit = bench.json(&format!("fit {head} -o head.iclay --tolerance 2%"));
    assert_eq!(number(&fit, "leaves_over_tolerance"), 0.0, "{fit}");
    assert!(number(&fit, "coefficients") < 0.35 * 96f64.powi(3), "{fit}");
    let check = bench.json(&format!("check head.iclay {head}"));
    assert_eq!(number(&check, "leaves_over_tolerance"), 0.0, "{check}");
    assert!(
        (number(&check, "rms") / number(&fit, "rms") - 1.0).abs() < 0.01,
        "{check} {fit}"
    );
    assert!(number(&check, "max") <= number(&fit, "bound"), "{check} {fit}");

    // Sampled at the voxels and measured against the volume by other code than `check`'s.
    bench.json(&format!(
        "sample head.iclay --like {head} -o again.nii.gz --store float32"
    ));
    let limits = formats::ReadLimits::default();
    let truth = formats::volumes::read(head.as_ref(), &Default::default(), &limits).unwrap();
    let again = formats::volumes::read(&bench.path("again.nii.gz"), &Default::default(), &limits).unwrap();
    assert_eq!(again.header.dims, truth.header.dims);
    assert!(
        again
            .header
            .world_from_voxel
            .abs_diff_eq(truth.header.world_from_voxel, 1e-6)
    );
    let square: f64 = truth
        .values
        .iter()
        .zip(&again.values)
        .map(|(a, b)| f64::from(a - b).powi(2))
        .sum();
    let rms = (square / truth.values.len() as f64).sqrt();
    assert!(
        (rms / number(&check, "rms") - 1.0).abs() < 1e-4,
        "{rms} against {check}"
    );

    bench.json("mesh head.iclay -o head.ply --resolution 96");
    let facts = check_mesh(&read_mesh(&bench.path("head.ply")));
    assert!(facts.is_closed_manifold() && facts.volume > 0.0, "{facts:?}");
}

#[test]
fn interpolation_is_exact_at_the_voxels() {
    let bench = Bench::new();
    let head = data("head.nii.gz");
    bench.json(&format!("fit {head} -o head.iclay --method interpolate"));
    let check = bench.json(&format!("check head.iclay {head}"));
    // 256 grey values in single precision: 24 bits less the 8 of the value and a few of the sums.
    assert!(number(&check, "max") < 1e-3, "{check}");
}

#[test]
fn a_picture_shows_the_bunny() {
    let bench = Bench::new();
    bench.json(&format!(
        "fit {} -o bunny.iclay --max-depth 6",
        data("bunny.obj.gz")
    ));
    bench.json("picture bunny.iclay -o bunny.png --size 160x120 --resolution 64");
    let decoder = png::Decoder::new(std::io::BufReader::new(
        std::fs::File::open(bench.path("bunny.png")).unwrap(),
    ));
    let mut reader = decoder.read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    // Clay is redder than it is blue, the background is not.
    let clay = pixels
        .chunks(3)
        .filter(|p| p[0] > p[2].saturating_add(20))
        .count() as f64
        / (160.0 * 120.0);
    assert!((0.25..0.75).contains(&clay), "clay covers {clay} of the picture");
}
