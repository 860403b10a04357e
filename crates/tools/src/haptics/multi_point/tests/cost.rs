//! What a tick asks for, and that it takes no memory.

use glam::DVec3;

use super::super::super::{Pose, Renderer};
use super::super::{MultiPoint, MultiPointOptions, PointTool, Sampling};
use super::scenes::*;

pub fn scene(p: DVec3) -> (f64, DVec3) {
    let a = or(
        plane(p, DVec3::ZERO, DVec3::Z),
        block(p, DVec3::new(15.0, 0.0, 0.0), DVec3::splat(6.0)),
    );
    or(a, ball(p, DVec3::new(-5.0, 3.0, 0.0), 4.0))
}

pub fn hand(t: f64) -> Pose {
    let at = DVec3::new(
        12.0 * libm::sin(3.0 * t),
        8.0 * libm::cos(2.0 * t),
        6.0 + 4.0 * libm::cos(5.0 * t) + (30.0 - 200.0 * t).max(0.0),
    );
    turned(
        at,
        DVec3::new(0.5 * libm::sin(2.0 * t), 0.3 * t, 0.4 * libm::sin(3.0 * t)),
    )
}

#[test]
fn ticks_take_no_memory_and_few_looks() {
    let s = Sampling::default();
    let tools = [
        ("cube", PointTool::block(DVec3::splat(10.0), s)),
        ("sphere", PointTool::sphere(5.0, s)),
        ("plate", PointTool::plate(20.0, 30.0, 1.0, s)),
    ];
    for (name, tool) in tools {
        let tool = tool.expect("a tool");
        let points = tool.points().len();
        assert!((40..=80).contains(&points), "{points}");
        let mut renderer = MultiPoint::new(tool, MultiPointOptions::default()).expect("options");
        let solid = Solid::new(2.0, scene);
        let (mut sum, mut most, mut touching) = (0, 0, 0);
        let counted = allocation_counter::measure(|| {
            for k in 0..4000 {
                let felt = renderer.tick(&solid, &hand(f64::from(k) * DT), DT);
                let asked = solid.asked();
                sum += asked;
                most = most.max(asked);
                touching += usize::from(felt.force.length() > 0.05);
            }
            renderer.reset();
        });
        assert_eq!(counted.count_total, 0, "{name}: {counted:?}");
        println!(
            "{name}: {points} points, {} looks a tick, {most} at most, {touching} of 4000 touch",
            sum / 4000
        );
        assert!(touching > 1000, "{name}: {touching}");
        assert!(sum / 4000 < 300, "{name}: {}", sum / 4000);
        assert!(most < 1500, "{name}: {most}");
    }
}

#[test]
fn free_air_asks_for_each_point_once() {
    let tool = PointTool::sphere(5.0, Sampling::default()).expect("a sphere");
    let points = tool.points().len();
    let mut renderer = MultiPoint::new(tool, MultiPointOptions::default()).expect("options");
    let solid = Solid::new(2.0, scene);
    for k in 0..100 {
        let felt = renderer.tick(&solid, &Pose::at(DVec3::new(0.3 * f64::from(k), 0.0, 40.0)), DT);
        assert_eq!(felt.force, DVec3::ZERO);
        assert_eq!(solid.asked(), points);
    }
}

#[test]
fn same_poses_same_bits() {
    let run = || {
        let tool = PointTool::plate(12.0, 16.0, 1.0, Sampling::default()).expect("a plate");
        let mut renderer = MultiPoint::new(tool, MultiPointOptions::default()).expect("options");
        let trace = follow(&mut renderer, &Solid::new(2.0, scene), 2000, hand);
        trace.0.iter().fold(0u64, |hash, t| {
            let numbers = t
                .felt
                .force
                .to_array()
                .into_iter()
                .chain(t.felt.torque.to_array());
            numbers.fold(hash, |h, x| {
                h.rotate_left(5).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ x.to_bits()
            })
        })
    };
    assert_eq!(run(), run());
}
