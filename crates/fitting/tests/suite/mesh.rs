//! Fits of meshes: accuracy in the band, and that nothing but the mesh decides.

use crate::common::meshes::{Mesh, cuboid, sphere, torus};
use bspline::{Field, HierarchicalSpline};
use fitting::mesh::{MeshDefects, MeshDistance, MeshOptions, fit_mesh};
use fitting::phantoms::SplitMix64;
use fitting::{Control, FitReport, Leaf, StopReason};
use glam::DVec3;

fn fit(mesh: &Mesh, options: &MeshOptions) -> (HierarchicalSpline<f32>, FitReport, MeshDefects) {
    fit_mesh(&mesh.vertices, &mesh.triangles, options, &mut Control::default())
        .expect("a mesh that bounds a solid")
}

fn tolerance(tolerance: f64) -> MeshOptions {
    MeshOptions {
        tolerance: Some(tolerance),
        ..Default::default()
    }
}

/// Largest error against `distance` (positive inside) at random points no farther than `band` from the mesh.
fn worst_in_band(
    field: &HierarchicalSpline<f32>,
    mesh: &Mesh,
    band: f64,
    distance: impl Fn(DVec3) -> f64,
) -> f64 {
    let mut random = SplitMix64::new(7);
    let mut worst = 0.0f64;
    for _ in 0..20_000 {
        let t = mesh.triangles[(random.uniform() * mesh.triangles.len() as f64) as usize];
        let [a, b, c] = t.map(|v| mesh.vertices[v as usize]);
        let (mut s, mut t) = (random.uniform(), random.uniform());
        if s + t > 1.0 {
            (s, t) = (1.0 - s, 1.0 - t);
        }
        let p = a + (b - a) * s + (c - a) * t + (random.uniform3() * 2.0 - 1.0) * band;
        let d = distance(p);
        if d.abs() <= band {
            worst = worst.max((field.value(p) - d).abs());
        }
    }
    worst
}

/// Wrong signs at random points of the field's box more than `beyond` from the surface.
fn wrong_signs(field: &HierarchicalSpline<f32>, beyond: f64, distance: impl Fn(DVec3) -> f64) -> usize {
    let all = field.lattice().world_box();
    let mut random = SplitMix64::new(11);
    (0..10_000)
        .map(|_| all.min + random.uniform3() * (all.max - all.min))
        .filter(|&p| {
            let d = distance(p);
            d.abs() > beyond && (field.value(p) > 0.0) != (d > 0.0)
        })
        .count()
}

fn to_sphere(p: DVec3) -> f64 {
    1.0 - p.length()
}

fn to_torus(p: DVec3) -> f64 {
    0.4 - DVec3::new(p.truncate().length() - 1.0, p.z, 0.0).length()
}

fn to_box(p: DVec3, half: DVec3) -> f64 {
    let q = p.abs() - half;
    -(q.max(DVec3::ZERO).length() + q.max_element().min(0.0))
}

/// Leaves above the tolerance that do not say why.
fn untold(report: &FitReport) -> usize {
    let over = |l: &&Leaf| f64::from(l.rms) > report.tolerance && l.reason == StopReason::Tolerance;
    report.leaves.iter().filter(over).count()
}

#[test]
fn sphere_torus_and_box_are_within_tolerance_on_their_surface_and_keep_their_sign() {
    let half = DVec3::new(1.0, 0.7, 0.4);
    let shapes: [(Mesh, &dyn Fn(DVec3) -> f64); 3] = [
        // Facets of so fine a sphere and torus lie within 1.3e-4 and 6e-5 of the shape.
        (sphere(120), &to_sphere),
        (torus(200), &to_torus),
        (cuboid(-half, half), &|p| to_box(p, half)),
    ];
    let aim = 2e-3;
    for (mesh, distance) in shapes {
        let (field, report, defects) = fit(&mesh, &tolerance(aim));
        assert!(defects.is_closed());
        assert!(report.rms <= aim && report.p95 <= aim, "{} of {aim}", report.p95);
        assert_eq!(untold(&report), 0);
        let worst = worst_in_band(&field, &mesh, 0.0, distance);
        assert!(worst <= 3.0 * aim, "{worst} of {aim}");
        assert_eq!(wrong_signs(&field, 3.0 * aim, distance), 0);
    }
}

