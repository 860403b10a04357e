//! S4: a convex edge, slid over at 0.1 m/s.

use glam::DVec3;
use tools::haptics::simulated::{Path, SimulatedHand};
use tools::haptics::{Contact, Renderer};

use crate::common::{Check, Edge, Loop, penalty, proxy, vcp};

/// Across a roof of an opening angle, degrees, from 12 mm on one side to 12 mm on the other, pressed below its edge.
fn slid(opening: f64, renderer: impl Renderer) -> Check {
    let of = |x, z| DVec3::new(x, 0.0, z);
    let path = Path::straight([(0.2, of(-12.0, 1.0)), (0.44, of(12.0, 1.0))]);
    let setup = Loop::new(SimulatedHand::light(path), 1.0);
    let half = (0.5 * opening).to_radians();
    setup.touch(Edge { half }, renderer)
}

fn losses(check: &Check) -> usize {
    let is_free = |t: &tools::haptics::simulated::Tick| t.contact == Contact::Free;
    let ticks = &check.trace.ticks;
    ticks
        .windows(2)
        .filter(|w| !is_free(&w[0]) && is_free(&w[1]))
        .count()
}

#[test]
fn a_sharp_edge_is_slid_over() {
    for opening in [90.0, 30.0] {
        let check = slid(opening, proxy(2.0, 500.0));
        println!("proxy {opening} {} {:#?}", losses(&check), check.measures);
        assert!(check.measures.force > 0.2, "it presses: {:#?}", check.measures);
        check.assert(
            &format!("proxy over an edge of {opening}°"),
            &[
                ("P2", check.is_passive()),
                ("P3", check.is_slewed()),
                ("P4", check.stays_out()),
                ("one contact", losses(&check) <= 1),
            ],
        );
    }
}

#[test]
fn the_nearest_surface_flips_at_an_edge() {
    for opening in [90.0, 30.0] {
        let check = slid(opening, penalty(2.0, 500.0));
        println!("penalty {opening} {} {:#?}", losses(&check), check.measures);
        let check = slid(opening, vcp(2.0, 500.0));
        println!("vcp {opening} {} {:#?}", losses(&check), check.measures);
    }
}
