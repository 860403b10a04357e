//! Laws of the mesher: what every mesh must be, on fields chosen to break it.

mod adaptive;
mod fields;
mod live;
mod settle;

use std::f64::consts::PI;
use std::ops::ControlFlow;

use bspline::polygonize::{
    Mesh, MeshReport, Placement, PolygonizeError, PolygonizeOptions, check_mesh, polygonize, polygonize_with,
};
use bspline::{Aabb, Field, Frame, Interval};
use glam::{DAffine3, DMat3, DQuat, DVec3};

use fields::{Formula, Trilinear, gyroid, random_spline, sphere, unbounded};

fn cube(half: f64, cells: u32) -> Frame {
    Frame::over(&Aabb::new(DVec3::splat(-half), DVec3::splat(half)), [cells; 3])
}

fn mesh_of(field: &dyn Field, frame: &Frame, options: &PolygonizeOptions) -> (Mesh, MeshReport) {
    polygonize(field, frame, options).expect("valid frame and options")
}

fn rounded_to_f32(mesh: &Mesh) -> Mesh {
    let positions = mesh.positions.iter().map(|p| p.as_vec3().as_dvec3()).collect();
    Mesh {
        positions,
        normals: Vec::new(),
        triangles: mesh.triangles.clone(),
    }
}

#[test]
fn random_signs_give_closed_manifolds() {
    for nodes in 6..=12 {
        for seed in 0..40 {
            let density = [0.5, 0.3, 0.7, 0.1, 0.9][seed as usize % 5];
            let field = Trilinear::random(nodes, 1000 * nodes as u64 + seed, density);
            let frame = Frame {
                world_from_grid: DAffine3::IDENTITY,
                cells: [nodes as u32 - 1; 3],
            };
            for placement in [Placement::Linear, Placement::RootFinding { tolerance: 1e-4 }] {
                let options = PolygonizeOptions {
                    placement,
                    ..Default::default()
                };
                let (mesh, report) = mesh_of(&field, &frame, &options);
                let check = check_mesh(&rounded_to_f32(&mesh));
                assert!(
                    check.is_closed_manifold(),
                    "{nodes} nodes, seed {seed}: {check:?}"
                );
                assert!(check.volume > 0.0 && report.unsound_blocks == 0);
            }
        }
    }
}

#[test]
fn open_meshes_end_at_the_frame_and_only_there() {
    for nodes in [6, 8, 9, 10, 12, 17] {
        for seed in 0..20 {
            let field = Trilinear::random(nodes, 77 * nodes as u64 + seed, 0.5);
            let last = (nodes - 1) as f64;
            let frame = Frame {
                world_from_grid: DAffine3::IDENTITY,
                cells: [nodes as u32 - 1; 3],
            };
            let options = PolygonizeOptions {
                open: true,
                ..Default::default()
            };
            let (mesh, report) = mesh_of(&field, &frame, &options);
            let check = check_mesh(&mesh);
            assert!(
                check.is_manifold() && !check.is_closed(),
                "{nodes} nodes, seed {seed}: {check:?}"
            );
            assert_eq!(report.cap_vertices, 0);
            let mut sides: Vec<[u32; 2]> = mesh
                .triangles
                .iter()
                .flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]])
                .collect();
            sides.sort_unstable();
            for &[a, b] in &sides {
                if sides.binary_search(&[b, a]).is_err() {
                    let (p, q) = (mesh.positions[a as usize], mesh.positions[b as usize]);
                    let on_face = (0..3).any(|n| p[n] == q[n] && (p[n] == 0.0 || p[n] == last));
                    assert!(
                        on_face,
                        "{nodes} nodes, seed {seed}: border side {p} {q} inside the frame"
                    );
                }
            }
            let box_ = check.bounding_box.expect("not empty");
            assert!(box_.min.min_element() >= 0.0 && box_.max.max_element() <= last);
        }
    }
}

