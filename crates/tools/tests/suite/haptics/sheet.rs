//! S2: a thin sheet, hit fast, with a hand that pulls through it.

use glam::DVec3;
use tools::haptics::Renderer;
use tools::haptics::simulated::{Path, SimulatedHand};

use super::common::{Check, Loop, Sheet, penalty, plane, proxy, vcp};

/// At half a metre a second towards 12 mm behind the sheet, and held there.
fn hit(stiffness: f64, renderer: impl Renderer + 'static) -> Check {
    let of = |z| DVec3::new(0.0, 0.0, z);
    let hand = SimulatedHand::light(Path::straight([(0.1, of(15.0)), (0.154, of(-12.0))]));
    let setup = Loop {
        stiffness,
        ..Loop::new(hand, 1.5)
    };
    setup.touch(Sheet { thickness: 1.0 }, renderer)
}

fn is_above(p: DVec3) -> bool {
    p.z > 0.0
}

#[test]
fn a_thin_sheet_holds_a_fast_hand() {
    for stiffness in [500.0, 1500.0] {
        let check = hit(stiffness, proxy(2.0, stiffness));
        check.assert(
            "proxy and a sheet",
            &[
                ("P1", check.rests()),
                ("P2", check.is_passive()),
                ("P3", check.measures.jumps_over == 0),
                ("P4", check.stays_out() && check.trace.crossings(is_above) == 0),
            ],
        );
    }
}

/// Without memory of the side the force turns round where the middle of the sheet is passed: at 500 N/m by 2.2 N, at 1500 by 6.5.
#[test]
fn methods_without_memory_pop_through_a_thin_sheet() {
    let judge = |name: &str, check: Check, jump: f64| {
        assert_eq!(check.trace.crossings(is_above), 1, "{name}");
        assert!(check.measures.jump > jump, "{name}: {:#?}", check.measures);
        assert!(check.measures.jumps_over > 0, "{name}");
        assert!(!check.is_passive(), "{name}");
    };
    judge("penalty at 500 N/m", hit(500.0, penalty(2.0, 500.0)), 2.0);
    judge("penalty at 1500 N/m", hit(1500.0, penalty(2.0, 1500.0)), 6.0);
    judge("vcp at 500 N/m", hit(500.0, vcp(2.0, 500.0)), 2.0);
}

/// A plane of 30 Hz is taken from below where the hand is behind the middle by then: it was 16 mm further on.
#[test]
fn a_tangent_plane_lets_a_fast_hand_through() {
    let check = hit(500.0, plane(2.0, 500.0, 30.0));
    assert_eq!(check.trace.crossings(is_above), 1);
    assert!(check.measures.jump > 2.0, "{:#?}", check.measures);
}
