//! Friction and touch layers under tools of many points.

use glam::DVec3;

use super::super::super::{Contact, Obstacle, Pose, Touch};
use super::super::{MultiPoint, MultiPointOptions, PointTool, Sampling};
use super::contacts::all_tools;
use super::scenes::*;

/// A solid whose surface feels like what a place says.
pub struct Touched<O, T> {
    pub solid: O,
    pub touch: T,
}

impl<O: Obstacle, T: Fn(DVec3) -> Touch + Send + Sync> Obstacle for Touched<O, T> {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        self.solid.distance(p)
    }

    fn finest(&self) -> f64 {
        self.solid.finest()
    }

    fn touch(&self, p: DVec3) -> Touch {
        (self.touch)(p)
    }
}

/// The same everywhere.
fn rough(friction: f64) -> impl Fn(DVec3) -> Touch + Send + Sync {
    move |_| Touch {
        friction,
        ..Touch::default()
    }
}

fn floor<T: Fn(DVec3) -> Touch + Send + Sync>(touch: T) -> impl Obstacle {
    Touched {
        solid: Solid::new(1e3, |p| plane(p, DVec3::ZERO, DVec3::Z)),
        touch,
    }
}

fn renderer(tool: &PointTool) -> MultiPoint {
    MultiPoint::new(tool.clone(), MultiPointOptions::default()).expect("options")
}

fn lowest(tool: &PointTool) -> f64 {
    let points = tool.shape.as_ref().expect("a shape").points(0.02 * tool.spacing);
    tool.nose - points.iter().fold(f64::INFINITY, |a, p| a.min(p.z))
}

/// Angle between force and normal, over the angle of friction.
fn leaning(force: DVec3) -> f64 {
    force.truncate().length() / force.z
}

/// Dragged over a floor, the force leans by the angle of friction: every tool, and whichever way.
#[test]
fn the_angle_of_friction_is_that_of_the_surface() {
    let mut worst = 0.0f64;
    for (name, tool) in all_tools() {
        let touch = lowest(&tool);
        for friction in [0.1, 0.4, 1.0] {
            let hand = |t: f64| {
                let way = 40.0 * (t - 0.2).max(0.0);
                Pose::at(DVec3::new(way, 0.4 * way, touch + (1.0 - 20.0 * t).max(-2.0)))
            };
            let mut renderer = renderer(&tool);
            let trace = follow(&mut renderer, &floor(rough(friction)), 600, hand);
            let last = trace.last().felt;
            let off = (leaning(last.force) / friction - 1.0).abs();
            worst = worst.max(off);
            assert!(off < 0.02, "{name} {friction}: {}", last.force);
            assert_eq!(last.contact, Contact::Slides, "{name} {friction}");
            // Against the way.
            let against = -last
                .force
                .truncate()
                .normalize()
                .dot(DVec3::new(1.0, 0.4, 0.0).normalize().truncate());
            assert!(against > 0.999, "{name} {friction}: {}", last.force);
            assert!(
                trace
                    .depth(&tool, &Solid::new(1e3, |p| plane(p, DVec3::ZERO, DVec3::Z)))
                    .0
                    < 0.01
            );
        }
    }
    println!("angle of friction off by {:.4} %", 100.0 * worst);
}

/// Below the angle it holds the tool for as long as one waits, to the bit; above it does not. Without friction it never does.
#[test]
fn a_tool_holds_within_the_cone_and_creeps_not() {
    for (name, tool) in all_tools() {
        let touch = lowest(&tool);
        let pull = |share: f64| {
            move |t: f64| {
                let way = (10.0 * (t - 0.2).max(0.0)).min(share * 0.5 * 2.0);
                Pose::at(DVec3::new(way, 0.0, touch + (1.0 - 20.0 * t).max(-2.0)))
            }
        };
        let mut held = renderer(&tool);
        let trace = follow(&mut held, &floor(rough(0.5)), 3000, pull(0.9));
        let (then, last) = (trace.0[500].felt, trace.last().felt);
        assert_eq!(
            (last.contact, then.contact),
            (Contact::Sticks, Contact::Sticks),
            "{name}"
        );
        assert!(
            (last.proxy.at - then.proxy.at).length() < 1e-6,
            "{name}: it creeps"
        );
        // A tool that is held far from its handle gives way a little by turning.
        let share = leaning(last.force) / (0.9 * 0.5);
        assert!(share > 0.9 && share < 1.001, "{name}: {}", last.force);
        let trace = follow(&mut renderer(&tool), &floor(rough(0.5)), 500, pull(1.5));
        assert_eq!(trace.0[320].felt.contact, Contact::Slides, "{name}");
        let trace = follow(&mut renderer(&tool), &floor(rough(0.0)), 500, pull(0.9));
        assert!(leaning(trace.last().felt.force) < 1e-3, "{name}");
        assert_eq!(trace.last().felt.contact, Contact::Slides, "{name}");
    }
}

