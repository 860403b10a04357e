//! Moves: motions of space without folds, and solids carried by them.

use std::sync::Arc;

use bspline::hierarchical::{HierarchicalSpline, Lattice};
use bspline::polygonize::{PolygonizeOptions, polygonize};
use bspline::primitives::{Capsule, Sphere};
use bspline::{Aabb, Csg, Field, Frame};
use fitting::Control;
use fitting::field::{Aim, FieldFitOptions, fit_field};
use glam::{DAffine3, DVec3};
use tools::limits::Limits;
use tools::warp::{Warp, Warped};

use super::{ISO, SLOPE, random, stroke};

fn motions() -> Vec<(&'static str, Warp)> {
    let b = Aabb::new(DVec3::ZERO, DVec3::splat(24.0));
    let (at, tilted) = (DVec3::new(11.0, 12.0, 13.0), DVec3::new(0.3, -0.2, 1.0));
    let path = [
        at,
        at + DVec3::new(3.0, 1.0, 6.0),
        at + DVec3::new(-2.0, 2.0, 8.0),
    ];
    let region = Aabb::new(at - 2.0, at + DVec3::new(1.0, 2.0, 3.0));
    vec![
        ("grab", Warp::grab(&path, 0.0, 5.0).unwrap()),
        ("grab, rigid", Warp::grab(&path[..2], 2.0, 4.0).unwrap()),
        ("bend", Warp::bend(at, DVec3::X, tilted, 1.2, 6.0, &b).unwrap()),
        ("twist", Warp::twist(at, tilted, -4.0, 5.0).unwrap()),
        ("swirl", Warp::swirl(at, tilted, 3.0, 6.0).unwrap()),
        (
            "shift",
            Warp::shift(&region, DVec3::new(4.0, 0.0, -5.0), 3.0).unwrap(),
        ),
    ]
}

/// There and back, and space keeps its orientation: no point is reached twice.
#[test]
fn motions_have_a_way_back_and_no_folds() {
    let mut draw = random(1);
    for (name, warp) in motions() {
        for _ in 0..2000 {
            let p = DVec3::from_array([(); 3].map(|()| draw(0.0, 24.0)));
            let there = warp.forth(p);
            assert!(warp.back(there).distance(p) < 1e-11, "{name}: {p} to {there}");
            let (at, jacobian) = warp.back_jacobian(p);
            assert_eq!(at, warp.back(p));
            assert!(jacobian.determinant() > 0.0, "{name} folds at {p}");
        }
    }
    // The hand takes what it holds along.
    let at = DVec3::new(11.0, 12.0, 13.0);
    let held = motions().remove(0).1.forth(at);
    assert!(held.distance(at + DVec3::new(-2.0, 2.0, 8.0)) < 1e-12, "{held}");
}

/// Gradient and Hessian are the derivatives of the value, and bounds hold it.
#[test]
fn a_carried_field_answers_as_a_field() {
    let ball = Sphere::new(DVec3::splat(9.0), 5.0).unwrap();
    let mut draw = random(2);
    for (name, warp) in motions() {
        let field = Warped::new(Arc::new(ball.clone()), warp);
        for _ in 0..300 {
            let p = DVec3::from_array([(); 3].map(|()| draw(1.0, 23.0)));
            let jet = field.jet(p);
            let (value, gradient) = field.value_gradient(p);
            assert_eq!(value, field.value(p));
            assert!((jet.value - value).abs() < 1e-12 && jet.gradient.distance(gradient) < 1e-11);
            let step = 1e-5;
            for a in 0..3 {
                let (up, down) = (p + step * DVec3::AXES[a], p - step * DVec3::AXES[a]);
                let slope = (field.value(up) - field.value(down)) / (2.0 * step);
                assert!(
                    (slope - gradient[a]).abs() < 1e-6 * (1.0 + gradient.length()),
                    "{name} at {p}"
                );
                let bend = (field.value_gradient(up).1 - field.value_gradient(down).1) / (2.0 * step);
                let off = bend.distance(jet.hessian.col(a));
                // The third derivative of the share jumps where it begins and ends.
                let size = jet.hessian.col(a).length();
                assert!(
                    off < 1e-3 * (1.0 + size),
                    "{name} at {p}: {bend} for {}",
                    jet.hessian.col(a)
                );
            }
            let half = DVec3::from_array([(); 3].map(|()| draw(0.0, 1.5)));
            let b = Aabb::new(p - half, p + half);
            let bounds = field.bounds(&b);
            for _ in 0..20 {
                let q = p + half * DVec3::from_array([(); 3].map(|()| draw(-1.0, 1.0)));
                assert!(bounds.contains(field.value(q)), "{name}: {q} in {b:?}");
            }
            // They shrink with the box.
            let width = field.bounds(&Aabb::new(p - 1e-6, p + 1e-6)).width();
            assert!(width < 0.01, "{name}: {width}");
        }
    }
}

