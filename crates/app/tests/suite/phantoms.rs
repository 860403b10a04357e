//! Solids of known shape through the whole program: cloud, fit, mesh, check. Thresholds are in the solids' own
//! unit (they are about 2 across) and lie a factor of 2 to 4 above what was measured when they were set, so that
//! a loss of accuracy shows and a change of rounding does not.

use crate::common::{Bench, number, read_mesh};
use bspline::polygonize::check_mesh;
use fitting::phantoms::{Solid, SplitMix64};
use formats::ReadLimits;
use formats::field::AnyField;
use glam::DVec3;

struct Thresholds {
    solid: Solid,
    /// Errors re-measured by `check`.
    rms: f64,
    p95: f64,
    /// First-order distance of the mesh's vertices to the true surface, 95th percentile: the sharp edges of some
    /// solids are rounded by any smooth field.
    mesh: f64,
    /// Holes through the solid, by the closed form's own mesh for the gyroid.
    genus: i64,
}

/// Fits, meshes and checks `solid`; returns the scratch directory.
fn hold(t: &Thresholds) {
    let bench = Bench::new();
    let name = t.solid.name();
    bench.json(&format!("phantom {name} -o cloud.ply"));
    let fit = bench.json("fit cloud.ply -o field.iclay");
    assert_eq!(number(&fit, "input_count"), 20_000.0);
    let mesh = bench.json("mesh field.iclay -o mesh.ply --resolution 160");
    assert_eq!(mesh["field_sha256"], fit["field_sha256"]);
    let check = bench.json("check field.iclay cloud.ply");
    assert!(number(&check, "rms") <= t.rms, "{name}: rms {}", check["rms"]);
    assert!(number(&check, "p95") <= t.p95, "{name}: p95 {}", check["p95"]);
    assert_eq!(number(&check, "unprojected"), 0.0, "{name}");
    assert_eq!(
        number(&check, "unsupported_components"),
        0.0,
        "{name}: {}",
        check["notes"]
    );

    let mesh = read_mesh(&bench.path("mesh.ply"));
    let facts = check_mesh(&mesh);
    assert!(facts.is_closed_manifold(), "{name}: {facts:?}");
    assert_eq!(
        (facts.components, facts.euler_characteristic),
        (1, 2 - 2 * t.genus),
        "{name}"
    );
    let truth = t.solid.field();
    let mut errors: Vec<f64> = mesh
        .positions
        .iter()
        .map(|&p| {
            let (f, g) = truth.value_gradient(p);
            f.abs() / g.length()
        })
        .collect();
    let rank = errors.len() * 95 / 100;
    let p95 = *errors.select_nth_unstable_by(rank, f64::total_cmp).1;
    assert!(
        p95 <= t.mesh,
        "{name}: 95 % of the mesh within {p95} of the truth"
    );
    hold_far_sign(&bench, t.solid);
}

/// The sign of the field far from the surface is that of the solid at 99.95 % of random points.
fn hold_far_sign(bench: &Bench, solid: Solid) {
    let loaded = formats::field::load(&bench.path("field.iclay"), &ReadLimits::default()).unwrap();
    let AnyField::F32(spline) = &loaded.field else {
        panic!("the default precision is f32")
    };
    let spacing = spline.lattice().spacing(spline.level_count() - 1).max_element();
    let world = spline.lattice().world_box();
    let truth = solid.field();
    let mut random = SplitMix64::new(0);
    let (mut far, mut wrong) = (0, 0);
    let points: Vec<DVec3> = (0..100_000)
        .map(|_| world.min + world.size() * random.uniform3())
        .collect();
    for p in points {
        let (f, g) = truth.value_gradient(p);
        // Where the closed form is no distance, |f|/|∇f| still keeps away from the surface.
        if f.abs() / g.length().max(1.0) > 2.0 * spacing {
            far += 1;
            wrong += usize::from((f > 0.0) != (loaded.field.as_field().value(p) > 0.0));
        }
    }
    assert!(far > 50_000, "{}: only {far} points are far", solid.name());
    assert!(
        wrong as f64 <= 0.0005 * far as f64,
        "{}: {wrong} of {far} signs are wrong",
        solid.name()
    );
}

