//! S5: the surface is carved away under a sliding tool, 0.1 mm at each step of the simulation.

use std::sync::Arc;

use glam::DVec3;
use tools::haptics::simulated::{Change, Mechanics, Path, SimulatedHand, World};
use tools::haptics::{Pose, Renderer};

use super::common::{Check, HalfSpace, Loop, omni, proxy, vcp};

const DROP: f64 = 0.1;

/// 60 mm in 1.2 s over a floor that sinks at a rate, Hz.
fn carved(rate: f64, change: Change, renderer: impl Renderer + 'static) -> Check {
    let of = |x, z| DVec3::new(x, 0.0, z);
    let path = Path::smooth([
        (0.0, of(0.0, 2.0)),
        (0.3, of(0.0, -1.0)),
        (1.5, of(60.0, -1.0 - 0.09 * rate)),
    ]);
    let setup = Loop {
        // Counts would hide steps of 0.05 N.
        device: Mechanics {
            quantum: 0.0,
            ..omni()
        },
        ..Loop::new(SimulatedHand::light(path), 1.5)
    };
    let floor = move |time: f64, _: &Pose| -> Arc<dyn tools::haptics::Obstacle> {
        let steps = (time * rate).round();
        Arc::new(HalfSpace::floor(-DROP * (steps - 0.3 * rate).max(0.0).round()))
    };
    let start = Pose::at(of(0.0, 2.0));
    let world = World::changing(rate, change, &start, floor);
    setup.touch_world(world, renderer)
}

/// Largest justified change, N: that of the motion and that of the surface, which sinks over the period of the simulation.
fn justified(check: &Check, rate: f64) -> f64 {
    check.measures.justified_jump + 1.05e-3 * check.limits.stiffness * DROP * check.limits.period * rate
}

#[test]
fn carving_is_felt_as_a_motion_of_the_surface() {
    for rate in [5.0, 15.0, 30.0] {
        for (name, check) in [
            ("proxy", carved(rate, Change::Blended, proxy(2.0, 500.0))),
            ("vcp", carved(rate, Change::Blended, vcp(2.0, 500.0))),
        ] {
            check.assert(
                &format!("{name}, carving at {rate} Hz"),
                &[
                    (
                        "it presses all the time",
                        check.trace.between(0.4, 1.5).iter().all(|t| t.force.z > 0.1),
                    ),
                    ("P3", check.measures.jump <= justified(&check, rate)),
                    ("P4", check.stays_out()),
                ],
            );
            // What the motion alone would change, tick by tick, is exceeded by no more than the surface's.
            let surface = 1e-3 * 500.0 * DROP * 1e-3 * rate;
            assert!(
                check.measures.expansion < 1.05 * surface + 1e-3,
                "{:#?}",
                check.measures
            );
        }
    }
}

#[test]
fn carving_at_once_is_felt_as_steps() {
    for rate in [5.0, 15.0, 30.0] {
        let check = carved(rate, Change::Steps, proxy(2.0, 500.0));
        let surface = 1e-3 * 500.0 * DROP;
        assert!(check.measures.expansion > 0.5 * surface, "{:#?}", check.measures);
    }
}