#[test]
fn a_coarse_mesh_is_fitted_as_the_polyhedron_that_it_is() {
    let mesh = sphere(6);
    let exact = MeshDistance::new(&mesh.vertices, &mesh.triangles)
        .expect("a sphere")
        .0;
    let aim = 4e-3;
    let (field, report, _) = fit(&mesh, &tolerance(aim));
    assert!(report.p95 <= aim, "{} of {aim}", report.p95);
    let worst = worst_in_band(&field, &mesh, 0.0, |p| exact.signed(p));
    assert!(worst <= 3.0 * aim, "{worst} of {aim}");
}

#[test]
fn a_tighter_tolerance_costs_coefficients_and_a_budget_stops_it() {
    let mesh = cuboid(DVec3::ZERO, DVec3::ONE);
    let (_, loose, _) = fit(&mesh, &tolerance(0.01));
    let (_, tight, _) = fit(&mesh, &tolerance(0.003));
    assert!(tight.coefficients > loose.coefficients && tight.max < loose.max);
    assert!(
        tight
            .solves
            .iter()
            .map(|s| s.depth)
            .eq((6..=tight.depth).map(Some))
    );
    // A number of iterations is made and no residual asked, so none is missed.
    assert!(tight.solves.iter().all(|s| s.goal.is_none()));
    let missed = |note: &String| note.contains("did not converge");
    assert!(!tight.notes.iter().any(missed), "{:?}", tight.notes);
    let spent = MeshOptions {
        coefficients: Some(loose.coefficients),
        ..tolerance(0.003)
    };
    let (_, report, _) = fit(&mesh, &spent);
    assert!(report.coefficients < tight.coefficients);
    assert!(
        report
            .leaves
            .iter()
            .any(|l| l.reason == StopReason::Budget && f64::from(l.max) > report.tolerance)
    );
}

#[test]
fn a_wider_band_holds_the_tolerance_farther_out() {
    let mesh = torus(60);
    let exact = MeshDistance::new(&mesh.vertices, &mesh.triangles)
        .expect("a torus")
        .0;
    let wide = MeshOptions {
        band: Some(0.15),
        ..tolerance(4e-3)
    };
    let (field, ..) = fit(&mesh, &wide);
    let worst = worst_in_band(&field, &mesh, 0.15, |p| exact.signed(p));
    assert!(worst <= 4e-3, "{worst}");
}

#[test]
fn a_mesh_a_million_away_gives_the_same_field() {
    let near = torus(40);
    let by = DVec3::new(1e6, -2e6, 1e6);
    let (here, ..) = fit(&near, &tolerance(5e-3));
    let (there, ..) = fit(&near.clone().moved(by), &tolerance(5e-3));
    let mut random = SplitMix64::new(3);
    for _ in 0..2000 {
        let p = (random.uniform3() * 2.0 - 1.0) * 1.4;
        // Coordinates have 2e-10 left there.
        let difference = (here.value(p) - there.value(p + by)).abs();
        assert!(difference < 1e-5, "{difference} at {p}");
    }
}

#[test]
fn one_two_and_eight_threads_give_the_same_bits() {
    let mut mesh = torus(24).with(&sphere(12).moved(DVec3::X));
    mesh.remove_some(0.02, 5);
    let hashes = [1, 2, 8].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads");
        pool.install(|| fit(&mesh, &tolerance(0.04)).0.sha256())
    });
    assert_eq!(hashes[0], hashes[1]);
    assert_eq!(hashes[0], hashes[2]);
}
