//! Clouds without normals, from the command line.

use crate::common::{Bench, number};

/// 6000 points of a torus with normals.
fn torus(bench: &Bench) {
    bench.json("phantom torus -o cloud.ply --count 6000");
}

#[test]
fn a_cloud_without_normals_is_fitted_as_well_as_one_with_them() {
    let bench = Bench::new();
    torus(&bench);
    let with = bench.json("fit cloud.ply -o with.iclay --max-depth 6");
    let without = bench.json("fit cloud.ply -o without.iclay --max-depth 6 --unoriented");
    // The true normals of a torus are exact, those of its points are not.
    assert!(
        number(&without, "rms") < 0.1 * number(&without, "tolerance"),
        "{without}"
    );
    assert_eq!(without["oriented_by"], "winding number");
    assert_eq!(number(&without, "unsure_signs"), 0.0);
    assert_eq!(number(&without, "leaves_of_unsure_sign"), 0.0);
    assert!(
        without["notes"].to_string().contains("were not used"),
        "{without}"
    );
    assert!(with.get("oriented_by").is_none());
    let info = bench.json("info without.iclay");
    assert!(info["notes"].to_string().contains("winding number"), "{info}");
    let values = bench.run("eval without.iclay --points cloud.ply");
    assert_eq!(values.code, 0, "{}", values.stderr);
}

#[test]
fn outliers_are_left_out_and_counted() {
    let bench = Bench::new();
    let sphere = |i: usize| {
        let z = 1.0 - (2.0 * i as f64 + 1.0) / 3000.0;
        let (s, c) = (2.399_963_229_7 * i as f64).sin_cos();
        let r = (1.0 - z * z).sqrt();
        format!("{} {} {z}\n", r * c, r * s)
    };
    let mut text: String = (0..3000).map(sphere).collect();
    for i in 0..30 {
        let t = f64::from(i);
        text += &format!(
            "{} {} {}\n",
            (t * 0.7).sin() * 0.5,
            (t * 1.3).sin() * 0.5,
            (t * 2.1).sin() * 0.5
        );
    }
    bench.write("ball.xyz", text);
    let fit = bench.json("fit ball.xyz -o ball.iclay --unoriented=winding");
    let outliers = number(&fit, "outliers");
    assert!((27.0..=30.0).contains(&outliers), "{fit}");
    assert_eq!(number(&fit, "used_count"), 3030.0 - outliers);
    assert!(number(&fit, "rms") < 1e-3);
    let tagged = bench.json("fit ball.xyz -o ball.iclay --unoriented=tagging");
    assert_eq!(tagged["oriented_by"], "tagging");
}

#[test]
fn orientation_is_charted_with_what_was_measured_before() {
    let bench = Bench::new();
    torus(&bench);
    let run = bench.run("charts orient cloud.ply -o charts");
    assert_eq!(run.code, 0, "{}", run.stderr);
    let lines: Vec<&str> = run.stdout.lines().collect();
    assert_eq!(lines[0], "cloud,method,points,wrong,cpu_seconds");
    assert!(
        lines[1].starts_with("cloud,winding number,6000,0,"),
        "{}",
        lines[1]
    );
    assert!(lines[2].starts_with("cloud,tagging,6000,"), "{}", lines[2]);
    bench.write("before.csv", format!("{}\ncloud,other,6000,5,1.5\n", lines[0]));
    let run = bench.run("charts orient --measured before.csv -o charts");
    assert_eq!(run.code, 0, "{}", run.stderr);
    let svg = std::fs::read_to_string(bench.path("charts/orient.svg")).unwrap();
    assert!(svg.contains("other") && !svg.contains("winding"), "{svg}");
}
