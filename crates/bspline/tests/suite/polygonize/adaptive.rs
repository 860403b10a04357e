//! Laws of the meshes that follow the surface.

use std::ops::ControlFlow;
use std::sync::Arc;

use bspline::polygonize::{
    AdaptiveMesh, AdaptiveMesher, AdaptiveOptions, AdaptiveReport, Mesh, MeshCheck, PolygonizeError,
    PolygonizeOptions, check_mesh, polygonize, self_intersections,
};
use bspline::primitives::{Cuboid, Gyroid, Sphere, Torus};
use bspline::{Csg, Field, Frame};
use glam::{DAffine3, DQuat, DVec3};

use super::fields::{Random, Trilinear, random_spline, unbounded};
use super::{cube, rounded_to_f32};

pub fn meshed(
    field: &dyn Field,
    frame: &Frame,
    options: &AdaptiveOptions,
    error: f64,
    settled: bool,
) -> (AdaptiveMesh, AdaptiveReport) {
    let go_on = &mut |_| ControlFlow::Continue(());
    let mut mesher = AdaptiveMesher::new(field, frame, options, go_on).expect("a valid frame");
    mesher.mesh(error, settled, go_on).expect("a mesh")
}

pub fn options(depth: usize) -> AdaptiveOptions {
    AdaptiveOptions {
        depth,
        detection: depth,
        ..Default::default()
    }
}

fn ball(center: DVec3, radius: f64) -> Arc<dyn Field> {
    Arc::new(Sphere::new(center, radius).expect("a sphere"))
}

/// Closed, manifold and oriented; where the surface is rougher than the smallest cells, one vertex in 300 may stand where
/// another stands.
fn is_closed_but_for_touching(check: &MeshCheck) -> bool {
    let apart = MeshCheck {
        duplicate_vertices: 0,
        ..*check
    };
    apart.is_closed_manifold() && 300 * check.duplicate_vertices <= check.vertices
}

#[test]
fn random_splines_give_closed_manifolds_at_any_error() {
    for seed in 0..20 {
        let turn = DQuat::from_rotation_z(0.1 * (seed % 3) as f64);
        let map = DAffine3::from_scale_rotation_translation(
            DVec3::new(1.0, 0.7, 1.2),
            turn,
            DVec3::new(3.0, -50.0, 7.0),
        );
        let field = random_spline(seed, map);
        let along = Frame {
            world_from_grid: map,
            cells: field.lattice().cells,
        };
        // Across the knots, and larger than the box: creases at its faces.
        let across = Frame::over(&field.lattice().world_box(), [7, 6, 5]);
        for (frame, error) in [(along, 0.3), (along, 0.02), (across, 0.1)] {
            let (made, report) = meshed(&field, &frame, &options(3), error, false);
            let check = check_mesh(&rounded_to_f32(&made.mesh));
            assert!(
                is_closed_but_for_touching(&check),
                "seed {seed}, error {error}: {check:?}"
            );
            assert_eq!(made.keys.len(), check.vertices as usize);
            assert!(check.triangles > 500 && report.crossed_leaves > 0);
            let mut keys = made.keys.clone();
            keys.sort_unstable();
            keys.dedup();
            assert_eq!(keys.len(), made.keys.len(), "two vertices have one key");
        }
    }
}

#[test]
fn random_signs_give_closed_manifolds_across_sizes() {
    // The worst signs there are: each node on its own, cells of three sizes by a field that is rough in one half only.
    for seed in 0..60 {
        let density = [0.5, 0.3, 0.7, 0.1, 0.9][seed as usize % 5];
        let rough = Trilinear::random(9, seed, density);
        let flat = DVec3::new(0.31, 0.57, 0.83);
        let field = unbounded(move |p: DVec3| {
            let half = 8.0 * flat;
            if p.dot(DVec3::ONE) < half.dot(DVec3::ONE) {
                rough.value_gradient(p)
            } else {
                (flat.dot(p) - 7.3, flat)
            }
        });
        let frame = Frame {
            world_from_grid: DAffine3::IDENTITY,
            cells: [8; 3],
        };
        for depth in 0..3 {
            let (made, _) = meshed(&field, &frame, &options(depth), 1e-9, false);
            let check = check_mesh(&made.mesh);
            assert!(
                is_closed_but_for_touching(&check),
                "seed {seed}, depth {depth}: {check:?}"
            );
        }
    }
}