#[test]
fn blocks_and_caps_of_any_size_fit_together() {
    // Frames below, at and above the size of a block, not cubes, so that each border occurs with each remainder.
    for cells in [
        [1, 1, 1],
        [1, 2, 9],
        [7, 8, 9],
        [8, 8, 8],
        [16, 7, 15],
        [17, 8, 1],
        [23, 24, 25],
    ] {
        let frame = Frame {
            world_from_grid: DAffine3::from_translation(DVec3::splat(-0.3)),
            cells,
        };
        let field = Trilinear::random(26, 5, 0.5);
        for open in [false, true] {
            let (mesh, _) = mesh_of(
                &field,
                &frame,
                &PolygonizeOptions {
                    open,
                    ..Default::default()
                },
            );
            let check = check_mesh(&mesh);
            assert!(
                check.is_manifold() && (open || check.is_closed()),
                "{cells:?} {open}: {check:?}"
            );
        }
        let full = unbounded(|_| (1.0, DVec3::ZERO));
        let (mesh, report) = mesh_of(&full, &frame, &PolygonizeOptions::default());
        let check = check_mesh(&mesh);
        let volume: f64 = cells.iter().map(|&n| n as f64).product();
        assert!(check.is_closed_manifold() && check.euler_characteristic == 2);
        assert!(
            (check.volume / volume - 1.0).abs() < 7e-3,
            "{cells:?}: {}",
            check.volume
        );
        assert_eq!(report.cap_vertices, check.vertices);
        let (mesh, _) = mesh_of(
            &full,
            &frame,
            &PolygonizeOptions {
                open: true,
                ..Default::default()
            },
        );
        assert!(mesh.positions.is_empty() && mesh.triangles.is_empty());
    }
}

#[test]
fn sphere_is_met_within_the_tolerance() {
    let radius = 0.8;
    let field = sphere(DVec3::new(0.01, -0.02, 0.03), radius);
    let frame = cube(1.0, 64);
    let h = 2.0 / 64.0;
    let (mesh, report) = mesh_of(&field, &frame, &PolygonizeOptions::default());
    let check = check_mesh(&rounded_to_f32(&mesh));
    assert!(check.is_closed_manifold() && check.euler_characteristic == 2 && check.components == 1);
    // Chords lie inside by at most h²/4 on the mean square diagonal of a cell, so the volume is short by O(h²).
    let exact = 4.0 / 3.0 * PI * radius.powi(3);
    assert!(
        check.volume < exact && check.volume > exact - 4.0 * PI * radius * radius * 0.25 * h * h / radius
    );
    // The clamp moves a vertex by up to 1e-3 edges; all others are roots to 1e-4 edges.
    let off: Vec<f64> = mesh.positions.iter().map(|&p| field.value(p).abs() / h).collect();
    assert!(off.iter().all(|&d| d < 1.1e-3));
    assert!(off.iter().filter(|&&d| d > 1e-4).count() * 200 < off.len());
    assert!(
        report.root_evaluations as f64 <= 1.1 * check.vertices as f64,
        "{report:?}"
    );
    assert_eq!(report.unconverged_vertices, 0);

    let options = PolygonizeOptions {
        placement: Placement::Linear,
        ..Default::default()
    };
    let (linear, report) = mesh_of(&field, &frame, &options);
    assert_eq!((report.root_evaluations, linear.triangles), (0, mesh.triangles));
}

