//! Tools on what the program uses: snapshots that are made from fields, round the hand, thirty times a second.

use std::f64::consts::FRAC_PI_4;
use std::sync::Arc;

use bspline::Field;
use bspline::csg::Csg;
use bspline::hierarchical::{HierarchicalSpline, Lattice};
use bspline::primitives::{Capsule, Cuboid, HalfSpace, Sphere};
use glam::{DAffine3, DQuat, DVec3};

use super::super::super::{
    Contact, Demand, Obstacle, Pose, Renderer, Snapshot, SnapshotMaker, Touch, TouchedObject,
};
use super::super::{MultiPoint, MultiPointOptions, PointTool, Sampling};
use super::contacts::{all_tools, cube};
use super::scenes::*;
use crate::paint::Layers;

/// Ticks from snapshot to snapshot.
const STEP: usize = 33;

/// What is touched round a place.
pub fn snapshot(maker: &mut SnapshotMaker, field: &Arc<dyn Field>, at: DVec3, touch: Touch) -> Arc<Snapshot> {
    let object = TouchedObject {
        id: 1,
        field: field.clone(),
        iso: 0.0,
        world_from_object: DAffine3::IDENTITY,
        layers: &Layers::default(),
        default: touch,
    };
    maker.make(at, &[object], 0)
}

/// Follows a script on a field, with snapshots as the program makes them.
pub fn follow_field(
    renderer: &mut MultiPoint,
    field: &Arc<dyn Field>,
    touch: Touch,
    ticks: usize,
    hand: impl Fn(f64) -> Pose,
) -> Trace {
    let mut maker = SnapshotMaker::new(Demand::of_points(renderer.tool()));
    let mut shown = snapshot(&mut maker, field, hand(0.0).at, touch);
    let mut all = Vec::new();
    for k in 0..ticks {
        let hand = hand(k as f64 * DT);
        if k % STEP == 0 {
            shown = snapshot(&mut maker, field, hand.at, touch);
        }
        let felt = renderer.tick(&*shown, &hand, DT);
        all.push(Tick { hand, felt });
    }
    Trace(all)
}

pub fn half_space(normal: DVec3) -> Arc<dyn Field> {
    Arc::new(HalfSpace::new(DVec3::ZERO, normal).expect("a normal"))
}

fn union(solids: Vec<Arc<dyn Field>>) -> Arc<dyn Field> {
    Arc::new(Csg::union(solids).expect("solids"))
}

fn renderer(tool: &PointTool) -> MultiPoint {
    MultiPoint::new(tool.clone(), MultiPointOptions::default()).expect("options")
}

/// The box of every tool holds it, wherever its handle is, until the box follows.
#[test]
fn boxes_hold_the_whole_tool() {
    let field = half_space(DVec3::Z);
    for (name, tool) in all_tools() {
        for handle in [DVec3::ZERO, DVec3::new(0.0, 5.0, -20.0)] {
            let tool = tool.clone().with_handle(handle);
            let demand = Demand::of_points(&tool);
            let mut maker = SnapshotMaker::new(demand);
            let here = snapshot(&mut maker, &field, DVec3::ZERO, Touch::default());
            let brick = &here.parts()[0].shape;
            // As far as a hand gets before the box follows, and in any turn.
            let far = DVec3::splat(0.25 * demand.reach);
            assert!(brick.covers(far, tool.extent() + 9.0 - 1e-9), "{name}");
            let all = tool.points.iter().chain(&tool.fine);
            assert!(
                all.clone()
                    .all(|p| p.distance(handle) + tool.nose() <= tool.extent() + 1e-12)
            );
            assert!(brick.band() > tool.gap() + tool.nose());
            assert!(brick.bytes() < 5_000_000, "{name}: {}", brick.bytes());
        }
    }
}