#[test]
fn sphere() {
    hold(&Thresholds {
        solid: Solid::Sphere,
        rms: 4e-6,
        p95: 8e-6,
        mesh: 6e-6,
        genus: 0,
    });
}

#[test]
fn torus() {
    hold(&Thresholds {
        solid: Solid::Torus,
        rms: 1.5e-5,
        p95: 3e-5,
        mesh: 3e-5,
        genus: 1,
    });
}

#[test]
fn gyroid() {
    hold(&Thresholds {
        solid: Solid::Gyroid,
        rms: 5e-4,
        p95: 6e-4,
        mesh: 2.5e-3,
        genus: 13,
    });
}

#[test]
fn thin_sheet_of_one_coarse_cell() {
    hold(&Thresholds {
        solid: Solid::Sheet,
        rms: 2e-4,
        p95: 5e-4,
        mesh: 2e-3,
        genus: 0,
    });
}

#[test]
fn thin_cup_of_half_a_coarse_cell() {
    hold(&Thresholds {
        solid: Solid::Cup,
        rms: 5e-4,
        p95: 4e-4,
        mesh: 7e-4,
        genus: 0,
    });
}

#[test]
fn tetrahedron_with_four_holes() {
    hold(&Thresholds {
        solid: Solid::Tetrahedron,
        rms: 1.2e-5,
        p95: 2.0e-5,
        mesh: 4e-5,
        genus: 3,
    });
}

/// With noise the fit may not follow the samples: the mesh lies nearer to the truth than they do.
#[test]
fn noise_is_smoothed_away() {
    let bench = Bench::new();
    bench.json("phantom torus -o cloud.ply --noise 0.01");
    let fit = bench.json("fit cloud.ply -o field.iclay");
    let noise = number(&fit, "noise");
    assert!((0.007..0.014).contains(&noise), "noise found: {noise}");
    bench.json("mesh field.iclay -o mesh.ply --resolution 128");
    let mesh = read_mesh(&bench.path("mesh.ply"));
    let truth = Solid::Torus.field();
    let square: f64 = mesh.positions.iter().map(|&p| truth.value(p).powi(2)).sum();
    let rms = (square / mesh.positions.len() as f64).sqrt();
    assert!(rms < 0.003, "the mesh is {rms} off, the samples 0.01");
    assert!(check_mesh(&mesh).is_closed_manifold());
}

/// A hole in the cloud is closed by something smooth, and no solid appears where there are no samples.
#[test]
fn holes_are_closed() {
    let bench = Bench::new();
    bench.json("phantom sphere -o cloud.ply --holes 5");
    bench.json("fit cloud.ply -o field.iclay");
    bench.json("mesh field.iclay -o mesh.ply --resolution 96");
    let mesh = read_mesh(&bench.path("mesh.ply"));
    let facts = check_mesh(&mesh);
    assert!(facts.is_closed_manifold() && facts.components == 1, "{facts:?}");
    let furthest = mesh
        .positions
        .iter()
        .map(|p| (p.length() - 1.0).abs())
        .fold(0.0, f64::max);
    assert!(
        furthest < 0.1,
        "the closed holes stray {furthest} from the sphere"
    );
    hold_far_sign(&bench, Solid::Sphere);
}

/// The head's closed form is met within the tolerance in every leaf, at fewer coefficients than voxels; white noise
/// is found and not fitted.
#[test]
fn head_clean_and_noisy() {
    let bench = Bench::new();
    bench.json("phantom head -o head.nii.gz --size 64");
    let fit = bench.json("fit head.nii.gz -o head.iclay --tolerance 2%");
    assert_eq!(number(&fit, "leaves_over_tolerance"), 0.0, "{fit}");
    assert!(number(&fit, "coefficients") < 0.7 * 64f64.powi(3), "{fit}");
    let check = bench.json("check head.iclay head.nii.gz");
    assert!(
        (number(&check, "rms") / number(&fit, "rms") - 1.0).abs() < 0.01,
        "{check} {fit}"
    );

    bench.json("phantom head -o noisy.nii.gz --size 64 --noise 0.02");
    let fit = bench.json("fit noisy.nii.gz -o noisy.iclay");
    let noise = number(&fit, "noise");
    assert!((0.015..0.025).contains(&noise), "noise found: {noise}");
    let clean = bench.json("check noisy.iclay head.nii.gz --anyway");
    assert!(
        number(&clean, "rms") < 0.02,
        "the fit is {} off the truth, the voxels 0.02",
        clean["rms"]
    );
    assert_eq!(bench.run("phantom head -o head.nii.gz --holes 3").code, 2);
}

