//! A stiff wall, pressed and held.

use glam::DVec3;
use tools::haptics::Renderer;
use tools::haptics::simulated::{Mechanics, Path, Preset, SimulatedHand};

use crate::common::{Check, HalfSpace, Loop, Projection};

fn floor() -> HalfSpace {
    HalfSpace::floor(0.0)
}

fn exact(stiffness: f64, radius: f64) -> Projection {
    Projection {
        walls: vec![floor()],
        radius,
        stiffness,
    }
}

/// From 12 mm above to 6 mm below, in half a second.
fn press() -> Path {
    let of = |z| DVec3::new(0.0, 0.0, z);
    Path::smooth([(0.1, of(14.0)), (0.6, of(-4.0))])
}

fn pressed(hand: SimulatedHand, stiffness: f64, renderer: impl Renderer) -> Check {
    let setup = Loop {
        stiffness,
        ..Loop::new(hand, 3.0)
    };
    setup.touch(floor(), renderer)
}

#[test]
fn a_wall_is_pressed_and_held() {
    for hand in [SimulatedHand::light(press()), SimulatedHand::firm(press())] {
        for stiffness in [250.0, 500.0, 1000.0] {
            let check = pressed(hand.clone(), stiffness, exact(stiffness, 2.0));
            check.assert(
                &format!("wall at {stiffness} N/m"),
                &[
                    ("P1", check.rests()),
                    ("P2", check.is_passive()),
                    ("P3", check.measures.jumps_over == 0),
                ],
            );
        }
    }
}

/// Stiffness, N/m, from which on an oscillation grows, in steps of 2 %.
fn limit(device: &Mechanics, hand: &SimulatedHand, make: impl Fn(f64) -> Projection) -> f64 {
    let grows = |stiffness: f64| {
        let setup = Loop {
            device: device.clone(),
            stiffness,
            ..Loop::new(hand.clone(), 5.0)
        };
        let check = setup.touch(floor(), make(stiffness));
        let ripple = |from: f64| {
            let forces = check.trace.between(from, from + 1.0).iter().map(|t| t.force.z);
            let (low, high) = forces.fold((f64::INFINITY, 0.0f64), |(l, h), f| (l.min(f), h.max(f)));
            high - low
        };
        ripple(4.0) > 1e-9 && ripple(4.0) > 0.95 * ripple(2.0)
    };
    let (mut low, mut high) = (0.0f64, 1.0);
    let bound = device.stable_stiffness(0.0);
    // Stability falls with the stiffness: halve the interval.
    high *= 40.0 * bound;
    while high > 1.02 * low.max(1.0) {
        let middle = if low == 0.0 {
            0.5 * bound
        } else {
            (low * high).sqrt()
        };
        if grows(middle) {
            high = middle;
        } else {
            low = middle;
        }
        if low == 0.0 && high < 1.0 {
            break;
        }
    }
    high
}

#[test]
fn the_limit_of_stability_is_that_of_the_formula() {
    for delay in [0.0, 1e-3, 2e-3, 5e-3] {
        let device = Mechanics {
            delay,
            ..Preset::Ideal.mechanics()
        };
        let above = DVec3::new(0.0, 0.0, 2.02);
        let hand = SimulatedHand::none(above, -DVec3::Z);
        let found = limit(&device, &hand, |k| exact(k, 2.0));
        let formula = device.stable_stiffness(0.0);
        println!("delay {delay}: {found} against {formula}");
        assert!(
            (found / formula - 1.0).abs() < 0.15,
            "{found} N/m at {delay} s, by the formula {formula}"
        );
    }
}