/// Cases 1 and 2.
#[test]
fn force_on_a_plane_is_stiffness_times_depth() {
    let normal = DVec3::new(0.2, -0.1, 1.0).normalize();
    let field = half_space(normal);
    for (name, tool) in all_tools() {
        let shape = tool.shape.as_ref().expect("a shape");
        let lowest = shape.points(0.02 * tool.spacing.max(1.0));
        let touch = tool.nose - lowest.iter().fold(f64::INFINITY, |a, p| a.min(p.dot(normal)));
        // Without a hold on the turn the deepest place alone would press; this stiff it is as good as held.
        let options = MultiPointOptions {
            angular_stiffness: 1e7,
            torque_slew: 1e5,
            ..MultiPointOptions::default()
        };
        let mut renderer = MultiPoint::new(tool.clone(), options).expect("options");
        let hand = |t: f64| Pose::at((touch + 2.0 - 40.0 * t).max(touch - 4.0) * normal);
        let trace = follow_field(&mut renderer, &field, Touch::default(), 250, hand);
        let solid = Solid::new(1e3, move |p| plane(p, DVec3::ZERO, normal));
        let (depth, when) = trace.depth(&tool, &solid);
        assert!(depth < 0.01, "{name}: {depth} mm at {when}");
        let (felt, expected) = (trace.last().felt, 2.0 * normal);
        let off = (felt.force - expected).length() / 2.0;
        println!("{name}: force off by {:.4} %", 100.0 * off);
        assert!(off < 0.02, "{name}: {}", felt.force);
        assert_eq!(
            (felt.contact, trace.0[20].felt.contact),
            (Contact::Slides, Contact::Free)
        );
        assert!(trace.step() <= 1.05 * 0.5 * 0.041, "{name}: {}", trace.step());
        assert!(trace.least_work() > -1e-4, "{name}: {}", trace.least_work());
    }
}

/// Case 4.
#[test]
fn cube_rests_in_a_hollow_corner() {
    let field = union(vec![
        half_space(DVec3::X),
        half_space(DVec3::Y),
        half_space(DVec3::Z),
    ]);
    let tool = cube();
    let goal = DVec3::new(2.0, 3.5, 1.0);
    let hand = |t: f64| Pose::at(DVec3::splat(9.0).lerp(goal, (5.0 * t).min(1.0)));
    let trace = follow_field(&mut renderer(&tool), &field, Touch::default(), 400, hand);
    let expected = 0.5 * (DVec3::splat(5.0) - goal);
    let force = trace.last().felt.force;
    let off = (force - expected).length() / expected.length();
    let solid = Solid::new(1e3, |p: DVec3| (p.min_element(), DVec3::Z));
    println!(
        "corner: force off by {:.2} %, depth {:?}",
        100.0 * off,
        trace.depth(&tool, &solid)
    );
    assert!(off < 0.02, "{force} {expected}");
    // The corner of the hollow is rounded by the nodes.
    assert!(
        trace.depth(&tool, &solid).0 < 0.1 * 0.5,
        "{:?}",
        trace.depth(&tool, &solid)
    );
    assert!(trace.step() <= 0.25 + 1e-12 && trace.least_work() > -1e-4);
}

/// Case 3, convex: over an edge of 90° and down beside it, without sticking.
#[test]
fn cube_crosses_a_right_edge_without_sticking() {
    let middle = DVec3::new(-20.0, 0.0, -20.0);
    let field: Arc<dyn Field> = Arc::new(Cuboid::new(middle, DVec3::splat(20.0)).expect("a block"));
    let solid = Solid::new(10.0, move |p| block(p, middle, DVec3::splat(20.0)));
    let tool = cube();
    // 2 mm into the top, over the edge at x = 0, and down beside it, 1 mm into the side.
    let hand = |t: f64| {
        let x = (-8.0 + 60.0 * t).min(8.0);
        let down = (60.0 * (t - 0.35).max(0.0)).min(12.0);
        let back = (40.0 * (t - 0.6).max(0.0)).min(4.0);
        let high = 3.0 + 4.0 * (1.0 - 20.0 * t).max(0.0);
        Pose::at(DVec3::new(x - back, 0.0, high - down))
    };
    let trace = follow_field(&mut renderer(&tool), &field, Touch::default(), 900, hand);
    let lags = trace.0.iter().map(|t| (t.hand.at.x - t.felt.proxy.at.x).abs());
    let lag = lags.fold(0.0, f64::max);
    println!(
        "edge: lag {lag:.3} mm, depth {:?}, step {:.3} N",
        trace.depth(&tool, &solid),
        trace.step()
    );
    assert!(lag < 2.0, "{lag}");
    assert!(trace.0[345].felt.force.length() < 1e-6);
    let side = trace.last().felt;
    assert!(
        (side.force - DVec3::new(0.5, 0.0, 0.0)).length() < 0.01,
        "{}",
        side.force
    );
    // An edge of the solid is rounded by a fifth of the distance of nodes.
    assert!(
        trace.depth(&tool, &solid).0 < 0.1,
        "{:?}",
        trace.depth(&tool, &solid)
    );
    assert!(trace.step() <= 0.25 + 1e-12 && trace.least_work() > -1e-4);
}

