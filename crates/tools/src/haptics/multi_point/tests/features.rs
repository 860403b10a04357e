//! Solid between the points of a tool.

use glam::DVec3;

use super::super::super::{Obstacle, Pose};
use super::super::{MultiPoint, MultiPointOptions, PointTool, Sampling};
use super::scenes::*;

fn renderer(tool: &PointTool) -> MultiPoint {
    MultiPoint::new(tool.clone(), MultiPointOptions::default()).expect("options")
}

/// \[Sensable99 fig. 20\]: a thin rod that stands on a floor meets a face of a cube between its points, wherever that is.
#[test]
fn feature_between_the_points_of_a_cube_is_found() {
    let tool = PointTool::block(DVec3::splat(10.0), Sampling::default()).expect("a cube");
    let blind = PointTool::block(
        DVec3::splat(10.0),
        Sampling {
            refinement: 1,
            ..Sampling::default()
        },
    )
    .expect("a cube");
    let mut missed = 0;
    for k in 0..24 {
        let f = |n: f64| 9.0 * ((f64::from(k) * n).fract() - 0.5);
        let foot = DVec3::new(f(0.754_877_67), f(0.569_840_29), 0.0);
        // 3 mm high and 0.6 mm thick, on a floor.
        let solid = Solid::new(0.6, move |p| {
            let floor = plane(p, DVec3::ZERO, DVec3::Z);
            or(floor, rod(p, foot, foot + DVec3::new(0.0, 0.0, 2.7), 0.3))
        });
        let hand = |t: f64| Pose::at(DVec3::new(0.0, 0.0, (9.0 - 40.0 * t).max(7.0)));
        let mut with = renderer(&tool);
        let trace = follow(&mut with, &solid, 400, hand);
        let worst = trace
            .0
            .iter()
            .map(|t| dense_depth(&tool, &solid, &t.felt.proxy, 0.25))
            .fold(0.0, f64::max);
        assert!(worst < 0.02, "{foot}: {worst}");
        assert!(trace.last().felt.force.z > 0.1);
        // With the points alone the rod goes in: the test can fail.
        let trace = follow(&mut renderer(&blind), &solid, 400, hand);
        missed += usize::from(dense_depth(&blind, &solid, &trace.last().felt.proxy, 0.25) > 0.15);
    }
    assert!(missed > 12, "{missed}");
}

/// \[Sensable99 fig. 21\]: a sphere between whose points a plane would enter; it slides and turns without a bump.
#[test]
fn sphere_rolls_on_a_plane_without_bumps() {
    let tool = PointTool::sphere(8.0, Sampling::default()).expect("a sphere");
    let solid = Solid::new(1e3, |p| plane(p, DVec3::ZERO, DVec3::Z));
    let mut renderer = renderer(&tool);
    let hand = |t: f64| {
        turned(
            DVec3::new(80.0 * t, 20.0 * t, (9.0 - 20.0 * t).max(6.0)),
            DVec3::new(0.0, 10.0 * t, 2.0 * t),
        )
    };
    let trace = follow(&mut renderer, &solid, 1000, hand);
    for t in &trace.0[200..] {
        assert!((t.felt.proxy.at.z - 8.0).abs() < 0.01, "{}", t.felt.proxy.at.z);
        assert!(
            (t.felt.force - DVec3::new(0.0, 0.0, 1.0)).length() < 0.01,
            "{}",
            t.felt.force
        );
    }
    // Without finer points the height changes by what is between two points: r (1 − cos(spacing/2r)), 0.13 mm.
    let blind = PointTool::sphere(
        8.0,
        Sampling {
            refinement: 1,
            ..Sampling::default()
        },
    )
    .expect("a sphere");
    let trace = follow(
        &mut MultiPoint::new(blind, MultiPointOptions::default()).expect("options"),
        &solid,
        1000,
        hand,
    );
    let lowest = trace.0[200..]
        .iter()
        .map(|t| t.felt.proxy.at.z)
        .fold(f64::INFINITY, f64::min);
    assert!(lowest < 7.95, "{lowest}");
}