/// A plate on three knobs is held against turning about the normal up to the torque of its three frictions, and then follows. On one
/// knob nothing holds it.
#[test]
fn a_plate_is_held_against_turning_about_the_normal() {
    let tool = PointTool::block(DVec3::new(30.0, 30.0, 2.0), Sampling::default()).expect("a plate");
    let arm = 9.0;
    let knobs = |count: usize| {
        let at = move |k: usize| {
            let angle = std::f64::consts::TAU * k as f64 / 3.0;
            let far = if count == 1 { 0.0 } else { arm };
            DVec3::new(far * libm::cos(angle), far * libm::sin(angle), -2.0)
        };
        let near = move |p: DVec3| (0..count).map(|k| ball(p, at(k), 2.0)).reduce(or).expect("knobs");
        Touched {
            solid: Solid::new(2.0, near),
            touch: rough(0.5),
        }
    };
    let turn = |most: f64| {
        move |t: f64| {
            let height = 1.0 + (1.0 - 20.0 * t).max(-2.0);
            let angle = (t - 0.2).clamp(0.0, most);
            turned(DVec3::new(0.0, 0.0, height), DVec3::new(0.0, 0.0, angle))
        }
    };
    // Pressed with 1 N: 4.5 N mm.
    let most = 0.5 * arm;
    let felt = follow(&mut renderer(&tool), &knobs(3), 2000, turn(0.9 * most / 2000.0))
        .last()
        .felt;
    assert_eq!(felt.contact, Contact::Sticks);
    assert!(
        (felt.torque.z / (-0.9 * most) - 1.0).abs() < 0.02,
        "{}",
        felt.torque
    );
    let trace = follow(&mut renderer(&tool), &knobs(3), 500, turn(0.3));
    let felt = trace.last().felt;
    assert_eq!(felt.contact, Contact::Slides);
    assert!((felt.torque.z / -most - 1.0).abs() < 0.02, "{}", felt.torque);
    assert!(trace.torque_step() <= 25.0);
    let felt = follow(&mut renderer(&tool), &knobs(1), 500, turn(0.3))
        .last()
        .felt;
    assert!(
        felt.torque.z.abs() < 0.02 * most && felt.force.z > 0.9,
        "{} {}",
        felt.torque,
        felt.force
    );
}

/// Round a closed way with friction the hand never gets back more than it gave, and where it slides it loses friction times way.
#[test]
fn closed_drags_give_no_energy() {
    for (name, tool) in all_tools() {
        let touch = lowest(&tool);
        for friction in [0.2, 0.7] {
            let hand = |t: f64| {
                // Down, twice about, and up.
                let angle = 12.0 * (t - 0.2).clamp(0.0, 1.05);
                let at = DVec3::new(8.0 * libm::sin(angle), 8.0 * (1.0 - libm::cos(angle)), 0.0);
                let height = 1.0 - 20.0 * t.min(0.15) + 20.0 * (t - 1.3).clamp(0.0, 0.15);
                turned(
                    at + DVec3::new(0.0, 0.0, touch + height),
                    DVec3::new(0.0, 0.0, 0.2 * libm::sin(9.0 * t)),
                )
            };
            let trace = follow(&mut renderer(&tool), &floor(rough(friction)), 1600, hand);
            assert!(
                trace.least_work() > -1e-6,
                "{name} {friction}: {}",
                trace.least_work()
            );
            let work = trace.work();
            // 1 N over some 100 mm.
            let slid = 1e-3 * friction * 1.0 * 8.0 * 12.0 * 1.05;
            println!("{name} {friction}: {:.4} J of {slid:.4}", work);
            assert!(
                work > 0.8 * slid && work < 1.3 * slid,
                "{name} {friction}: {work} {slid}"
            );
            assert_eq!(trace.last().felt.contact, Contact::Free);
        }
    }
}