#[test]
fn normals_and_triangles_point_out_of_the_solid() {
    // Mirrored, sheared and far from the origin: the frame must not change which side is out.
    let turn =
        DMat3::from_rotation_y(0.3) * DMat3::from_cols_array(&[1.0, 0.0, 0.0, 0.2, 0.8, 0.0, 0.1, -0.1, 1.3]);
    for mirror in [1.0, -1.0] {
        let matrix3 = turn * DMat3::from_diagonal(DVec3::new(0.1, 0.1 * mirror, 0.1));
        let translation = DVec3::splat(100.0) - matrix3 * DVec3::splat(20.0);
        let frame = Frame {
            world_from_grid: DAffine3 { matrix3, translation },
            cells: [40; 3],
        };
        let field = sphere(DVec3::splat(100.0), 1.2);
        let options = PolygonizeOptions {
            normals: true,
            ..Default::default()
        };
        let (mesh, _) = mesh_of(&field, &frame, &options);
        let check = check_mesh(&mesh);
        assert!(check.is_closed_manifold());
        assert!(
            (check.volume / (4.0 / 3.0 * PI * 1.2f64.powi(3)) - 1.0).abs() < 0.01,
            "{}",
            check.volume
        );
        for (p, n) in mesh.positions.iter().zip(&mesh.normals) {
            assert!((*n - (*p - 100.0).normalize()).length() < 1e-12);
        }
        for i in 0..mesh.triangles.len() {
            let [a, b, c] = mesh.corners(i);
            let normal = (b - a).cross(c - a);
            assert!(normal.dot(a - 100.0) > 0.0);
        }
    }
    // On the cap the normal is that of the box.
    let options = PolygonizeOptions {
        normals: true,
        ..Default::default()
    };
    let (mesh, report) = mesh_of(&sphere(DVec3::ZERO, 1.2), &cube(1.0, 30), &options);
    assert!(report.cap_vertices > 1000);
    let on_cap = mesh
        .positions
        .iter()
        .zip(&mesh.normals)
        .filter(|(p, _)| p.abs().max_element() > 1.0);
    let mut count = 0;
    for (p, n) in on_cap {
        let axis = p.abs().max_position();
        assert_eq!(n[axis], p[axis].signum());
        count += 1;
    }
    assert_eq!(count, report.cap_vertices);
}

#[test]
fn gyroid_is_capped_and_closed() {
    let (mesh, report) = mesh_of(&gyroid(0.7), &cube(1.0, 60), &PolygonizeOptions::default());
    let check = check_mesh(&rounded_to_f32(&mesh));
    assert!(check.is_closed_manifold() && report.cap_vertices > 0, "{check:?}");
    // The gyroid halves space.
    assert!((check.volume / 8.0 - 0.5).abs() < 0.02, "{}", check.volume);
    assert!(
        report.root_evaluations as f64 <= 1.5 * check.vertices as f64,
        "{report:?}"
    );
}

#[test]
fn same_bits_with_1_2_and_8_threads() {
    let options = PolygonizeOptions {
        normals: true,
        ..Default::default()
    };
    let fields: [&dyn Field; 2] = [&gyroid(0.31), &sphere(DVec3::splat(0.1), 0.95)];
    for field in fields {
        let meshes = [1, 2, 8].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .expect("threads start");
            pool.install(|| mesh_of(field, &cube(1.0, 70), &options))
        });
        assert!(meshes[0] == meshes[1] && meshes[0] == meshes[2]);
        assert!(meshes[0].0.triangles.len() > 10_000);
    }
}

#[test]
fn culling_changes_cost_but_no_bit() {
    let bounded = sphere(DVec3::new(0.3, 0.1, -0.4), 0.9);
    let frame = cube(1.0, 100);
    let all = unbounded(|p| bounded.value_gradient(p));
    let (mesh, report) = mesh_of(&bounded, &frame, &PolygonizeOptions::default());
    let (slow, slow_report) = mesh_of(&all, &frame, &PolygonizeOptions::default());
    assert!(mesh == slow);
    assert!(report.node_evaluations * 3 < slow_report.node_evaluations);
    assert!(
        report.culled_share() > 0.7 && slow_report.culled_share() == 0.0,
        "{}",
        report.culled_share()
    );
}

#[test]
fn unsound_bounds_leave_no_hole() {
    // Bounds that see the sphere only where x < 0: the surface is followed into the other half.
    let truth = sphere(DVec3::ZERO, 0.8);
    let frame = cube(1.0, 80);
    let liar = Formula {
        value_gradient: |p| truth.value_gradient(p),
        bounds: |b: &Aabb| {
            if b.min.x > 0.05 {
                Interval::point(-1.0)
            } else {
                truth.bounds(b)
            }
        },
    };
    let (expected, sound) = mesh_of(&truth, &frame, &PolygonizeOptions::default());
    let (mesh, report) = mesh_of(&liar, &frame, &PolygonizeOptions::default());
    assert!(mesh == expected);
    assert!(
        sound.unsound_blocks == 0 && report.unsound_blocks > 20,
        "{report:?}"
    );
}

