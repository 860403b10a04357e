//! Faces, hollows, edges and grooves: the four cases of the source.

use glam::DVec3;

use super::super::super::{Contact, Pose};
use super::super::{MultiPoint, MultiPointOptions, PointTool, Sampling, ToolError};
use super::scenes::*;

pub fn cube() -> PointTool {
    PointTool::block(DVec3::splat(10.0), Sampling::default()).expect("a cube")
}

fn renderer(tool: PointTool) -> MultiPoint {
    MultiPoint::new(tool, MultiPointOptions::default()).expect("options")
}

pub fn all_tools() -> Vec<(&'static str, PointTool)> {
    let s = Sampling::default();
    vec![
        ("sphere", PointTool::sphere(5.0, s).expect("a sphere")),
        ("cylinder", PointTool::cylinder(4.0, 12.0, s).expect("a cylinder")),
        ("block", cube()),
        ("plate", PointTool::plate(20.0, 30.0, 1.0, s).expect("a plate")),
        (
            "spatula",
            PointTool::spatula(10.0, 30.0, 1.0, s).expect("a spatula"),
        ),
        ("knife", PointTool::knife(12.0, 30.0, 2.0, s).expect("a knife")),
    ]
}

/// Case 1, and case 2 in the middle: every tool presses a plane with K times the depth of its lowest place.
#[test]
fn steady_force_on_a_plane_is_stiffness_times_depth() {
    for (name, tool) in all_tools() {
        let solid = Solid::new(1e3, |p| plane(p, DVec3::ZERO, DVec3::Z));
        // Height at which the lowest place of the surface touches, not turned.
        let shape = tool.shape.as_ref().expect("a shape");
        let touch = tool.nose
            - shape
                .points(0.02 * tool.spacing.max(1.0))
                .iter()
                .fold(f64::INFINITY, |a, p| a.min(p.z));
        let mut renderer = renderer(tool.clone());
        let hand = |t: f64| {
            Pose::at(DVec3::new(
                10.0 * t,
                0.0,
                (touch + 3.0 - 50.0 * t).max(touch - 4.0),
            ))
        };
        let trace = follow(&mut renderer, &solid, 300, hand);
        let (depth, when) = trace.depth(&tool, &solid);
        assert!(depth < 0.01, "{name}: {depth} mm at {when}");
        let last = trace.last();
        let expected = DVec3::new(0.0, 0.0, 0.5 * 4.0);
        assert!(
            (last.felt.force - expected).length() < 0.02 * 2.0,
            "{name}: {}",
            last.felt.force
        );
        assert_eq!(last.felt.contact, Contact::Slides);
        assert_eq!(trace.0[20].felt.contact, Contact::Free);
        assert_eq!(trace.0[20].felt.force, DVec3::ZERO);
        assert!(trace.step() <= 1.05 * 0.5 * 0.051, "{name}: {}", trace.step());
        assert!(trace.least_work() > -1e-4, "{name}: {}", trace.least_work());
    }
}

/// Case 4: three planes that meet in a hollow hold the cube; the force is that of the projection.
#[test]
fn cube_rests_in_a_hollow_corner() {
    let walls = |p: DVec3| {
        let floor = or(plane(p, DVec3::ZERO, DVec3::X), plane(p, DVec3::ZERO, DVec3::Y));
        or(floor, plane(p, DVec3::ZERO, DVec3::Z))
    };
    let solid = Solid::new(1e3, walls);
    let tool = cube();
    let mut renderer = renderer(tool.clone());
    let goal = DVec3::new(2.0, 3.5, 1.0);
    let hand = |t: f64| Pose::at(DVec3::splat(12.0).lerp(goal, (5.0 * t).min(1.0)));
    let trace = follow(&mut renderer, &solid, 400, hand);
    assert!(trace.depth(&tool, &solid).0 < 0.01);
    let expected = 0.5 * (DVec3::splat(5.0) - goal);
    let force = trace.last().felt.force;
    assert!(
        (force - expected).length() < 0.02 * expected.length(),
        "{force} {expected}"
    );
    // Projections on convex sets never go further than what they project.
    let speed = 5.0 * (DVec3::splat(12.0) - goal).length();
    assert!(trace.step() <= 1.05 * 0.5 * speed * DT, "{}", trace.step());
}