/// Solids with creases, thin sheets, thin gaps and caps.
fn hard_solids(seed: u64) -> Vec<(&'static str, Arc<dyn Field>)> {
    let mut random = Random(seed);
    let mut point =
        |reach: f64| DVec3::new(random.unit(), random.unit(), random.unit()) * reach - 0.5 * reach;
    let union = |fields| Arc::new(Csg::union(fields).expect("solids")) as Arc<dyn Field>;
    let without = |a, b| Arc::new(Csg::difference(a, vec![b], 0.0).expect("solids")) as Arc<dyn Field>;
    let cuboid: Arc<dyn Field> = Arc::new(Cuboid::new(point(0.3), DVec3::new(0.5, 0.4, 0.6)).expect("a box"));
    let torus: Arc<dyn Field> =
        Arc::new(Torus::new(point(0.2), DVec3::ONE + point(1.0), 0.6, 0.15).expect("a torus"));
    let (center, radius) = (point(0.2), 0.7);
    vec![
        ("box less ball", without(cuboid.clone(), ball(point(0.8), 0.4))),
        ("torus and ball", union(vec![torus, ball(point(1.0), 0.3)])),
        (
            "thin shell",
            without(ball(center, radius), ball(center, radius - 0.02)),
        ),
        (
            "narrow gap",
            union(vec![
                ball(DVec3::new(-0.505, 0.0, 0.0), 0.5),
                ball(DVec3::new(0.505, 0.0, 0.0), 0.5),
            ]),
        ),
        ("beyond the frame", ball(point(1.0), 0.9)),
        (
            "gyroid",
            Arc::new(Gyroid::new(point(1.0), 1.1, 0.2).expect("a gyroid")),
        ),
    ]
}

#[test]
fn creases_sheets_gaps_and_caps_stay_closed_and_whole() {
    for seed in 0..4 {
        for (name, field) in hard_solids(seed) {
            for error in [0.02, 0.002] {
                let (made, _) = meshed(field.as_ref(), &cube(1.0, 8), &options(5), error, false);
                let check = check_mesh(&made.mesh);
                assert!(check.is_closed_manifold(), "{name}, seed {seed}: {check:?}");
                // Where creases meet, or a cell is as large as what bends in it, a few triangles may cross.
                let crossings = self_intersections(&made.mesh) as u64;
                assert!(
                    crossings <= 2 + check.triangles / 1_000,
                    "{name}, seed {seed}, error {error}: {crossings}"
                );
            }
        }
    }
}

#[test]
fn creases_are_followed_to_the_last_level_and_told() {
    let cuboid = Cuboid::new(DVec3::new(0.01, 0.02, 0.03), DVec3::new(0.5, 0.4, 0.6)).expect("a box");
    let (_, smooth) = meshed(
        ball(DVec3::ZERO, 0.7).as_ref(),
        &cube(1.0, 8),
        &options(4),
        1e-3,
        false,
    );
    assert_eq!((smooth.leaves_at_limit, smooth.creased_leaves), (0, 0));
    let (made, report) = meshed(&cuboid, &cube(1.0, 8), &options(4), 1e-3, false);
    // Twelve edges of 6 in all, and cells of 1/64: no fewer than one along each.
    assert!(report.creased_leaves > 12 * 20, "{report:?}");
    let check = check_mesh(&made.mesh);
    assert!(
        check.is_closed_manifold() && (check.volume / 0.96 - 1.0).abs() < 2e-3,
        "{check:?}"
    );
    // Flat faces stay coarse: far fewer triangles than cells of the last level would make.
    assert!(check.triangles < 12_000, "{check:?}");
}

#[test]
fn a_ball_of_one_finest_interval_is_not_missed() {
    let mut random = Random(7);
    let frame = cube(1.0, 4);
    let depth = 5;
    // Cells of the detection level are half of it.
    let interval = 2.0 * 2.0 / (4u32 << depth) as f64;
    for seed in 0..40 {
        let mut at = || 2.0 * random.unit() - 1.0;
        let out = DVec3::new(at(), at(), at()).normalize_or(DVec3::X);
        let speck = out * 0.85;
        let field = Csg::union(vec![ball(DVec3::ZERO, 0.6), ball(speck, 0.5 * interval)]).expect("two");
        let hollow =
            Csg::difference(ball(DVec3::ZERO, 0.8), vec![ball(out * 0.5, 0.5 * interval)], 0.0).expect("two");
        for field in [&field as &dyn Field, &hollow] {
            let (made, _) = meshed(field, &frame, &options(depth), 0.05, false);
            let check = check_mesh(&made.mesh);
            assert!(
                check.is_closed_manifold() && check.components == 2,
                "seed {seed}: {check:?}"
            );
        }
    }
}