/// In a trough both walls rub: the angle is that of the wedge, μ/sin of half the angle between them.
#[test]
fn a_trough_rubs_with_both_walls() {
    let half = 30f64.to_radians();
    let (s, c) = (libm::sin(half), libm::cos(half));
    let (left, right) = (DVec3::new(c, 0.0, s), DVec3::new(-c, 0.0, s));
    let solid = Touched {
        solid: Solid::new(10.0, move |p| {
            or(plane(p, DVec3::ZERO, left), plane(p, DVec3::ZERO, right))
        }),
        touch: rough(0.3),
    };
    for (name, tool, touch) in [
        (
            "cube",
            PointTool::block(DVec3::splat(10.0), Sampling::default()),
            5.0 + 5.0 * c / s,
        ),
        ("sphere", PointTool::sphere(5.0, Sampling::default()), 5.0 / s),
    ] {
        let tool = tool.expect("a tool");
        let hand = |t: f64| {
            Pose::at(DVec3::new(
                0.0,
                40.0 * (t - 0.3).max(0.0),
                touch + (1.0 - 20.0 * t).max(-2.0),
            ))
        };
        let felt = follow(&mut renderer(&tool), &solid, 700, hand).last().felt;
        let ratio = -felt.force.y / felt.force.z;
        println!("{name} in a wedge: {ratio}");
        assert!((ratio / (0.3 / s) - 1.0).abs() < 0.02, "{name}: {}", felt.force);
    }
}

/// A floor soft on one side and rough on the other: a place gives its own, and torque shows where the force is.
#[test]
fn places_have_their_own_stiffness_and_friction() {
    let tool = PointTool::sphere(5.0, Sampling::default()).expect("a sphere");
    let solid = floor(|p: DVec3| Touch {
        stiffness: if p.x < 0.0 { 500.0 } else { f64::INFINITY },
        friction: if p.x < 0.0 { 0.2 } else { 0.6 },
    });
    for (x, stiffness, friction) in [(-20.0, 250.0, 0.2), (20.0, 500.0, 0.6)] {
        let hand = |t: f64| {
            Pose::at(DVec3::new(
                x,
                40.0 * (t - 0.3).max(0.0),
                5.0 + (1.0 - 20.0 * t).max(-2.0),
            ))
        };
        let felt = follow(&mut renderer(&tool), &solid, 700, hand).last().felt;
        assert!(
            (felt.force.z / (1e-3 * stiffness * 2.0) - 1.0).abs() < 0.01,
            "{x}: {}",
            felt.force
        );
        assert!(
            (leaning(felt.force) / friction - 1.0).abs() < 0.02,
            "{x}: {}",
            felt.force
        );
        let arm = DVec3::new(0.0, 0.0, -5.0);
        let expected = arm.cross(felt.force);
        assert!(
            (felt.torque - expected).length() < 0.02 * expected.length(),
            "{x}: {} {expected}",
            felt.torque
        );
    }
    // Half on either side, a plate leans on what is hard.
    let plate = PointTool::block(DVec3::new(20.0, 20.0, 2.0), Sampling::default()).expect("a plate");
    let soft = floor(|p: DVec3| Touch {
        stiffness: if p.x < 0.0 { 500.0 } else { f64::INFINITY },
        friction: 0.0,
    });
    let hand = |t: f64| Pose::at(DVec3::new(0.0, 0.0, 1.0 + (1.0 - 20.0 * t).max(-2.0)));
    let felt = follow(&mut renderer(&plate), &soft, 700, hand).last().felt;
    assert!((felt.force.z - 0.75).abs() < 0.05, "{}", felt.force);
    assert!((felt.torque.y - -2.5).abs() < 0.5, "{}", felt.torque);
}