/// A slab with an ear that has a dent.
fn ear() -> HierarchicalSpline<f32> {
    let lattice = Lattice {
        world_from_lattice: DAffine3::from_scale(DVec3::splat(1.0)),
        cells: [24; 3],
    };
    let base = HierarchicalSpline::schoenberg(lattice, SLOPE, |p| SLOPE * (3.0 - p.z) + ISO).unwrap();
    let up = Capsule::new(DVec3::new(12.0, 12.0, 1.0), DVec3::new(12.0, 12.0, 10.0), 2.5).unwrap();
    let dent = Sphere::new(DVec3::new(12.0, 9.5, 10.0), 1.2).unwrap();
    let in_density = |solid: Arc<dyn Field>| Arc::new(Csg::sum(vec![(SLOPE, solid)], ISO).unwrap());
    let rounding = bspline::csg::Rounding::Bounded { range: SLOPE };
    let solid = Csg::smooth_union(
        vec![Arc::new(base.clone()), in_density(Arc::new(up))],
        rounding,
        ISO,
    )
    .unwrap();
    let solid = Csg::smooth_difference(solid, vec![in_density(Arc::new(dent))], rounding, ISO).unwrap();
    let options = FieldFitOptions {
        aim: Aim::Surface {
            iso: ISO,
            tolerance: 0.005,
        },
        finest: 2,
        look: false,
    };
    let within = base.lattice().world_box();
    fit_field(&*solid, &base, &within, &options, &mut Control::default())
        .unwrap()
        .0
}

/// The surface that comes out is the old one pushed through the motion: points to two tolerances (95 %), normals to 3° rms.
#[test]
fn a_move_equals_the_mesh_pushed_through_it() {
    let field = ear();
    let spacing = 0.25;
    let frame = Frame::over(&field.lattice().world_box(), [96; 3]);
    let options = PolygonizeOptions {
        iso: ISO,
        ..Default::default()
    };
    let (mesh, _) = polygonize(&field, &frame, &options).unwrap();
    let whole = field.lattice().world_box();
    for text in [
        // By its own length, straight and round a corner.
        "grab = { along = [[12, 12, 12], [12, 12, 19]], radius = 7 }",
        "grab = { along = [[12, 12, 12], [12, 12, 16], [15, 12, 18]], radius = 7, rigid = 1 }",
        "bend = { at = [12, 12, 8], axis = [0, 1, 0], direction = [0, 0, 1], angle = 30, length = 4 }",
        "twist = { at = [12, 12, 7], axis = [0, 0, 1], angle = 70, length = 5 }",
        "twist = { at = [12, 10, 10], axis = [0, 1, 0], angle = 60, radius = 5 }",
        "shift = { region = { min = [9, 9, 7], max = [15, 15, 14] }, by = [3, 0, 1], blend = 3 }",
    ] {
        let script = format!("move = {{ motion = {{ {text} }} }}");
        let tool = stroke(&script).motion.unwrap();
        let (moved, report) = tool
            .apply(&field, ISO, &Limits::default(), &mut Control::default())
            .unwrap();
        let warp = tool.motion.warp(&whole).unwrap();
        let tolerance = 0.02 * spacing;
        let (mut offs, mut angles) = (Vec::new(), Vec::new());
        for p in &mesh.positions {
            let p = *p;
            // Off the faces of the box, where the mesh is closed.
            if p.cmple(whole.min + 0.3).any() || p.cmpge(whole.max - 0.3).any() {
                continue;
            }
            let at = warp.forth(p);
            let (value, gradient) = moved.value_gradient(at);
            offs.push((value - ISO).abs() / gradient.length());
            let expected = warp.back_jacobian(at).1.transpose() * field.value_gradient(p).1;
            angles.push(gradient.angle_between(expected).to_degrees());
        }
        offs.sort_by(f64::total_cmp);
        let p95 = offs[offs.len() * 95 / 100];
        let rms = (angles.iter().map(|a| a * a).sum::<f64>() / angles.len() as f64).sqrt();
        eprintln!(
            "{text}: p95 {:.2} tolerances, normals {rms:.2}, {report:?}",
            p95 / tolerance
        );
        assert!(p95 <= 2.0 * tolerance, "{text}: {p95} of {tolerance}");
        assert!(rms <= 3.0, "{text}: {rms}");
    }
}