/// Case 3, concave: along a trough, pressed into it and pushed aside.
#[test]
fn cube_slides_along_a_trough_without_leaving_it() {
    for angle in [90.0f64, 60.0] {
        let half = 0.5 * angle.to_radians();
        let (s, c) = (libm::sin(half), libm::cos(half));
        let (left, right) = (DVec3::new(c, 0.0, s), DVec3::new(-c, 0.0, s));
        let field = union(vec![half_space(left), half_space(right)]);
        let solid = Solid::new(10.0, move |p| {
            or(plane(p, DVec3::ZERO, left), plane(p, DVec3::ZERO, right))
        });
        let tool = cube();
        let touch = 5.0 + 5.0 * c / s;
        let hand = |t: f64| {
            let aside = 0.3 * libm::sin(40.0 * t);
            Pose::at(DVec3::new(aside, 30.0 * t, touch + (3.0 - 40.0 * t).max(-3.0)))
        };
        let trace = follow_field(&mut renderer(&tool), &field, Touch::default(), 700, hand);
        let (depth, when) = trace.depth(&tool, &solid);
        let mut worst = [0.0f64; 3];
        for t in &trace.0[300..] {
            assert_eq!(t.felt.contact, Contact::Slides);
            let off = [
                (t.hand.at.y - t.felt.proxy.at.y).abs(),
                t.felt.proxy.at.x.abs(),
                (t.felt.force.z - 1.5).abs(),
            ];
            worst = std::array::from_fn(|k| worst[k].max(off[k]));
        }
        println!(
            "trough {angle}: lag, aside, force off {worst:.4?}, depth {depth:.4} at {when}, step {:.4}",
            trace.step()
        );
        assert!(
            depth < 0.01 && worst[0] < 0.02 && worst[1] < 0.1 && worst[2] < 0.03,
            "{angle}: {depth} {worst:?}"
        );
        assert!(trace.step() <= 0.03, "{angle}: {}", trace.step());
        assert!(trace.least_work() > -1e-4);
    }
}

/// A rod on a floor meets a face between the tool's points.
#[test]
fn feature_between_the_points_is_found() {
    let (tool, s) = (cube(), Sampling::default());
    let blind = PointTool::block(DVec3::splat(10.0), Sampling { refinement: 1, ..s }).expect("a cube");
    let mut missed = 0;
    let mut worst = 0.0f64;
    for k in 0..6 {
        let f = |n: f64| 8.0 * ((f64::from(k) * n + 0.1).fract() - 0.5);
        let foot = DVec3::new(f(0.754_877_67), f(0.569_840_29), 0.0);
        let top = foot + DVec3::new(0.0, 0.0, 2.3);
        let rod: Arc<dyn Field> = Arc::new(Capsule::new(foot - 2.0 * DVec3::Z, top, 0.7).expect("a rod"));
        let field = union(vec![half_space(DVec3::Z), rod]);
        let solid = Solid::new(0.7, move |p| {
            or(
                plane(p, DVec3::ZERO, DVec3::Z),
                super::scenes::rod(p, foot, top, 0.7),
            )
        });
        let hand = |t: f64| Pose::at(DVec3::new(0.0, 0.0, (9.0 - 40.0 * t).max(7.0)));
        let trace = follow_field(&mut renderer(&tool), &field, Touch::default(), 250, hand);
        let depths = trace
            .0
            .iter()
            .map(|t| dense_depth(&tool, &solid, &t.felt.proxy, 0.25));
        worst = worst.max(depths.fold(0.0, f64::max));
        assert!(trace.last().felt.force.z > 0.1);
        let trace = follow_field(&mut renderer(&blind), &field, Touch::default(), 250, hand);
        missed += usize::from(dense_depth(&blind, &solid, &trace.last().felt.proxy, 0.25) > 0.15);
    }
    println!("between the points: {worst:.4} mm deep, {missed} of 6 missed without finer ones");
    assert!(worst < 0.05, "{worst}");
    assert!(missed >= 3, "{missed}");
}