#[test]
fn a_full_box_is_itself_and_open_surfaces_end_on_it() {
    let frame = Frame {
        world_from_grid: DAffine3::from_scale(DVec3::new(1.0, 0.5, 2.0)),
        cells: [3, 4, 5],
    };
    let full = Cuboid::new(DVec3::ZERO, DVec3::splat(100.0)).expect("a box");
    let (made, _) = meshed(&full, &frame, &options(2), 0.01, false);
    let check = check_mesh(&made.mesh);
    assert!(
        check.is_closed_manifold() && (check.volume - 60.0).abs() < 1e-9,
        "{check:?}"
    );
    assert!(made.fixed.iter().all(|fixed| *fixed));

    for seed in 0..10 {
        let mut random = Random(seed);
        let origin = DVec3::new(random.unit(), random.unit(), random.unit());
        let field = Gyroid::new(origin, 1.3, 0.1).expect("a gyroid");
        let open = AdaptiveOptions {
            open: true,
            ..options(4)
        };
        let (made, _) = meshed(&field, &cube(1.0, 6), &open, 0.01, seed % 2 == 0);
        let check = check_mesh(&made.mesh);
        assert!(
            check.non_manifold_edges == 0 && !check.is_closed(),
            "seed {seed}: {check:?}"
        );
        let mut sides: Vec<[u32; 2]> = made
            .mesh
            .triangles
            .iter()
            .flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]])
            .collect();
        sides.sort_unstable();
        let mut off = Vec::new();
        for &[a, b] in &sides {
            if sides.binary_search(&[b, a]).is_err() {
                let p = made.mesh.positions[a as usize];
                assert!(
                    (p.abs().max_element() - 1.0).abs() < 1e-9,
                    "seed {seed}: a border vertex at {p}"
                );
                off.push(field.value(p).abs());
            }
        }
        // Where the surface touches the face it has no foot along it.
        off.sort_by(f64::total_cmp);
        assert!(
            off[off.len() * 95 / 100] < 0.005,
            "seed {seed}: {}",
            off[off.len() * 95 / 100]
        );
    }
}