#[test]
fn surfaces_through_nodes_stay_manifold() {
    // Planes and boxes whose faces lie on nodes, where f = iso exactly: inside is strict, vertices keep off.
    let frame = Frame {
        world_from_grid: DAffine3::IDENTITY,
        cells: [20; 3],
    };
    let octahedron = unbounded(|p| {
        let r = p - 10.0;
        (6.0 - r.abs().element_sum(), -r.signum())
    });
    let box_ = unbounded(|p| {
        let r = p - 10.0;
        let axis = r.abs().max_position();
        let mut gradient = DVec3::ZERO;
        gradient[axis] = -r[axis].signum();
        (4.0 - r.abs().max_element(), gradient)
    });
    let fields: [(&dyn Field, f64); 2] = [(&octahedron, 288.0), (&box_, 512.0 - 36.0 - 20.0 / 3.0)];
    for (field, volume) in fields {
        for placement in [Placement::Linear, Placement::RootFinding { tolerance: 1e-4 }] {
            let options = PolygonizeOptions {
                placement,
                ..Default::default()
            };
            let (mesh, _) = mesh_of(field, &frame, &options);
            let check = check_mesh(&rounded_to_f32(&mesh));
            assert!(
                check.is_closed_manifold() && check.euler_characteristic == 2,
                "{check:?}"
            );
            // The box of 8³ has 7³ inside nodes: it loses half a cell's section along 12 edges of 6 cells and
            // five sixths of the cell at each corner.
            assert!(
                (check.volume / volume - 1.0).abs() < 0.01,
                "{} {volume}",
                check.volume
            );
        }
    }
}

#[test]
fn undefined_values_count_as_outside_and_are_reported() {
    let whole = sphere(DVec3::ZERO, 0.8);
    let holed = unbounded(|p| {
        let (f, g) = whole.value_gradient(p);
        if p.x > 0.21 && p.y > 0.11 {
            (f64::NAN, DVec3::NAN)
        } else {
            (f, g)
        }
    });
    let frame = cube(1.0, 40);
    let (mesh, report) = mesh_of(
        &holed,
        &frame,
        &PolygonizeOptions {
            normals: true,
            ..Default::default()
        },
    );
    let check = check_mesh(&mesh);
    assert!(check.is_closed_manifold(), "{check:?}");
    assert!(mesh.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-12));
    // Nodes with x > 0.21 and y > 0.11: 16 × 18 columns of 41.
    assert_eq!(report.nan_nodes, 16 * 18 * 41);
    let infinite = unbounded(|p: DVec3| (if p.length() < 0.5 { f64::INFINITY } else { -1.0 }, DVec3::ZERO));
    let (mesh, report) = mesh_of(&infinite, &frame, &PolygonizeOptions::default());
    let check = check_mesh(&mesh);
    assert!(check.is_closed_manifold() && report.nan_nodes == 0);
    assert!((check.volume / (4.0 / 3.0 * PI * 0.125) - 1.0).abs() < 0.05);
}

#[test]
fn progress_rises_and_may_cancel() {
    let field = sphere(DVec3::ZERO, 0.8);
    let (frame, options) = (cube(1.0, 64), PolygonizeOptions::default());
    let mut seen = Vec::new();
    polygonize_with(&field, &frame, &options, &mut |done| {
        seen.push(done);
        ControlFlow::Continue(())
    })
    .expect("not cancelled");
    assert!(
        seen.is_sorted() && seen.len() >= 3 && seen.last() == Some(&1.0),
        "{seen:?}"
    );
    for calls in 0..seen.len() {
        let mut left = calls;
        let result = polygonize_with(&field, &frame, &options, &mut |_| {
            if left == 0 {
                return ControlFlow::Break(());
            }
            left -= 1;
            ControlFlow::Continue(())
        });
        assert_eq!(result.expect_err("cancelled"), PolygonizeError::Cancelled);
    }
}

