//! S10: ticks that come early and late, and some that are missing.

use glam::DVec3;
use tools::haptics::simulated::{Path, Preset, SimulatedHand, Timing};

use super::common::{Check, HalfSpace, Loop, omni, proxy, vcp};
use super::groove;

fn shaky(seed: u64) -> Timing {
    Timing {
        jitter: 0.5,
        seed,
        stalls: vec![(0.9, 8e-3), (1.4, 8e-3)],
    }
}

#[test]
fn a_shaky_clock_shakes_no_wall() {
    let of = |z| DVec3::new(0.0, 0.0, z);
    let press = Path::smooth([(0.1, of(14.0)), (0.6, of(-4.0))]);
    for seed in 0..5 {
        let stable = |damping: f64| 0.5 * damping / 1.5e-3;
        let loops = [
            (omni(), SimulatedHand::light(press.clone()), stable(0.5 + 4.0)),
            (
                Preset::Ideal.mechanics(),
                SimulatedHand::light(press.clone()),
                stable(0.8 + 4.0),
            ),
            (
                Preset::Ideal.mechanics(),
                SimulatedHand::none(of(2.05), -DVec3::Z),
                stable(0.8),
            ),
        ];
        for (device, hand, stiffness) in loops {
            let name = format!("{} at {stiffness} N/m, seed {seed}", device.name);
            let setup = Loop {
                device,
                stiffness,
                timing: shaky(seed),
                ..Loop::new(hand, 4.0)
            };
            let judge = |method: &str, check: Check| {
                check.assert(
                    &format!("{method}, {name}"),
                    &[("P1", check.rests()), ("P2", check.is_passive())],
                );
            };
            judge("proxy", setup.touch(HalfSpace::floor(0.0), proxy(2.0, stiffness)));
            judge("vcp", setup.touch(HalfSpace::floor(0.0), vcp(2.0, stiffness)));
        }
    }
}

#[test]
fn a_shaky_clock_shakes_no_groove() {
    for half in groove::HALVES {
        for seed in 0..3 {
            let check = groove::pressed(half, shaky(seed), proxy(groove::RADIUS, groove::STIFFNESS));
            check.assert(
                &format!("groove of {half}°, seed {seed}"),
                &[
                    ("P1", check.rests()),
                    ("P3 tick by tick", check.measures.expansion < 1e-3),
                    ("P4", check.stays_out()),
                ],
            );
        }
    }
}
