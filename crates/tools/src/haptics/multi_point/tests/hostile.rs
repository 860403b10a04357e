//! Thin sheets and random solids: nothing goes through, in or for nothing.

use glam::DVec3;

use super::super::super::{Obstacle, Pose};
use super::super::random::Random;
use super::super::{MultiPoint, MultiPointOptions, PointTool, Sampling};
use super::scenes::*;

pub fn tools() -> Vec<(&'static str, PointTool)> {
    let s = Sampling::default();
    vec![
        ("sphere", PointTool::sphere(4.0, s).expect("a sphere")),
        ("cylinder", PointTool::cylinder(3.0, 8.0, s).expect("a cylinder")),
        ("cube", PointTool::block(DVec3::splat(6.0), s).expect("a cube")),
        ("plate", PointTool::plate(8.0, 10.0, 1.0, s).expect("a plate")),
        ("knife", PointTool::knife(8.0, 12.0, 1.0, s).expect("a knife")),
    ]
}

fn vector(random: &mut Random) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|_| 2.0 * random.share() - 1.0))
}

/// S2 for tools: a sheet of 1 mm hit at 0.5 m/s, with the hand 12 mm behind it, in any turn.
#[test]
fn no_point_goes_through_a_sheet() {
    for (name, tool) in tools() {
        for seed in 0..5 {
            let mut random = Random::new(seed);
            let turn = 2.0 * vector(&mut random);
            let aside = vector(&mut random);
            let solid = Solid::new(1.0, |p: DVec3| {
                (p.z.abs() - 0.5, DVec3::new(0.0, 0.0, p.z.signum()))
            });
            let mut renderer = MultiPoint::new(tool.clone(), MultiPointOptions::default()).expect("options");
            let hand = |t: f64| {
                let z = (15.0 - 500.0 * t).max(-12.0);
                turned(
                    DVec3::new(aside.x, aside.y, 0.0) * 100.0 * t + DVec3::new(0.0, 0.0, z),
                    turn + 3.0 * t * aside,
                )
            };
            let trace = follow(&mut renderer, &solid, 300, hand);
            let (depth, when) = trace.depth(&tool, &solid);
            assert!(depth < 0.01, "{name} {seed}: {depth} at {when}");
            for t in &trace.0 {
                let lowest = tool
                    .points()
                    .iter()
                    .map(|q| place(&tool, &t.felt.proxy, *q).z)
                    .fold(f64::INFINITY, f64::min);
                assert!(lowest > 0.0, "{name} {seed}: {lowest}");
            }
            assert!(trace.step() <= 0.25 + 1e-12);
        }
    }
}

/// A random solid with features of 2 mm and more, some hollow, some not.
pub fn solid(seed: u64) -> Solid<impl Fn(DVec3) -> (f64, DVec3) + Send + Sync> {
    let mut random = Random::new(seed);
    let balls: Vec<_> = (0..12)
        .map(|_| {
            (
                12.0 * vector(&mut random) * DVec3::new(1.0, 1.0, 0.3),
                2.0 + 3.0 * random.share(),
            )
        })
        .collect();
    let blocks: Vec<_> = (0..3)
        .map(|_| {
            (
                12.0 * vector(&mut random) * DVec3::new(1.0, 1.0, 0.3),
                DVec3::splat(1.5) + 2.0 * vector(&mut random).abs(),
                vector(&mut random),
            )
        })
        .collect();
    // Two walls of a groove.
    let steep = 0.4 + random.share();
    let (s, c) = (libm::sin(steep), libm::cos(steep));
    Solid::new(2.0, move |p| {
        let mut near = or(
            plane(p, DVec3::new(0.0, 0.0, -4.0), DVec3::new(c, 0.0, s)),
            plane(p, DVec3::new(0.0, 0.0, -4.0), DVec3::new(-c, 0.0, s)),
        );
        for (at, radius) in &balls {
            near = or(near, ball(p, *at, *radius));
        }
        for (at, half, turn) in &blocks {
            let turn = super::super::turn::exponential(*turn);
            let (d, g) = block(turn.inverse() * (p - *at), DVec3::ZERO, *half);
            near = or(near, (d, turn * g));
        }
        near
    })
}

/// A tool, and a hand that goes about in a random solid.
pub fn run(seed: u64, tool: &PointTool) -> (MultiPoint, impl Fn(f64) -> Pose) {
    let mut random = Random::new(1000 + seed);
    let (a, b, c) = (vector(&mut random), vector(&mut random), vector(&mut random));
    let renderer = MultiPoint::new(tool.clone(), MultiPointOptions::default()).expect("options");
    // From above, then about in the solid, up to some 0.15 m/s and 3 rad/s.
    let hand = move |t: f64| {
        let wave = move |w: f64, v: DVec3| {
            DVec3::new(
                libm::sin(w * t + v.x),
                libm::sin(1.3 * w * t + v.y),
                libm::sin(0.7 * w * t + v.z),
            )
        };
        let at = 10.0 * wave(8.0, 3.0 * a) * DVec3::new(1.0, 1.0, 0.4)
            + DVec3::new(0.0, 0.0, (30.0 - 60.0 * t).max(2.0));
        turned(at, 0.8 * wave(3.0, 3.0 * b) + c)
    };
    (renderer, hand)
}

