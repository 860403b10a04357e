//! S12: a tool that begins inside the solid.

use glam::DVec3;
use tools::haptics::Contact;
use tools::haptics::simulated::{Path, SimulatedHand};

use crate::common::{HalfSpace, Loop, proxy};

#[test]
fn a_tool_that_begins_inside_feels_nothing_until_it_is_clear() {
    let of = |z| DVec3::new(0.0, 0.0, z);
    let path = Path::smooth([(0.5, of(-8.0)), (1.0, of(6.0)), (1.2, of(6.0)), (1.7, of(-2.0))]);
    let check = Loop::new(SimulatedHand::light(path), 3.0).touch(HalfSpace::floor(0.0), proxy(2.0, 500.0));
    let ticks = &check.trace.ticks;
    let clear = ticks
        .iter()
        .position(|t| t.read.at.z >= 2.0)
        .expect("it comes out");
    assert!(clear > 500);
    for tick in &ticks[..clear] {
        assert_eq!(tick.force, DVec3::ZERO, "at {} s", tick.time);
        assert_eq!(tick.contact, Contact::Inside);
    }
    check.assert(
        "began inside",
        &[
            ("pressed later", check.measures.steady.z > 0.5),
            ("P1", check.rests()),
            ("P2", check.is_passive()),
            ("P3", check.is_continuous()),
            ("P4", check.stays_out()),
        ],
    );
}
