//! S11: forces that come late.

use glam::DVec3;
use tools::haptics::Renderer;
use tools::haptics::simulated::{Mechanics, Path, Preset, SimulatedHand};

use super::common::{Check, HalfSpace, Loop, omni, proxy, vcp};

const DELAYS: [f64; 5] = [0.0, 1e-3, 2e-3, 5e-3, 10e-3];

fn of(z: f64) -> DVec3 {
    DVec3::new(0.0, 0.0, z)
}

fn pressed(
    device: Mechanics,
    hand: SimulatedHand,
    stiffness: f64,
    renderer: impl Renderer + 'static,
) -> Check {
    let setup = Loop {
        device,
        stiffness,
        ..Loop::new(hand, 6.0)
    };
    setup.touch(HalfSpace::floor(0.0), renderer)
}

#[test]
fn a_late_force_is_stable_below_the_bound_and_unstable_far_above() {
    let press = Path::smooth([(0.0, of(4.0)), (0.5, of(-4.0))]);
    let hands = [
        (0.0, SimulatedHand::none(of(2.02), -DVec3::Z)),
        (4.0, SimulatedHand::light(press)),
    ];
    for (hand_damping, hand) in hands {
        for delay in DELAYS {
            let device = Mechanics {
                delay,
                ..Preset::Ideal.mechanics()
            };
            let bound = device.stable_stiffness(hand_damping);
            let name = format!("of {bound} N/m, {delay} s, hand {hand_damping}");
            let calm = 0.7 * bound;
            let still = |method: &str, check: Check| {
                check.assert(
                    &format!("{method}, 0.7 {name}"),
                    &[("P1", check.rests()), ("P2", check.is_passive())],
                );
            };
            still(
                "proxy",
                pressed(device.clone(), hand.clone(), calm, proxy(2.0, calm)),
            );
            still("vcp", pressed(device.clone(), hand.clone(), calm, vcp(2.0, calm)));
            let wild = 3.0 * bound;
            let swings = |method: &str, check: Check| {
                // So far down that no ray of the stateless contact comes out, it lets go.
                let swings = !check.rests() || check.measures.deepest > 10.0;
                let feeds = swings && check.measures.work > 1e-2;
                assert!(feeds, "{method}, 3 {name}: {:#?}", check.measures);
            };
            swings(
                "proxy",
                pressed(device.clone(), hand.clone(), wild, proxy(2.0, wild)),
            );
            swings("vcp", pressed(device, hand.clone(), wild, vcp(2.0, wild)));
        }
    }
}

/// At 10 ms the omni in a light hand is bound to 430 N/m: dry friction keeps 500 at rest, 1000 swings to the end of its force
/// once it was hit.
#[test]
fn ten_milliseconds_make_a_limit_cycle_that_feeds_the_hand() {
    let hit = Path::straight([(0.1, of(14.0)), (0.2, of(-4.0))]);
    let late = Mechanics {
        delay: 10e-3,
        ..omni()
    };
    let hand = SimulatedHand::light(hit);
    let bound = late.stable_stiffness(4.0);
    let stable = pressed(late.clone(), hand.clone(), 0.7 * bound, proxy(2.0, 0.7 * bound));
    stable.assert("omni at 0.7 of the bound", &[("P1", stable.rests())]);
    let wild = pressed(late, hand, 1000.0, proxy(2.0, 1000.0));
    assert!(
        wild.measures.ripple > 3.0 && wild.measures.work > 0.1,
        "{:#?}",
        wild.measures
    );
}