/// Chord errors of all triangles, sorted.
fn chord_errors(field: &dyn Field, mesh: &Mesh) -> Vec<f64> {
    let off = |p: DVec3| {
        let (f, g) = field.value_gradient(p);
        f.abs() / g.length()
    };
    let mut errors: Vec<f64> = (0..mesh.triangles.len())
        .map(|t| {
            let [a, b, c] = mesh.corners(t);
            let points = [(a + b + c) / 3.0, (a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5];
            points.into_iter().map(off).fold(0.0, f64::max)
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    errors
}

#[test]
fn a_quarter_of_the_triangles_of_cells_of_one_size_will_do() {
    // A blend of a large and small balls, curvatures from 1 to 25: all of it as fine as its finest parts need.
    let small = |x: f64, y: f64| ball(DVec3::new(x, y, 0.72), 0.06);
    let balls = vec![
        ball(DVec3::ZERO, 0.7),
        small(0.1, 0.1),
        small(-0.15, 0.05),
        small(0.0, -0.2),
    ];
    let rounding = bspline::csg::Rounding::Bounded { range: 0.05 };
    let field = Csg::smooth_union(balls, rounding, 0.0).expect("balls");
    let rank = |errors: &[f64]| errors[errors.len() * 999 / 1000];
    let frame = cube(1.0, 96);
    let (uniform, _) = polygonize(field.as_ref(), &frame, &PolygonizeOptions::default()).expect("a mesh");
    let wanted = rank(&chord_errors(field.as_ref(), &uniform));
    let mut of_cells = 1.5 * wanted;
    let mut found = None;
    while found.is_none() && of_cells > 0.1 * wanted {
        let (made, _) = meshed(field.as_ref(), &cube(1.0, 8), &options(8), of_cells, true);
        let error = rank(&chord_errors(field.as_ref(), &made.mesh));
        of_cells *= 0.95 * wanted / error;
        found = (error <= wanted).then_some(made);
    }
    let made = found.expect("fine cells will do");
    assert!(
        4 * made.mesh.triangles.len() <= uniform.triangles.len(),
        "{} {}",
        made.mesh.triangles.len(),
        uniform.triangles.len()
    );
}

#[test]
fn same_bits_with_1_2_and_8_threads_and_after_other_errors() {
    let spline = random_spline(5, DAffine3::IDENTITY);
    let frame = Frame {
        world_from_grid: DAffine3::IDENTITY,
        cells: spline.lattice().cells,
    };
    for settled in [false, true] {
        let meshes = [1, 2, 8].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .expect("threads start");
            pool.install(|| meshed(&spline, &frame, &options(3), 0.02, settled))
        });
        assert!(meshes[0].0.mesh.triangles.len() > 10_000);
        assert!(meshes[0] == meshes[1] && meshes[0] == meshes[2]);
        // What was learnt for one error does not change the mesh of another.
        let go_on = &mut |_| ControlFlow::Continue(());
        let mut mesher = AdaptiveMesher::new(&spline, &frame, &options(3), go_on).expect("a frame");
        for error in [0.5, 0.004, 0.1] {
            mesher.estimate(error, go_on).expect("an octree");
        }
        let again = mesher.mesh(0.02, settled, go_on).expect("a mesh").0;
        assert!(again == meshes[0].0);
        // Nor does what was forgotten.
        let frugal = AdaptiveOptions {
            frugal: true,
            ..options(3)
        };
        let mut mesher = AdaptiveMesher::new(&spline, &frame, &frugal, go_on).expect("a frame");
        for error in [0.1, 0.02] {
            let made = mesher.mesh(error, settled, go_on).expect("a mesh").0;
            assert!(error > 0.02 || made == meshes[0].0);
        }
    }
}

#[test]
fn meshes_have_the_bits_that_they_had() {
    let spline = random_spline(5, DAffine3::IDENTITY);
    let frame = Frame {
        world_from_grid: DAffine3::IDENTITY,
        cells: spline.lattice().cells,
    };
    for (open, settled, hash) in [
        (false, false, 0x767a_0d4f_be3c_be7f),
        (true, false, 0xde31_f450_2baa_5e8c),
        (false, true, 0x00f9_82c8_9939_efff),
        (true, true, 0x47a5_bd4c_777a_eb8f),
    ] {
        let options = AdaptiveOptions { open, ..options(3) };
        let (made, _) = meshed(&spline, &frame, &options, 0.02, settled);
        let words = made
            .mesh
            .positions
            .iter()
            .flat_map(|p| p.to_array().map(f64::to_bits));
        let words = words.chain(made.mesh.triangles.iter().flatten().map(|v| u64::from(*v)));
        let words = words.chain(made.keys.iter().copied());
        let found = words.fold(0xcbf2_9ce4_8422_2325u64, |hash, word| {
            (hash ^ word).wrapping_mul(0x0100_0000_01b3)
        });
        assert_eq!(found, hash, "open: {open}, settled: {settled}");
    }
}

#[test]
fn the_estimate_is_near_the_number_of_triangles() {
    for (name, field) in hard_solids(1) {
        let go_on = &mut |_| ControlFlow::Continue(());
        let mut mesher =
            AdaptiveMesher::new(field.as_ref(), &cube(1.3, 8), &options(6), go_on).expect("a frame");
        for error in [0.01, 0.002] {
            let told = mesher.estimate(error, go_on).expect("an octree") as f64;
            let made = mesher
                .mesh(error, false, go_on)
                .expect("a mesh")
                .0
                .mesh
                .triangles
                .len() as f64;
            assert!(
                (told / made - 1.0).abs() < 0.05,
                "{name}: {told} told, {made} made"
            );
        }
    }
}

#[test]
fn senseless_adaptive_requests_are_refused() {
    let field = ball(DVec3::ZERO, 0.5);
    let go_on = &mut |_| ControlFlow::Continue(());
    let mut mesher = AdaptiveMesher::new(field.as_ref(), &cube(1.0, 8), &options(4), go_on).expect("a frame");
    for error in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(
            mesher.mesh(error, true, go_on),
            Err(PolygonizeError::Error { .. })
        ));
    }
    let stop = &mut |_| ControlFlow::Break(());
    assert_eq!(
        mesher.mesh(0.1, true, stop).err(),
        Some(PolygonizeError::Cancelled)
    );
    let deep = AdaptiveMesher::new(field.as_ref(), &cube(1.0, 8), &options(19), go_on).err();
    assert!(
        matches!(deep, Some(PolygonizeError::Cells { max: 0, .. })),
        "{deep:?}"
    );
    assert_eq!(AdaptiveOptions::most_depth(8), 16);
    let few = AdaptiveOptions {
        max_blocks: 50,
        ..options(6)
    };
    let mut mesher = AdaptiveMesher::new(field.as_ref(), &cube(1.0, 8), &few, go_on).expect("a frame");
    assert_eq!(
        mesher.mesh(1e-4, true, go_on).err(),
        Some(PolygonizeError::TooManyBlocks { limit: 50 })
    );
}