/// Case 3, convex: the cube goes over the edge and down the other side as far as the hand.
#[test]
fn cube_crosses_a_right_edge_without_sticking() {
    let solid = Solid::new(10.0, |p| {
        block(p, DVec3::new(-20.0, 0.0, -20.0), DVec3::splat(20.0))
    });
    let tool = cube();
    let mut renderer = renderer(tool.clone());
    // 2 mm into the top, over the edge at x = 0, and down beside it, 1 mm into the side.
    let hand = |t: f64| {
        let x = (-8.0 + 60.0 * t).min(8.0);
        let down = (60.0 * (t - 0.35).max(0.0)).min(12.0);
        let back = (40.0 * (t - 0.6).max(0.0)).min(4.0);
        Pose::at(DVec3::new(
            x - back,
            0.0,
            3.0 + 4.0 * (1.0 - 20.0 * t).max(0.0) - down,
        ))
    };
    let trace = follow(&mut renderer, &solid, 900, hand);
    assert!(
        trace.depth(&tool, &solid).0 < 0.01,
        "{:?}",
        trace.depth(&tool, &solid)
    );
    for (k, t) in trace.0.iter().enumerate() {
        let lag = t.hand.at.x - t.felt.proxy.at.x;
        assert!(lag.abs() < 2.0, "{k}: {lag}");
    }
    let over = trace.0[345].felt;
    assert!(over.force.length() < 1e-6, "{}", over.force);
    let side = trace.last().felt;
    assert!(
        (side.force - DVec3::new(0.5, 0.0, 0.0)).length() < 0.01,
        "{}",
        side.force
    );
    assert!(trace.step() <= 0.25 + 1e-12 && trace.least_work() > -1e-4);
}

/// Case 3, concave: along a trough, pressed into it and pushed aside.
#[test]
fn cube_slides_along_a_trough_without_leaving_it() {
    for angle in [90.0f64, 60.0, 40.0] {
        let half = 0.5 * angle.to_radians();
        // Walls that meet along y, normals into the air.
        let (s, c) = (libm::sin(half), libm::cos(half));
        let (left, right) = (DVec3::new(c, 0.0, s), DVec3::new(-c, 0.0, s));
        let solid = Solid::new(10.0, move |p| {
            or(plane(p, DVec3::ZERO, left), plane(p, DVec3::ZERO, right))
        });
        let tool = cube();
        let mut renderer = renderer(tool.clone());
        // A cube in the trough, not turned: its lower edges touch at x = ±5.
        let touch = 5.0 + 5.0 * c / s;
        let hand = |t: f64| {
            let aside = 0.3 * libm::sin(40.0 * t);
            Pose::at(DVec3::new(aside, 40.0 * t, touch + (5.0 - 40.0 * t).max(-3.0)))
        };
        let trace = follow(&mut renderer, &solid, 1000, hand);
        let (depth, when) = trace.depth(&tool, &solid);
        assert!(depth < 0.01, "{angle}: {depth} at {when}");
        for t in &trace.0[300..] {
            assert_eq!(t.felt.contact, Contact::Slides);
            let lag = t.hand.at.y - t.felt.proxy.at.y;
            assert!(lag.abs() < 0.01, "{angle}: {lag}");
            assert!(t.felt.proxy.at.x.abs() < 0.1, "{angle}: {}", t.felt.proxy.at.x);
            assert!((t.felt.force.z - 1.5).abs() < 0.03, "{angle}: {}", t.felt.force);
        }
        assert!(trace.step() <= 0.03, "{angle}: {}", trace.step());
        assert!(trace.least_work() > -1e-4);
    }
}

/// A plate pressed on a knob away from its middle: the torque is r × F.
#[test]
fn torque_of_a_plate_pressed_off_centre_is_arm_times_force() {
    let tool = PointTool::block(DVec3::new(40.0, 30.0, 2.0), Sampling::default()).expect("a plate");
    for knob in [
        DVec3::new(12.0, 0.0, 0.0),
        DVec3::new(-7.3, 9.1, 0.0),
        DVec3::new(0.4, -11.7, 0.0),
    ] {
        for handle in [DVec3::ZERO, DVec3::new(0.0, -10.0, 5.0)] {
            let solid = Solid::new(2.0, move |p| ball(p, knob, 1.0));
            let tool = tool.clone().with_handle(handle);
            let mut renderer = renderer(tool.clone());
            let hand = |t: f64| Pose::at(handle + DVec3::new(0.0, 0.0, (4.0 - 20.0 * t).max(-1.0)));
            let trace = follow(&mut renderer, &solid, 1500, hand);
            let felt = trace.last().felt;
            // The one contact: the place of the ball nearest to the plate.
            let n = felt.proxy.turn * DVec3::Z;
            let contact = knob + n;
            let expected = (contact - felt.proxy.at).cross(felt.force);
            assert!(felt.force.length() > 0.3, "{}", felt.force);
            let off = (felt.torque - expected).length();
            assert!(
                off < 0.02 * expected.length(),
                "{knob} {handle}: {} {expected}",
                felt.torque
            );
            assert!(dense_depth(&tool, &solid, &felt.proxy, 0.05) < 0.01);
        }
    }
}