#[test]
fn random_solids_keep_the_tool_out_and_give_no_energy() {
    let tools = tools();
    let (mut deepest, mut least, mut touching) = (0.0f64, 0.0f64, 0);
    let mut hidden = 0.0f64;
    for seed in 0..25 {
        let solid = solid(seed);
        let (name, tool) = &tools[seed as usize % tools.len()];
        let (mut renderer, hand) = run(seed, tool);
        let trace = follow(&mut renderer, &solid, 2500, hand);
        let (depth, when) = trace.depth(tool, &solid);
        let work = trace.least_work();
        let between = trace.0[400..]
            .iter()
            .step_by(20)
            .map(|t| dense_depth(tool, &solid, &t.felt.proxy, 0.25))
            .fold(0.0, f64::max);
        let step = trace.step();
        println!(
            "{seed} {name}: depth {depth:.4} at {when}, {between:.4} between points, least work {work:.2e} J, step {step:.3} N, {:.1} N mm",
            trace.torque_step()
        );
        (deepest, least) = (deepest.max(depth), least.min(work));
        hidden = hidden.max(between);
        assert!(step <= 0.25 + 1e-12 && trace.torque_step() <= 25.0 + 1e-9);
        touching += trace.0.iter().filter(|t| t.felt.force.length() > 0.05).count();
        assert!(
            trace
                .0
                .iter()
                .all(|t| t.felt.force.is_finite() && t.felt.torque.is_finite())
        );
    }
    assert!(touching > 20_000, "{touching}");
    assert!(deepest < 0.01, "{deepest}");
    // For single ticks, where looks do not suffice: fast and flush.
    assert!(hidden < 0.2, "{hidden}");
    assert!(least > -1e-4, "{least}");
}

/// In hollows of planes the free space is convex: the force never changes faster than the hand, for every tool that does not turn.
#[test]
fn force_changes_no_faster_than_the_hand_in_hollows() {
    for (k, (name, tool)) in tools().into_iter().enumerate() {
        for seed in 0..4 {
            let mut random = Random::new(50 * k as u64 + seed);
            let planes: Vec<_> = (0..4)
                .map(|_| {
                    (vector(&mut random) * DVec3::new(1.0, 1.0, 0.0) + DVec3::new(0.0, 0.0, 1.0)).normalize()
                })
                .collect();
            let solid = Solid::new(1e3, |p: DVec3| {
                planes
                    .iter()
                    .map(|n| plane(p, -5.0 * *n, *n))
                    .reduce(or)
                    .expect("planes")
            });
            let mut renderer = MultiPoint::new(tool.clone(), MultiPointOptions::default()).expect("options");
            let phase = 3.0 * vector(&mut random);
            let hand = |t: f64| {
                let wave = DVec3::new(
                    libm::sin(9.0 * t + phase.x),
                    libm::sin(7.0 * t + phase.y),
                    libm::sin(5.0 * t + phase.z),
                );
                Pose::at(
                    10.0 * wave * DVec3::new(1.0, 1.0, 0.5)
                        + DVec3::new(0.0, 0.0, (40.0 - 80.0 * t).max(0.0)),
                )
            };
            let trace = follow(&mut renderer, &solid, 2000, hand);
            let mut touching = 0;
            for w in trace.0.windows(2) {
                let way = (w[1].hand.at - w[0].hand.at).length();
                let change = (w[1].felt.force - w[0].felt.force).length();
                assert!(
                    change <= 1.05 * 0.5 * way + 1e-4,
                    "{name} {seed}: {change} N for {way} mm"
                );
                touching += usize::from(w[0].felt.force.length() > 0.05);
            }
            assert!(touching > 500, "{name} {seed}: {touching}");
            assert!(trace.depth(&tool, &solid as &dyn Obstacle).0 < 0.01);
        }
    }
}

/// No tool hangs on the solid when the hand has left it, even where there were too few looks between its points: edges of the block,
/// and a gap between it and the ball as wide as the tool.
#[test]
fn tools_follow_a_hand_that_has_left() {
    let s = Sampling::default();
    let tools = [PointTool::sphere(4.5, s), PointTool::cylinder(4.0, 12.0, s)];
    let solid = Solid::new(2.0, super::cost::scene);
    for tool in tools.map(|tool| tool.expect("a tool")) {
        for variant in 0..8 {
            let options = MultiPointOptions {
                fine_checks: 100,
                ..MultiPointOptions::default()
            };
            let mut renderer = MultiPoint::new(tool.clone(), options).expect("options");
            let aside = 0.03 * f64::from(variant) * DVec3::new(1.0, -1.0, 0.3);
            let hand = |t: f64| {
                let hand = super::cost::hand(t);
                Pose {
                    at: hand.at + aside,
                    ..hand
                }
            };
            let trace = follow(&mut renderer, &solid, 4000, hand);
            let mut free_for = 0;
            for (k, t) in trace.0.iter().enumerate() {
                let clear = |q: &DVec3| solid.distance(place(&tool, &t.hand, *q)).0 > tool.nose() + 0.5;
                free_for = if tool.points().iter().all(clear) {
                    free_for + 1
                } else {
                    0
                };
                let way = t.hand.at.distance(t.felt.proxy.at);
                assert!(free_for < 200 || way < 1.0, "{variant} {k}: {way}");
            }
        }
    }
}