/// A plate pressed on a knob away from its middle: the torque is r × F.
#[test]
fn torque_of_a_plate_pressed_off_centre_is_arm_times_force() {
    let tool = PointTool::plate(20.0, 24.0, 2.0, Sampling::default()).expect("a plate");
    let lying = DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2);
    let mut worst = 0.0f64;
    for knob in [DVec3::new(7.0, 0.0, 0.0), DVec3::new(-4.3, 6.1, 0.0)] {
        // A spline of a ball, whose numbers are no distances.
        let lattice = Lattice {
            world_from_lattice: DAffine3::from_translation(knob - DVec3::splat(6.0)),
            cells: [12; 3],
        };
        let formula = |p: DVec3| 4.0 - (p - knob).length_squared();
        let spline = HierarchicalSpline::<f32>::schoenberg(lattice, 1.0, formula).expect("a spline");
        // A spline of coefficients from values is the formula less its second derivatives over 6.
        let radius = (4.0f64 - 1.0).sqrt();
        let field: Arc<dyn Field> = Arc::new(spline);
        for handle in [DVec3::ZERO, DVec3::new(1.0, -6.0, 4.0)] {
            let tool = tool.clone().with_handle(handle);
            let mut renderer = renderer(&tool);
            let place = lying * handle;
            let hand = |t: f64| Pose {
                at: place + DVec3::new(0.0, 0.0, (5.0 - 20.0 * t).max(0.0)),
                turn: lying,
            };
            let trace = follow_field(&mut renderer, &field, Touch::default(), 900, hand);
            let felt = trace.last().felt;
            let n = felt.proxy.turn * DVec3::X;
            let n = n * n.z.signum();
            let contact = knob + radius * n;
            let expected = (contact - felt.proxy.at).cross(felt.force);
            assert!(felt.force.length() > 0.3, "{}", felt.force);
            let off = (felt.torque - expected).length() / expected.length();
            worst = worst.max(off);
            assert!(off < 0.02, "{knob} {handle}: {} {expected}", felt.torque);
        }
    }
    println!("torque off by {:.3} %", 100.0 * worst);
}

/// Something between ball and block of a smooth solid: a plate goes about on it and turns, in steps of the snapshots.
#[test]
fn a_turning_plate_on_a_smooth_solid_keeps_out_and_gives_no_energy() {
    let ball: Arc<dyn Field> = Arc::new(Sphere::new(DVec3::new(0.0, 0.0, -18.0), 18.0).expect("a ball"));
    let tool = PointTool::plate(12.0, 16.0, 2.0, Sampling::default()).expect("a plate");
    let hand = |t: f64| {
        let at = DVec3::new(
            8.0 * libm::sin(3.0 * t),
            6.0 * libm::sin(2.0 * t),
            (6.0 - 20.0 * t).max(-1.0),
        );
        turned(
            at,
            DVec3::new(
                0.3 * libm::sin(4.0 * t),
                FRAC_PI_4 * 2.0,
                0.3 * libm::sin(5.0 * t),
            ),
        )
    };
    let mut renderer = renderer(&tool);
    let trace = follow_field(&mut renderer, &ball, Touch::default(), 1500, hand);
    let solid = Solid::new(10.0, |p| {
        super::scenes::ball(p, DVec3::new(0.0, 0.0, -18.0), 18.0)
    });
    let (depth, when) = trace.depth(&tool, &solid);
    let between = trace.0.iter().step_by(10);
    let between = between
        .map(|t| dense_depth(&tool, &solid, &t.felt.proxy, 0.5))
        .fold(0.0, f64::max);
    println!(
        "plate on a ball: {depth:.4} at {when}, between {between:.4}, step {:.3} N",
        trace.step()
    );
    assert!(depth < 0.01 && between < 0.05, "{depth} {between}");
    assert!(trace.least_work() > -1e-4 && trace.step() <= 0.25 + 1e-12);
    assert!(trace.0.iter().filter(|t| t.felt.force.length() > 0.1).count() > 1000);
}

/// What a snapshot costs in looks and memory.
#[test]
fn ticks_on_snapshots_take_no_memory() {
    let tool = PointTool::sphere(5.0, Sampling::default()).expect("a sphere");
    let field = half_space(DVec3::Z);
    let mut maker = SnapshotMaker::new(Demand::of_points(&tool));
    let touch = Touch {
        stiffness: 800.0,
        friction: 0.4,
    };
    let shown = snapshot(&mut maker, &field, DVec3::ZERO, touch);
    let obstacle: &dyn Obstacle = &*shown;
    let mut renderer = renderer(&tool);
    let counted = allocation_counter::measure(|| {
        for k in 0..1000 {
            let t = f64::from(k) * DT;
            let hand = Pose::at(DVec3::new(
                4.0 * libm::sin(20.0 * t),
                0.0,
                4.0 + 3.0 * libm::cos(9.0 * t),
            ));
            renderer.tick(obstacle, &hand, DT);
        }
    });
    assert_eq!(counted.count_total, 0, "{counted:?}");
}
