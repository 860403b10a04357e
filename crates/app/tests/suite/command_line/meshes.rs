//! `isoclay mesh`: how fine, what is left out, what is told.

use std::f64::consts::TAU;

use bspline::polygonize::check_mesh;

use crate::common::{Bench, number, read_mesh};

/// The tolerance of a mesh is met by fewer triangles the looser it is.
#[test]
fn mesh_tolerance_chooses_the_triangles() {
    let bench = Bench::new();
    bench.json("phantom sphere -o cloud.ply");
    bench.json("fit cloud.ply -o field.iclay");
    let mut last = usize::MAX;
    for tolerance in [1e-4, 1e-3, 1e-2] {
        let mesh = bench.json(&format!("mesh field.iclay -o mesh.ply --tolerance {tolerance}"));
        let triangles = number(&mesh, "triangles") as usize;
        assert!(
            triangles < last / 3,
            "{triangles} triangles at {tolerance}, {last} before"
        );
        last = triangles;
        let p95 = chord_error_on_unit_sphere(&bench);
        // All cells of a sphere are of one size, and one twice as large would err four times as much.
        assert!(
            p95 < 1.05 * tolerance && p95 > 0.25 * tolerance,
            "{p95} for {tolerance}"
        );
    }
}

/// 95th percentile of the distances of the centres and sides of the triangles from the unit sphere.
fn chord_error_on_unit_sphere(bench: &Bench) -> f64 {
    let mesh = read_mesh(&bench.path("mesh.ply"));
    assert!(check_mesh(&mesh).is_closed_manifold());
    let mut errors: Vec<f64> = (0..mesh.triangles.len())
        .flat_map(|t| {
            let [a, b, c] = mesh.corners(t);
            [(a + b + c) / 3.0, (a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5]
        })
        .map(|p| (p.length() - 1.0).abs())
        .collect();
    errors.sort_by(f64::total_cmp);
    errors[errors.len() * 95 / 100]
}

/// No more triangles than asked for, and at least four fifths of them; without a wish half the fit's tolerance is kept.
#[test]
fn mesh_keeps_its_number_of_triangles_and_the_tolerance_of_the_fit() {
    let bench = Bench::new();
    bench.json("phantom sphere -o cloud.ply");
    let fit = bench.json("fit cloud.ply -o field.iclay");
    bench.json("mesh field.iclay -o mesh.ply");
    let p95 = chord_error_on_unit_sphere(&bench);
    // The field itself is off by its own error.
    let allowed = 0.5 * number(&fit, "tolerance") + number(&fit, "p95");
    assert!(p95 <= allowed, "{p95} {allowed}");
    for most in [300, 2_000, 30_000] {
        let mesh = bench.json(&format!(
            "mesh field.iclay -o mesh.ply --triangles {most} --check"
        ));
        let triangles = number(&mesh, "triangles") as usize;
        assert!(
            triangles <= most && triangles * 5 >= most * 4,
            "{triangles} for {most}"
        );
        let quality = &mesh["quality"];
        for (fault, count) in [
            ("pieces", 1),
            ("open_edges", 0),
            ("faults", 0),
            ("self_intersections", 0),
        ] {
            assert_eq!(quality[fault], count, "{fault}");
        }
        let median = number(quality, "smallest_angle_median");
        let first = number(quality, "smallest_angle_p1");
        assert!(median >= 40.0 && first >= 18.0, "{median}° {first}°");
        chord_error_on_unit_sphere(&bench);
    }
}

/// The mesh of a noisy cloud is as near to the surface as the fit is, which is much nearer than its samples are.
#[test]
fn meshes_of_noisy_clouds_lose_nothing_of_the_fit() {
    let bench = Bench::new();
    bench.json("phantom sphere -o cloud.ply --noise 1%");
    bench.json("fit cloud.ply -o field.iclay");
    let error_with = |options: &str| {
        bench.json(&format!("mesh field.iclay -o mesh.ply {options}"));
        chord_error_on_unit_sphere(&bench)
    };
    let (default, fine) = (error_with(""), error_with("--resolution 150"));
    assert!(default < 1.05 * fine, "{default} {fine}");
}

/// Triangles far finer than what a fit of a mesh reached would show its ripples, not the mesh.
#[test]
fn meshes_of_fits_that_ran_out_of_coefficients_are_as_fine_as_the_fit() {
    let bench = Bench::new();
    bench.json("phantom gyroid -o cloud.ply --count 20000");
    bench.json("fit cloud.ply -o cloud.iclay");
    bench.json("mesh cloud.iclay -o given.ply --triangles 20000");
    let fit = bench.json("fit given.ply --as mesh -o field.iclay --coefficients 50000");
    let (tolerance, reached) = (number(&fit, "tolerance"), number(&fit, "p95"));
    assert!(reached > 3.0 * tolerance, "{reached} {tolerance}");
    let mesh = bench.json("mesh field.iclay -o mesh.ply");
    assert!(
        mesh["notes"]
            .to_string()
            .contains("farther off than its tolerance"),
        "{mesh}"
    );
    let asked = bench.json(&format!(
        "mesh field.iclay -o fine.ply --tolerance {}",
        0.375 * tolerance
    ));
    let [own, fine] = [&mesh, &asked].map(|m| number(m, "triangles"));
    assert!(own < fine / 2.0, "{own} {fine}");
}

#[test]
fn trim_leaves_holes_open_and_says_how_much_was_invented() {
    let bench = Bench::new();
    bench.json("phantom torus -o cloud.ply --count 8000 --holes 3");
    bench.json("fit cloud.ply -o field.iclay --max-depth 6");
    let note = |summary: &serde_json::Value| summary["notes"].to_string();
    let whole = bench.json("mesh field.iclay -o whole.ply");
    assert!(note(&whole).contains("is invented"), "{whole}");
    let open = bench.json("mesh field.iclay -o open.ply --trim");
    assert!(note(&open).contains("left out"), "{open}");
    let share = number(&open, "triangles") / number(&whole, "triangles");
    assert!((0.75..0.97).contains(&share), "three holes of 6 %: {share}");
    let far = bench.json("mesh field.iclay -o far.ply --trim 100%");
    assert_eq!(far["triangles"], whole["triangles"]);
}

/// Two gaps cut the surface of a ring in two when what is invented is left out, so pieces are counted after that; and where
/// what is left touches in a point alone, it comes apart.
#[test]
fn pieces_are_those_of_what_is_written() {
    let bench = Bench::new();
    let mut ring = String::new();
    for i in 0..12_000 {
        let (u, v) = (
            i as f64 * 0.618_033_988_749_895 * TAU,
            (i as f64 + 0.5) / 12_000.0 * TAU,
        );
        if v.rem_euclid(TAU / 2.0) > 0.5 {
            let n = [u.cos() * v.cos(), u.cos() * v.sin(), u.sin()];
            let p = [n[0] + 3.0 * v.cos(), n[1] + 3.0 * v.sin(), n[2]];
            ring += &format!("{} {} {} {} {} {}\n", p[0], p[1], p[2], n[0], n[1], n[2]);
        }
    }
    bench.write("ring.xyz", ring);
    bench.json("fit ring.xyz -o ring.iclay --max-depth 6");
    let pieces = |options: &str| {
        let made = bench.json(&format!("mesh ring.iclay -o out.ply {options}"));
        let check = check_mesh(&read_mesh(&bench.path("out.ply")));
        assert_eq!(check.non_manifold_vertices, 0, "{options}");
        (check.components, made)
    };
    assert_eq!(pieces("").0, 1);
    assert_eq!(pieces("--trim 0.3").0, 2);
    let (count, made) = pieces("--trim 0.3 --keep largest");
    assert_eq!(
        (count, &made["left_out"]["pieces_left_out"]),
        (1, &1.into()),
        "{made}"
    );
}
