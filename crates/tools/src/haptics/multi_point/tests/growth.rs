//! Solid that is where the tool is: at the start, and grown over it.

use glam::DVec3;

use super::super::super::{Contact, Pose, Renderer};
use super::super::{MultiPoint, MultiPointOptions, PointTool, Sampling};
use super::scenes::*;

fn cube() -> PointTool {
    PointTool::block(DVec3::splat(10.0), Sampling::default()).expect("a cube")
}

fn renderer(tool: PointTool) -> MultiPoint {
    MultiPoint::new(tool, MultiPointOptions::default()).expect("options")
}

#[test]
fn tool_that_starts_inside_feels_nothing_until_it_is_clear() {
    let solid = Solid::new(1e3, |p| plane(p, DVec3::ZERO, DVec3::Z));
    let mut renderer = renderer(cube());
    // Out at 20 mm/s, clear at z = 5, and back.
    let hand = |t: f64| {
        Pose::at(DVec3::new(
            0.0,
            0.0,
            if t < 0.5 {
                -2.0 + 20.0 * t
            } else {
                8.0 - 20.0 * (t - 0.5)
            },
        ))
    };
    let trace = follow(&mut renderer, &solid, 800, hand);
    for (k, t) in trace.0.iter().enumerate() {
        if t.hand.at.z < 4.99 && k < 400 {
            assert_eq!(t.felt.contact, Contact::Inside);
            assert_eq!((t.felt.force, t.felt.torque), (DVec3::ZERO, DVec3::ZERO));
        }
    }
    let last = trace.last();
    assert!((last.felt.force.z - 0.5 * (5.0 - last.hand.at.z)).abs() < 0.01);
    // The same after a reset.
    renderer.reset();
    let felt = renderer.tick(&solid, &last.hand, DT);
    assert_eq!((felt.contact, felt.force), (Contact::Inside, DVec3::ZERO));
}

#[test]
fn solid_that_grows_over_the_tool_pushes_it_out_at_a_bounded_rate() {
    let tool = cube();
    let mut renderer = renderer(tool.clone());
    let solid = |height: f64| Solid::new(1e3, move |p| plane(p, DVec3::new(0.0, 0.0, height), DVec3::Z));
    let hand = Pose::at(DVec3::new(0.0, 0.0, 4.5));
    follow(&mut renderer, &solid(0.0), 100, |t| {
        Pose::at(DVec3::new(0.0, 0.0, (6.0 - 40.0 * t).max(4.5)))
    });
    // A layer of 3 mm falls on it.
    let grown = solid(3.0);
    let mut before = renderer.tick(&solid(0.0), &hand, DT);
    let mut ticks = 0;
    for _ in 0..200 {
        let felt = renderer.tick(&grown, &hand, DT);
        let rise = felt.proxy.at - before.proxy.at;
        assert!(rise.length() <= 1.001 * 0.1, "{rise}");
        assert!((felt.force - before.force).length() <= 0.25 + 1e-12);
        ticks += usize::from(rise.z > 1e-6);
        before = felt;
    }
    // 3 mm at 0.1 m/s.
    assert!((29..=32).contains(&ticks), "{ticks}");
    assert!((before.proxy.at.z - 8.0).abs() < 0.002 && (before.force.z - 0.5 * 3.5).abs() < 0.01);
}

/// Walls close on a sphere from both sides, tighter than it is \[Sensable99 figs. 16A–B\], under a floor: no direction is better at
/// first. It may not oscillate, and leaves as soon as there is a way.
#[test]
fn tool_in_a_channel_that_is_too_narrow_stays_and_does_not_buzz() {
    let tool = PointTool::sphere(5.0, Sampling::default()).expect("a sphere");
    let mut renderer = renderer(tool);
    let channel = |half: f64| {
        Solid::new(1e3, move |p| {
            let x = DVec3::new(half, 0.0, 0.0);
            or(plane(p, x, -DVec3::X), plane(p, -x, DVec3::X))
        })
    };
    let hand = |t: f64| Pose::at(DVec3::new(0.0, 20.0 * t, 0.0));
    follow(&mut renderer, &channel(6.0), 100, hand);
    let trace = follow(&mut renderer, &channel(4.8), 1000, hand);
    assert!(
        trace
            .0
            .iter()
            .all(|t| t.felt.proxy.at.is_finite() && t.felt.proxy.at.x.abs() < 0.5)
    );
    assert!(trace.step() <= 0.25 + 1e-12);
    let turns = trace.0[200..].windows(3).filter(|w| {
        let x = |k: usize| w[k].felt.force.x;
        (x(1) - x(0)) * (x(2) - x(1)) < -1e-6
    });
    assert!(turns.count() < 20);
    let trace = follow(&mut renderer, &channel(6.0), 500, hand);
    assert!(
        trace.last().felt.force.length() < 1e-3,
        "{}",
        trace.last().felt.force
    );
}

/// The ladder gets a tool out of a lump of balls that appears about it, at the rate that is allowed, the same way every time.
#[test]
fn lump_that_appears_about_a_tool_lets_it_out() {
    let tool = cube();
    let mut ends = Vec::new();
    for seed in [3, 3, 4] {
        let options = MultiPointOptions {
            seed,
            ..MultiPointOptions::default()
        };
        let mut renderer = MultiPoint::new(tool.clone(), options).expect("options");
        let air = Solid::new(1e3, |p| plane(p, DVec3::new(0.0, 0.0, -100.0), DVec3::Z));
        let hand = Pose::at(DVec3::ZERO);
        follow(&mut renderer, &air, 10, |_| hand);
        let lump = Solid::new(4.0, |p| {
            let a = or(
                ball(p, DVec3::new(2.0, 1.0, -4.0), 7.0),
                ball(p, DVec3::new(-5.0, 2.0, -3.0), 6.0),
            );
            or(a, ball(p, DVec3::new(1.0, -6.0, -5.0), 6.0))
        });
        let mut before = hand;
        for _ in 0..1500 {
            let felt = renderer.tick(&lump, &hand, DT);
            // It may slide back towards the hand as fast as it likes, but away from it no faster than that.
            let way = felt.proxy.at.distance(hand.at) - before.at.distance(hand.at);
            assert!(way <= 1.001 * 0.1, "{way}");
            before = felt.proxy;
        }
        let depth = dense_depth(&tool, &lump, &before, 0.25);
        assert!(depth < 0.02, "{depth}");
        ends.push(before);
    }
    assert_eq!(ends[0], ends[1]);
}
