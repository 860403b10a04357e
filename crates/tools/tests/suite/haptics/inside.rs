//! S12: a tool that begins inside the solid.

use glam::DVec3;
use tools::haptics::simulated::{Path, SimulatedHand, Tick};
use tools::haptics::{Contact, Renderer};

use super::common::{Check, HalfSpace, Loop, proxy, vcp};

/// From 10 mm below where it would rest, out, and back onto the surface.
fn began(renderer: impl Renderer + 'static) -> Check {
    let of = |z| DVec3::new(0.0, 0.0, z);
    let path = Path::smooth([(0.5, of(-8.0)), (1.0, of(6.0)), (1.2, of(6.0)), (1.7, of(-2.0))]);
    Loop::new(SimulatedHand::light(path), 3.0).touch(HalfSpace::floor(0.0), renderer)
}

/// The ticks before the hand was clear for the first time.
fn before_clear(check: &Check) -> &[Tick] {
    let clear = |t: &Tick| t.read.at.z >= 2.0;
    let first = check.trace.ticks.iter().position(clear);
    &check.trace.ticks[..first.expect("it comes out")]
}

#[test]
fn a_tool_that_begins_inside_feels_nothing_until_it_is_clear() {
    let check = began(proxy(2.0, 500.0));
    let inside = before_clear(&check);
    assert!(inside.len() > 500);
    for tick in inside {
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

/// What has no memory throws the hand out with all its force, and the energy of where it began.
#[test]
fn the_stateless_contact_throws_it_out() {
    let check = began(vcp(2.0, 500.0));
    assert!(before_clear(&check).iter().any(|t| t.force.z >= 3.3));
    assert!(!check.is_passive(), "{:#?}", check.measures);
}