#[test]
fn senseless_requests_are_refused() {
    let field = sphere(DVec3::ZERO, 0.8);
    let good = PolygonizeOptions::default();
    let refuse = |frame: &Frame, options: &PolygonizeOptions| {
        polygonize(&field, frame, options).expect_err("must be refused")
    };
    assert!(matches!(
        refuse(&cube(1.0, 0), &good),
        PolygonizeError::Cells { .. }
    ));
    assert!(matches!(
        refuse(&cube(1.0, u32::MAX), &good),
        PolygonizeError::Cells { .. }
    ));
    assert!(matches!(
        refuse(&cube(0.0, 10), &good),
        PolygonizeError::Frame { .. }
    ));
    assert!(matches!(
        refuse(&cube(f64::NAN, 10), &good),
        PolygonizeError::Frame { .. }
    ));
    let iso = PolygonizeOptions {
        iso: f64::NAN,
        ..good
    };
    assert!(matches!(
        refuse(&cube(1.0, 10), &iso),
        PolygonizeError::Iso { .. }
    ));
    for tolerance in [0.0, -1.0, f64::NAN, 1.0] {
        let options = PolygonizeOptions {
            placement: Placement::RootFinding { tolerance },
            ..good
        };
        assert!(matches!(
            refuse(&cube(1.0, 10), &options),
            PolygonizeError::Tolerance { .. }
        ));
    }
    let few = PolygonizeOptions {
        max_blocks: 100,
        ..good
    };
    assert_eq!(
        refuse(&cube(1.0, 400), &few),
        PolygonizeError::TooManyBlocks { limit: 100 }
    );
    // A field that tells nothing about itself, asked for 10^19 cells, is refused at once.
    let blind = unbounded(|p| (p.x, DVec3::X));
    let error = polygonize(
        &blind,
        &cube(1.0, 1 << 21),
        &PolygonizeOptions {
            max_blocks: 1 << 16,
            ..good
        },
    );
    assert_eq!(
        error.expect_err("too large"),
        PolygonizeError::TooManyBlocks { limit: 1 << 16 }
    );
}

#[test]
fn splines_are_meshed_along_and_across_their_knots() {
    for seed in 0..4 {
        let map = DAffine3::from_scale_rotation_translation(
            DVec3::new(1.0, 0.7, 1.2),
            DQuat::from_rotation_z(if seed % 2 == 0 { 0.0 } else { 0.4 }),
            DVec3::new(3.0, -50.0, 7.0),
        );
        let field = random_spline(seed, map);
        let along = Frame {
            world_from_grid: map * DAffine3::from_scale(DVec3::splat(0.25)),
            cells: [40, 36, 48],
        };
        // Turned against the lattice and larger than its box.
        let across = Frame::over(&field.lattice().world_box(), [45; 3]);
        for frame in [along, across] {
            let (mesh, report) = mesh_of(&field, &frame, &PolygonizeOptions::default());
            let check = check_mesh(&mesh);
            assert!(check.is_closed_manifold() && check.triangles > 5000, "{check:?}");
            assert_eq!(report.unsound_blocks, 0);
            // Roots within 1e-4 of an edge up to the clamp of 1e-3, and the field's own rounding. The steepest
            // slope is about 3 per cell of the finer level.
            let edge = frame.world_from_grid.matrix3.x_axis.length();
            let step = (0..3)
                .map(|a| frame.world_from_grid.matrix3.col(a).length())
                .fold(edge, f64::max);
            let box_ = Aabb::new(DVec3::ZERO, frame.cells.map(f64::from).into());
            let mut far = 0;
            for &p in &mesh.positions {
                let q = frame.world_from_grid.inverse().transform_point3(p);
                if q.cmpge(box_.min).all() && q.cmple(box_.max).all() {
                    let (f, gradient) = field.value_gradient(p);
                    far += (f.abs() > 2e-4 * step * gradient.length() + 1e-6) as usize;
                }
            }
            assert!(
                far * 100 < mesh.positions.len(),
                "{far} of {}",
                mesh.positions.len()
            );
        }
    }
}
