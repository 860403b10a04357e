//! A thin sheet, hit fast.

use glam::DVec3;
use tools::haptics::controls::Penalty;
use tools::haptics::simulated::{Path, SimulatedHand};

use crate::common::{HalfSpace, Loop, Projection, Sheet};

/// At half a metre a second towards 12 mm behind the sheet, and held there.
fn hit() -> SimulatedHand {
    let of = |z| DVec3::new(0.0, 0.0, z);
    SimulatedHand::light(Path::straight([(0.1, of(15.0)), (0.154, of(-12.0))]))
}

fn is_above(p: DVec3) -> bool {
    p.z > 0.0
}

#[test]
fn a_thin_sheet_holds_a_fast_hand() {
    let renderer = Projection {
        walls: vec![HalfSpace::floor(0.5)],
        radius: 2.0,
        stiffness: 500.0,
    };
    let check = Loop::new(hit(), 1.5).touch(Sheet { thickness: 1.0 }, renderer);
    println!("{:#?}", check.measures);
    check.assert(
        "sheet",
        &[
            ("P3", check.measures.jumps_over == 0),
            ("P4", check.stays_out() && check.trace.crossings(is_above) == 0),
        ],
    );
}

#[test]
fn the_penalty_method_pops_through_a_thin_sheet() {
    for (stiffness, jump) in [(500.0, 2.0), (1500.0, 6.0)] {
        let renderer = Penalty {
            radius: 2.0,
            stiffness,
        };
        let setup = Loop {
            stiffness,
            ..Loop::new(hit(), 1.5)
        };
        let check = setup.touch(Sheet { thickness: 1.0 }, renderer);
        println!("{:#?}", check.measures);
        assert!(check.trace.crossings(is_above) > 0);
        assert!(check.measures.jump > jump && check.measures.jumps_over > 0);
    }
}
