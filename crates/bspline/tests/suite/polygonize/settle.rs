//! Laws of settled meshes.

use bspline::polygonize::{Mesh, SettleOptions, check_mesh, settle};
use bspline::{Field, Frame};
use glam::DVec3;

use super::fields::{gyroid, sphere, unbounded};
use super::{cube, mesh_of};

/// A field with the gradient of central differences.
fn differenced(f: impl Fn(DVec3) -> f64 + Send + Sync + 'static) -> Box<dyn Field> {
    Box::new(unbounded(move |p| {
        let slope = |e: DVec3| (f(p + e) - f(p - e)) / 2e-6;
        let gradient = DVec3::AXES.map(|e| slope(e * 1e-6));
        (f(p), DVec3::from_array(gradient))
    }))
}

fn raw(field: &dyn Field, frame: &Frame) -> Mesh {
    mesh_of(field, frame, &Default::default()).0
}

/// The mesh settled, with no vertex fixed.
fn settled(field: &dyn Field, mesh: &Mesh, tolerance: f64) -> Mesh {
    let mut mesh = mesh.clone();
    let fixed = vec![false; mesh.positions.len()];
    settle(
        field,
        0.0,
        &mut mesh.positions,
        &mut mesh.triangles,
        &fixed,
        &SettleOptions::new(tolerance),
    );
    mesh
}