/// A sharp edge of the solid under a face of the tool: the force is across the face, though no point of the tool is near.
#[test]
fn edge_of_the_solid_slides_under_a_face() {
    let tool = PointTool::block(DVec3::new(40.0, 40.0, 4.0), Sampling::default()).expect("a plate");
    // A block stands on its edge, which lies along y at z = 0.
    let turn = super::super::turn::exponential(DVec3::new(0.0, std::f64::consts::FRAC_PI_4, 0.0));
    let middle = DVec3::new(0.0, 0.0, -10.0 * 2f64.sqrt());
    let solid = Solid::new(5.0, move |p| {
        let (d, g) = block(
            turn.inverse() * (p - middle),
            DVec3::ZERO,
            DVec3::new(10.0, 60.0, 10.0),
        );
        (d, turn * g)
    });
    let mut renderer = renderer(&tool);
    let hand = |t: f64| {
        Pose::at(DVec3::new(
            15.0 * libm::sin(4.0 * t),
            6.0 * t,
            (4.0 - 20.0 * t).max(0.0),
        ))
    };
    let trace = follow(&mut renderer, &solid, 2000, hand);
    for (k, t) in trace.0.iter().enumerate() {
        let depth = dense_depth(&tool, &solid, &t.felt.proxy, 1.0);
        assert!(depth < 0.01, "{k}: {depth}");
        if k > 250 {
            let n = t.felt.proxy.turn * DVec3::Z;
            let across = t.felt.force.normalize().cross(n).length();
            // At up to 60 mm/s, with two steps a tick.
            assert!(across < 0.05, "{k}: {across} {}", t.felt.force);
        }
    }
    assert!(trace.least_work() > -1e-4);
    assert!(trace.step() < 0.1, "{}", trace.step());
}

/// A tool that is a part of an object finds what is between its points by the object's own distance: a rod that stands on a floor
/// under its round foot.
#[test]
fn feature_between_the_points_of_a_carved_tool_is_found() {
    let object = Solid::new(10.0, |p| {
        or(ball(p, DVec3::ZERO, 9.0), ball(p, DVec3::new(6.0, 0.0, 0.0), 8.0))
    });
    let carve = |refinement: usize| {
        let sampling = Sampling {
            refinement,
            ..Sampling::default()
        };
        PointTool::carved(
            &object,
            DVec3::new(3.0, 0.0, -6.0),
            DVec3::new(9.0, 7.0, 5.0),
            sampling,
        )
        .expect("a foot")
    };
    let (tool, blind) = (carve(4), carve(1));
    let carved = |tool: &PointTool| match &tool.shape {
        Some(super::super::shape::Shape::Carved(carved)) => carved.points(0.3),
        _ => panic!("it is carved"),
    };
    let all = carved(&tool);
    assert!(all.len() > 2000, "{}", all.len());
    assert!(
        all.iter()
            .all(|p| tool.distance(*p).expect("a field").abs() - tool.nose < 1e-3)
    );
    let (mut worst, mut missed) = (0.0f64, 0);
    for k in 0..12 {
        let f = |n: f64| (f64::from(k) * n).fract() - 0.5;
        let foot = DVec3::new(3.0 + 9.0 * f(0.754_877_67), 6.0 * f(0.569_840_29), -9.0);
        let solid = Solid::new(0.6, move |p| {
            let floor = plane(p, DVec3::new(0.0, 0.0, -9.0), DVec3::Z);
            or(floor, rod(p, foot, foot + DVec3::new(0.0, 0.0, 4.7), 0.3))
        });
        let hand = |t: f64| Pose::at(DVec3::new(3.0, 0.0, (2.0 - 40.0 * t).max(-3.0)));
        let depth = |pose: &Pose| {
            let depths = all
                .iter()
                .map(|p| tool.nose - solid.distance(place(&tool, pose, *p)).0);
            depths.fold(f64::NEG_INFINITY, f64::max)
        };
        let trace = follow(&mut renderer(&tool), &solid, 300, hand);
        let deepest = trace.0.iter().step_by(3).map(|t| depth(&t.felt.proxy));
        worst = worst.max(deepest.fold(f64::NEG_INFINITY, f64::max));
        assert!(
            trace.last().felt.force.z > 0.1,
            "{foot}: {}",
            trace.last().felt.force
        );
        let trace = follow(&mut renderer(&blind), &solid, 300, hand);
        missed += usize::from(depth(&trace.last().felt.proxy) > 0.15);
    }
    println!("carved: {worst:.4} mm deep, {missed} of 12 missed without finer points");
    assert!(worst < 0.03, "{worst}");
    assert!(missed >= 6, "{missed}");
}