/// Two balls and a hollow one; which pieces are written, in which coordinates, in every format.
#[test]
fn a_mesh_is_written_as_asked() {
    let bench = Bench::new();
    let mut text = crate::common::sphere_text([0.0, 0.0, 0.0], 1.0, 4000);
    text += &crate::common::sphere_text([2.5, 0.0, 0.0], 0.5, 1000);
    text += &crate::common::sphere_text([2.5, 2.0, 0.5], 0.25, 300);
    // The inner wall of the large ball: its normals point into the cavity.
    for line in crate::common::sphere_text([0.0, 0.0, 0.0], 0.6, 2000).lines() {
        let v: Vec<f64> = line.split(' ').map(|w| w.parse().unwrap()).collect();
        text += &format!("{} {} {} {} {} {}\n", v[0], v[1], v[2], -v[3], -v[4], -v[5]);
    }
    bench.write("balls.xyz", text);
    bench.json("fit balls.xyz -o field.iclay --max-depth 6");
    let volume = |options: &str| {
        let said = bench.json(&format!(
            "mesh field.iclay -o mesh.ply --resolution 100 {options}"
        ));
        let mesh = read_mesh(&bench.path("mesh.ply"));
        assert!(check_mesh(&mesh).is_closed_manifold());
        assert_eq!(number(&said, "triangles") as usize, mesh.triangles.len());
        let sum: f64 = (0..mesh.triangles.len())
            .map(|t| {
                let [a, b, c] = mesh.corners(t);
                a.dot(b.cross(c)) / 6.0
            })
            .sum();
        (sum / (4.0 / 3.0 * std::f64::consts::PI), said, mesh)
    };
    let shell = 1.0 - 0.6f64.powi(3);
    let (half, quarter) = (0.125, 1.0 / 64.0);
    for (options, expected, left, filled) in [
        ("", shell + half + quarter, None, 0.0),
        ("--keep 3", shell + half + quarter, None, 0.0),
        ("--keep largest", shell, Some(2.0), 0.0),
        ("--keep 2", shell + half, Some(1.0), 0.0),
        ("--keep 0.3unit3", shell + half, Some(1.0), 0.0),
        ("--keep 0.3mm3 --unit mm", shell + half, Some(1.0), 0.0),
        ("--keep 0.0003cm3 --unit mm", shell + half, Some(1.0), 0.0),
        ("--keep 2unit3", 1.0, Some(2.0), 1.0),
        ("--keep 5%", shell + half, Some(1.0), 0.0),
    ] {
        let (found, said, _) = volume(options);
        assert!(
            (found - expected).abs() < 0.01,
            "{options}: {found} instead of {expected}"
        );
        let told = said["left_out"]["pieces_left_out"].as_f64();
        assert_eq!(told, left, "{options}: {said}");
        assert_eq!(
            said["left_out"]["cavities_filled"].as_f64().unwrap_or(0.0),
            filled,
            "{options}"
        );
        assert_eq!(
            said["notes"].to_string().contains("left out"),
            left.is_some(),
            "{options}: {said}"
        );
    }
    let (_, _, ras) = volume("");
    let (_, said, lps) = volume("--axes lps --unit mm");
    assert_eq!(said["unit"], "mm");
    assert!(said["notes"].to_string().contains("taken for mm"), "{said}");
    let turned: Vec<DVec3> = ras
        .positions
        .iter()
        .map(|p| DVec3::new(-p.x, -p.y, p.z))
        .collect();
    assert!(turned == lps.positions && ras.triangles == lps.triangles);
    // A known unit is converted.
    bench.json("fit balls.xyz -o cm.iclay --max-depth 6 --unit cm");
    bench.json("mesh cm.iclay -o mm.obj --resolution 40 --unit mm");
    let triangles = number(
        &bench.json("mesh cm.iclay -o one.ply --resolution 40"),
        "triangles",
    );
    let size = |file: &str| number(&bench.json(&format!("info {file}")), "diagonal");
    assert!((size("mm.obj") / size("one.ply") - 10.0).abs() < 1e-5);
    for name in ["m.ply", "m.stl", "m.obj", "m.glb", "m.gltf", "m.3mf", "m.wrl"] {
        bench.json(&format!("mesh cm.iclay -o {name} --resolution 40"));
        assert_eq!(
            number(&bench.json(&format!("info {name}")), "faces"),
            triangles,
            "{name}"
        );
    }
}