/// 95th percentile of the distances of centroids and middles of edges to the surface, to first order; caps left out.
fn chord_error(field: &dyn Field, mesh: &Mesh) -> f64 {
    let mut errors: Vec<f64> = (0..mesh.triangles.len())
        .flat_map(|t| {
            let [a, b, c] = mesh.corners(t);
            [(a + b + c) / 3.0, (a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0]
        })
        .filter(|p| p.abs().max_element() < 1.1)
        .map(|p| {
            let (f, g) = field.value_gradient(p);
            f.abs() / g.length()
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    errors[errors.len() * 95 / 100]
}

/// Smallest angles of the triangles in degrees: 1st percentile and median.
fn smallest_angles(mesh: &Mesh) -> [f64; 2] {
    let mut angles: Vec<f64> = (0..mesh.triangles.len())
        .map(|t| {
            let [a, b, c] = mesh.corners(t);
            let angle = |p: DVec3, q: DVec3, r: DVec3| (q - p).angle_between(r - p).to_degrees();
            angle(a, b, c).min(angle(b, c, a)).min(angle(c, a, b))
        })
        .collect();
    angles.sort_by(f64::total_cmp);
    [angles[angles.len() / 100], angles[angles.len() / 2]]
}

#[test]
fn settled_triangles_are_even_and_nearer_to_the_surface() {
    for (name, field, cells, gain) in [
        (
            "sphere",
            Box::new(sphere(DVec3::splat(0.01), 1.0)) as Box<dyn Field>,
            24,
            2.0,
        ),
        ("gyroid", Box::new(gyroid(3.0)), 40, 1.3),
    ] {
        let frame = cube(1.3, cells);
        let before = raw(&*field, &frame);
        let fixed: Vec<bool> = before
            .positions
            .iter()
            .map(|p| p.abs().max_element() > 1.2)
            .collect();
        let mut after = before.clone();
        let report = settle(
            &*field,
            0.0,
            &mut after.positions,
            &mut after.triangles,
            &fixed,
            &SettleOptions::new(1e-3),
        );
        assert!(report.flips > 0);
        let check = check_mesh(&after);
        assert!(check.is_closed_manifold(), "{name}: {check:?}");
        assert_eq!(before.triangles.len(), after.triangles.len());
        for (p, (q, fixed)) in before.positions.iter().zip(after.positions.iter().zip(&fixed)) {
            assert!(!fixed || p == q, "{name}: a fixed vertex moved from {p} to {q}");
        }
        let errors = [&before, &after].map(|m| chord_error(&*field, m));
        assert!(errors[1] * gain < errors[0], "{name}: {errors:?}");
        let angles = smallest_angles(&after);
        assert!(angles[0] > 18.0 || name == "gyroid", "{name}: {angles:?}");
        assert!(angles[1] > 40.0, "{name}: {angles:?}");
    }
}

#[test]
fn thin_plates_keep_their_two_sides_apart() {
    // A bent plate about one cell thick: relaxation must not carry a vertex to the other side.
    let plate = differenced(|p| 0.05 - (p.z - 0.3 * p.x * p.x).abs().max(0.1 * (p.length() - 1.0)));
    let mesh = raw(&*plate, &cube(1.5, 32));
    let before = check_mesh(&mesh);
    let after = check_mesh(&settled(&*plate, &mesh, 1e-3));
    assert!(after.is_closed_manifold(), "{after:?}");
    assert_eq!(before.components, after.components);
    assert!(
        (after.volume / before.volume - 1.0).abs() < 0.05,
        "{before:?} {after:?}"
    );
}

/// Neighbours of a triangle, normals and sums round the vertices: 58 bytes a triangle. With its weighted centroid kept of each
/// triangle it was 79, and settling was what a default mesh took most memory for.
#[test]
fn settling_holds_little_beside_the_mesh() {
    let field = sphere(DVec3::splat(0.01), 1.0);
    let mesh = raw(&field, &cube(1.3, 96));
    let fixed = vec![false; mesh.positions.len()];
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let used = pool.expect("a thread").install(|| {
        let mut mesh = mesh.clone();
        let (positions, triangles) = (&mut mesh.positions, &mut mesh.triangles);
        allocation_counter::measure(|| {
            settle(
                &field,
                0.0,
                positions,
                triangles,
                &fixed,
                &SettleOptions::new(1e-3),
            );
        })
    });
    let each = used.bytes_max as f64 / mesh.triangles.len() as f64;
    assert!(each < 64.0, "{each} bytes a triangle");
}

#[test]
fn settling_has_the_same_bits_at_any_thread_count() {
    let field = gyroid(4.0);
    let mesh = raw(&field, &cube(1.0, 30));
    let with = |threads: usize| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads")
            .install(|| settled(&field, &mesh, 1e-3))
    };
    let one = with(1);
    assert_ne!(one, mesh);
    for threads in [2, 8] {
        assert!(with(threads) == one, "{threads} threads");
    }
}

#[test]
fn what_happens_far_away_changes_no_bit() {
    // Two balls; one of them is dented. The triangles of the other come first in both meshes.
    let balls = |dent: f64| {
        differenced(move |p| {
            let dented = 0.6 - (p - DVec3::X).length() + dent * (9.0 * p.y).sin();
            dented.max(0.6 - (p + DVec3::X).length())
        })
    };
    let [even, dented] = [0.0, 0.05].map(|dent| {
        let field = balls(dent);
        settled(&*field, &raw(&*field, &cube(2.0, 40)), 1e-3)
    });
    let left = |mesh: &Mesh| -> Vec<DVec3> {
        let mut p: Vec<DVec3> = mesh.positions.iter().copied().filter(|p| p.x < 0.0).collect();
        p.sort_by(|a, b| a.to_array().partial_cmp(&b.to_array()).expect("finite"));
        p
    };
    assert!(left(&even) == left(&dented));
    assert_ne!(even.positions.len(), 0);
    assert_ne!(even, dented);
}

#[test]
fn fields_without_a_slope_or_number_leave_vertices_where_they_are() {
    let flat = differenced(|p| if p.length() < 0.7 { 1.0 } else { -1.0 });
    let undefined = differenced(|p| {
        let d = 0.7 - p.length();
        if p.x > 0.0 && d.abs() < 1e-6 { f64::NAN } else { d }
    });
    for field in [flat, undefined] {
        let mesh = raw(&*field, &cube(1.0, 16));
        let after = settled(&*field, &mesh, 1e-3);
        assert!(after.positions.iter().all(|p| p.is_finite()));
        assert!(check_mesh(&after).is_closed_manifold());
        let furthest = mesh
            .positions
            .iter()
            .zip(&after.positions)
            .map(|(p, q)| p.distance(*q))
            .fold(0.0, f64::max);
        assert!(furthest < 0.25, "{furthest}");
    }
}
