//! S3: a V-shaped groove, pressed below its vertex by a trembling hand.

use glam::DVec3;
use tools::haptics::Renderer;
use tools::haptics::simulated::{Path, SimulatedHand, Timing};

use super::common::{Check, Groove, HalfSpace, Loop, Projection, penalty, proxy, vcp};

pub const STIFFNESS: f64 = 400.0;
pub const RADIUS: f64 = 0.5;
pub const HALVES: [f64; 3] = [20.0, 10.0, 5.0];

/// Down one side of a groove of a half angle, degrees, to its bottom, and 9 mm towards the solid below.
pub fn pressed(half: f64, timing: Timing, renderer: impl Renderer + 'static) -> Check {
    let half = half.to_radians();
    let of = |x, z| DVec3::new(x, 0.0, z);
    let top = 12.5 * half.tan();
    let path = Path::smooth([(0.1, of(top, 25.0)), (0.9, of(0.0, -9.0))]);
    let hand = SimulatedHand::light(path.trembling(0.02 * DVec3::X, 35.0));
    let setup = Loop {
        stiffness: STIFFNESS,
        radius: RADIUS,
        timing,
        ..Loop::new(hand, 3.0)
    };
    setup.touch(Groove { half }, renderer)
}

fn exact(half: f64) -> Projection {
    let half = half.to_radians();
    let wall = |side: f64| HalfSpace {
        normal: DVec3::new(-side * half.cos(), 0.0, half.sin()),
        height: 0.0,
    };
    Projection {
        walls: vec![wall(1.0), wall(-1.0)],
        radius: RADIUS,
        stiffness: STIFFNESS,
    }
}

#[test]
fn a_groove_is_felt_as_its_two_sides() {
    for half in HALVES {
        let check = pressed(half, Timing::default(), proxy(RADIUS, STIFFNESS));
        // K (r/sin α + depth below the vertex): the ball rests on both sides.
        let depth = -check.trace.last(1.0).iter().map(|t| t.read.at.z).sum::<f64>() / 1000.0;
        let wanted = 1e-3 * STIFFNESS * (RADIUS / half.to_radians().sin() + depth);
        assert!(depth > 0.0, "{half}°: {depth} mm below the vertex");
        check.assert(
            &format!("proxy in a groove of {half}°"),
            &[
                ("P1", check.rests()),
                ("P2", check.is_passive()),
                ("P3", check.is_continuous()),
                ("P3 tick by tick", check.measures.expansion < 1e-3),
                ("P4", check.stays_out()),
                ("P5", (check.measures.steady.z / wanted - 1.0).abs() < 0.02),
            ],
        );
    }
}

#[test]
fn the_exact_projection_passes_the_same_judge() {
    for half in HALVES {
        let check = pressed(half, Timing::default(), exact(half));
        check.assert(
            &format!("projection in a groove of {half}°"),
            &[
                ("P1", check.rests()),
                ("P2", check.is_passive()),
                ("P3", check.is_continuous()),
                ("P3 tick by tick", check.measures.expansion < 1e-9),
                ("P4", check.stays_out()),
            ],
        );
    }
}

/// One side at a time pushes the hand to and fro across the middle, and the contact is inside the other side: in some 70 to 170
/// ticks the stateless contact is up to 3.3 mm deep, jumps by all of the device's force, and gives back 5 to 10 mJ; that of the
/// penalty method is 0.9 mm deep for good.
#[test]
fn methods_of_one_normal_enter_the_sides_of_a_groove() {
    for half in HALVES {
        for (name, check) in [
            (
                "penalty",
                pressed(half, Timing::default(), penalty(RADIUS, STIFFNESS)),
            ),
            ("vcp", pressed(half, Timing::default(), vcp(RADIUS, STIFFNESS))),
        ] {
            let m = &check.measures;
            let sinks = m.sunk > 20 && m.deepest > 0.5 && m.jumps_over > 0;
            assert!(sinks, "{name} at {half}°: {m:#?}");
        }
        let wild = pressed(half, Timing::default(), vcp(RADIUS, STIFFNESS));
        assert!(
            !wild.is_passive() && !wild.is_slewed(),
            "vcp at {half}°: {:#?}",
            wild.measures
        );
    }
}