/// A mirrored solid is even to the tolerance, and the copied side stays to the bit.
#[test]
fn a_mirror_copies_one_side_to_the_other() {
    let field = super::apply(
        &super::block(),
        tools::geometric::Operation::Add,
        "shape = { sphere = { radius = 3.0 } }, along = [[16.0, 12.0, 12.0]]",
    );
    let tool = stroke("move = { motion = { mirror = { at = [12, 0, 0], normal = [1, 0, 0] } } }");
    let (even, _) = tool
        .motion
        .unwrap()
        .apply(&field, ISO, &Limits::default(), &mut Control::default())
        .unwrap();
    let mut draw = random(3);
    for _ in 0..2000 {
        let p = DVec3::from_array([draw(0.0, 12.0), draw(0.0, 24.0), draw(9.0, 17.0)]);
        let other = DVec3::new(24.0 - p.x, p.y, p.z);
        let (a, b) = (even.value_gradient(p), even.value(other));
        if (a.0 - ISO).abs() < SLOPE && (p.x < 10.5) {
            assert!((a.0 - b).abs() < 0.02 * a.1.length(), "{p}: {} for {b}", a.0);
        }
        if p.x < 10.0 {
            assert_eq!(even.value(other).to_bits(), field.value(other).to_bits(), "{p}");
        }
    }
}

#[test]
fn motions_that_make_no_sense_are_refused() {
    let field = super::block();
    for (text, why) in [
        ("grab = { along = [[9, 9, 9]], radius = 2 }", "nowhere"),
        ("grab = { along = [], radius = 2 }", "nowhere"),
        ("grab = { along = [[9, 9, 9], [9, 9, 9]], radius = 2 }", "nowhere"),
        (
            "grab = { along = [[9, 9, 9], [9, 9, 12]], radius = 2, rigid = 2 }",
            "above rigid",
        ),
        (
            "grab = { along = [[9, 9, 9], [9, 9, 1e9]], radius = 2 }",
            "too long",
        ),
        (
            "grab = { along = [[99, 99, 99], [99, 99, 97]], radius = 2 }",
            "the field from",
        ),
        (
            "grab = { along = [[12, 12, 12], [12, 12, 25]], radius = 6, rigid = 3 }",
            "leave the box",
        ),
        (
            "bend = { at = [9, 9, 9], axis = [0, 0, 0], direction = [0, 0, 1], angle = 9, length = 1 }",
            "no direction",
        ),
        (
            "bend = { at = [9, 9, 9], axis = [0, 0, 2], direction = [0, 0, 1], angle = 9, length = 1 }",
            "same way",
        ),
        (
            "bend = { at = [9, 9, 9], axis = [1, 0, 0], direction = [0, 0, 1], angle = 0, length = 1 }",
            "not 0",
        ),
        (
            "twist = { at = [9, 9, 9], axis = [0, 0, 1], angle = 9 }",
            "exactly one",
        ),
        (
            "twist = { at = [9, 9, 9], axis = [0, 0, 1], angle = 1e9, length = 1 }",
            "36000",
        ),
        (
            "shift = { region = { min = [9, 9, 9], max = [9, 10, 10] }, by = [1, 0, 0], blend = 1 }",
            "no size",
        ),
        ("mirror = { at = [9, 9, 9], normal = [0, 0, 0] }", "no direction"),
    ] {
        let tool = stroke(&format!("move = {{ motion = {{ {text} }} }}"));
        let error = tool
            .motion
            .unwrap()
            .apply(&field, ISO, &Limits::default(), &mut Control::default())
            .unwrap_err()
            .to_string();
        assert!(error.contains(why), "{text}: {error}");
    }
}
