//! S6: 3 mm of matter come over a resting tool.

use std::sync::Arc;

use glam::DVec3;
use tools::haptics::simulated::{Change, Path, SimulatedHand, World};
use tools::haptics::{Obstacle, Pose, Renderer};

use super::common::{Check, HalfSpace, Loop, penalty, proxy, vcp};

const LAYER: f64 = 3.0;

fn buried(change: Change, renderer: impl Renderer + 'static) -> Check {
    let of = |z| DVec3::new(0.0, 0.0, z);
    let path = Path::smooth([(0.0, of(4.0)), (0.5, of(0.5))]);
    let setup = Loop::new(SimulatedHand::light(path), 3.0);
    let floor = |time: f64, _: &Pose| -> Arc<dyn Obstacle> {
        Arc::new(HalfSpace::floor(if time < 0.99 { 0.0 } else { LAYER }))
    };
    let world = World::changing(30.0, change, &Pose::at(of(4.0)), floor);
    setup.touch_world(world, renderer)
}

#[test]
fn matter_over_a_resting_tool_pushes_it_out() {
    for change in [Change::Steps, Change::Blended] {
        let check = buried(change, proxy(2.0, 500.0));
        let rises = check.trace.ticks.windows(2).map(|w| {
            // The proxy's own rise; it also follows the hand, which the surface keeps at rest here.
            (w[1].proxy.at.z - w[0].proxy.at.z) / (1e3 * w[0].dt)
        });
        let fastest = rises.fold(0.0, f64::max);
        let before = check.trace.between(0.9, 0.98);
        let depth = |t: &tools::haptics::simulated::Tick| 1e-3 * (t.proxy.at.z - t.read.at.z);
        let d0 = before.iter().map(depth).sum::<f64>() / before.len() as f64;
        let d1 = d0 + 1e-3 * LAYER;
        let work = 0.5 * 500.0 * (d1 * d1 - d0 * d0);
        let end = check.trace.ticks.last().expect("ticks");
        check.assert(
            &format!("matter, {change:?}"),
            &[
                ("P1", check.rests()),
                (
                    "P2 with the work of the edit",
                    check.measures.returned <= work + 1e-4,
                ),
                ("P3", check.is_slewed()),
                ("pushed out at 0.1 m/s at most", fastest <= 0.1 * 1.01),
                ("on the new surface", (end.proxy.at.z - LAYER - 2.0).abs() < 0.01),
                ("the hand is pushed as well", end.force.z > 0.7),
            ],
        );
    }
}

#[test]
fn methods_without_memory_jump_by_the_whole_layer() {
    for (name, check) in [
        ("penalty", buried(Change::Steps, penalty(2.0, 500.0))),
        ("vcp", buried(Change::Steps, vcp(2.0, 500.0))),
    ] {
        let layer = 1e-3 * 500.0 * LAYER;
        assert!(check.measures.jump > 0.9 * layer, "{name}: {:#?}", check.measures);
    }
}