/// Points carved from a block press a plane with its corners, as the block itself would.
#[test]
fn carved_tools_touch_as_what_they_were_carved_from() {
    let half = DVec3::new(4.0, 3.0, 2.0);
    let object = Solid::new(4.0, move |p| block(p, DVec3::new(50.0, 0.0, 0.0), half));
    let tool = PointTool::carved(
        &object,
        DVec3::new(50.0, 0.0, 0.0),
        DVec3::splat(5.0),
        Sampling::default(),
    );
    let tool = tool.expect("a surface");
    assert_eq!(tool.points().len(), 80);
    let solid = Solid::new(1e3, |p| plane(p, DVec3::ZERO, DVec3::Z));
    let hand = |t: f64| Pose::at(DVec3::new(0.0, 0.0, (4.0 - 20.0 * t).max(1.0)));
    let last = follow(&mut renderer(tool), &solid, 400, hand).last();
    assert!(
        (last.felt.force - DVec3::new(0.0, 0.0, 0.5)).length() < 0.01,
        "{}",
        last.felt.force
    );
    let air = PointTool::carved(&object, DVec3::ZERO, DVec3::ONE, Sampling::default());
    assert!(matches!(air, Err(ToolError::NoSurface { .. })));
}

/// The handle moves in the tool while it touches: the tool stays, and the torque is about the new handle.
#[test]
fn handle_moves_without_moving_the_tool() {
    let points = vec![
        DVec3::ZERO,
        DVec3::new(10.0, 0.0, 0.0),
        DVec3::new(0.0, 10.0, 0.0),
    ];
    let tool = PointTool::from_points(points, 0.5).expect("points");
    // A knob under the first point alone.
    let solid = Solid::new(2.0, |p| ball(p, DVec3::new(0.0, 0.0, -1.0), 1.0));
    let mut renderer = renderer(tool);
    let down = |t: f64| DVec3::new(0.0, 0.0, (2.0 - 20.0 * t).max(-0.5));
    let before = follow(&mut renderer, &solid, 400, |t| Pose::at(down(t))).last();
    assert!((before.felt.force.z - 0.5).abs() < 0.01 && before.felt.torque.length() < 0.01);
    let handle = DVec3::new(10.0, 0.0, 0.0);
    renderer.set_handle(handle);
    let after = follow(&mut renderer, &solid, 1000, |_| Pose::at(handle + down(1.0)));
    let first = after.0[0].felt;
    assert!(
        (first.proxy.at - before.felt.proxy.at - handle).length() < 0.1,
        "{}",
        first.proxy.at
    );
    let felt = after.last().felt;
    // The knob's contact is 10 mm from the handle now.
    let arm = felt.proxy.turn * -handle - 0.5 * DVec3::Z;
    let expected = arm.cross(felt.force);
    assert!(
        (felt.torque - expected).length() < 0.02 * expected.length(),
        "{} {expected}",
        felt.torque
    );
}

#[test]
fn options_and_tools_that_make_no_sense_are_refused() {
    let tool = || PointTool::from_points(vec![DVec3::ZERO], 0.0).expect("a point");
    let refused = |options| MultiPoint::new(tool(), options).is_err();
    let good = MultiPointOptions::default();
    assert!(!refused(good));
    assert!(refused(MultiPointOptions { slew: 0.0, ..good }));
    assert!(refused(MultiPointOptions {
        angular_stiffness: f64::NAN,
        ..good
    }));
    assert!(refused(MultiPointOptions {
        iterations: 0,
        ..good
    }));
    assert!(refused(MultiPointOptions {
        deepest: Some(0),
        ..good
    }));
    assert!(PointTool::from_points(vec![DVec3::NAN], 0.0).is_err());
    assert!(PointTool::from_points(Vec::new(), 0.0).is_err());
    assert!(PointTool::sphere(0.01, Sampling::default()).is_err());
}