/// Pixels of clay in a picture and their middle, in pixels from the middle of the picture.
fn clay(path: &std::path::Path) -> (f64, [f64; 2]) {
    let mut reader = png::Decoder::new(std::io::BufReader::new(std::fs::File::open(path).unwrap()))
        .read_info()
        .unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    let (mut count, mut sum) = (0.0, [0.0; 2]);
    for (i, rgb) in pixels.chunks(3).enumerate() {
        // Paper is grey.
        if rgb[0] > rgb[2] + 10 {
            count += 1.0;
            sum[0] += (i % info.width as usize) as f64 + 0.5 - 0.5 * f64::from(info.width);
            sum[1] += (i / info.width as usize) as f64 + 0.5 - 0.5 * f64::from(info.height);
        }
    }
    (count, sum.map(|s| s / count))
}

/// A ball of radius 1 seen from +z: 0.46 of the picture's height is its radius.
#[test]
fn a_picture_shows_the_part_and_the_scale_that_are_asked_for() {
    let bench = Bench::new();
    bench.json("phantom sphere -o cloud.ply --count 3000");
    bench.json("fit cloud.ply -o field.iclay");
    let draw = |options: &str| {
        let said = bench.json(&format!(
            "picture field.iclay -o p.png --size 100x100 --elevation 0 {options}"
        ));
        (said, clay(&bench.path("p.png")))
    };
    let disc = std::f64::consts::PI * 46.0 * 46.0;
    let (whole, (area, middle)) = draw("");
    assert!(
        (area / disc - 1.0).abs() < 0.03 && middle.iter().all(|m| m.abs() < 0.6),
        "{area} {middle:?}"
    );
    // No more cells than pixels, whatever the field has.
    let most = |said: &serde_json::Value| {
        said["cells"]
            .as_array()
            .unwrap()
            .iter()
            .map(|c| c.as_u64().unwrap())
            .max()
    };
    assert!(most(&whole) < Some(64), "{whole}");
    let (_, (area, _)) = draw("--zoom 0.5");
    assert!((area / disc - 0.25).abs() < 0.02, "{area}");
    // The eye is on +z, y is up: x points right.
    let (_, (area, middle)) = draw("--at 0.5,0.25,-7");
    assert!((area / disc - 0.9).abs() < 0.1, "{area}");
    let (_, (_, small)) = draw("--at 0.5,0.25,-7 --zoom 0.4");
    assert!(
        (small[0] + 0.5 * 46.0 * 0.4).abs() < 0.6 && (small[1] - 0.25 * 46.0 * 0.4).abs() < 0.6,
        "{small:?} {middle:?}"
    );
    // The edge of the ball, enlarged: half of the picture is clay, and only that part is meshed.
    let (edge, (area, middle)) = draw("--at 1,0,0 --zoom 20");
    assert!(
        (area / 10_000.0 - 0.5).abs() < 0.04 && middle[0] < -20.0,
        "{area} {middle:?}"
    );
    // The whole ball with such cells would have a million triangles.
    assert!(number(&edge, "triangles") < 60_000.0, "{edge}");
    // Far inside the ball's outline all is clay, up to the border: the cut is not seen.
    let (_, (area, _)) = draw("--at 0,0,1 --zoom 60");
    assert_eq!(area, 10_000.0);
    let run = bench.run("picture field.iclay -o q.png --at 9,0,0 --zoom 4");
    assert!(run.code == 2 && !bench.path("q.png").exists(), "{}", run.stderr);
}
