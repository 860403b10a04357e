//! S4: a convex edge, slid over at 0.1 m/s.

use glam::DVec3;
use tools::haptics::simulated::{Path, SimulatedHand, Tick};
use tools::haptics::{Contact, Renderer};

use super::common::{Check, Edge, Loop, penalty, plane, proxy, vcp};

/// Across a roof of an opening angle, degrees, from 12 mm on one side to 12 mm on the other, the hand drawn to a height, mm,
/// below its edge.
fn slid(opening: f64, height: f64, renderer: impl Renderer + 'static) -> Check {
    let of = |x| DVec3::new(x, 0.0, height);
    let path = Path::straight([(0.2, of(-12.0)), (0.44, of(12.0))]);
    let setup = Loop::new(SimulatedHand::light(path), 1.0);
    let half = (0.5 * opening).to_radians();
    setup.touch(Edge { half }, renderer)
}

fn losses(check: &Check) -> usize {
    let is_free = |t: &Tick| t.contact == Contact::Free;
    let ticks = &check.trace.ticks;
    ticks
        .windows(2)
        .filter(|w| !is_free(&w[0]) && is_free(&w[1]))
        .count()
}

/// Openings and heights at which the hand gets not quite as deep as the radius of the tool: deeper no method turns the force
/// within the slew limit by itself.
const SHALLOW: [(f64, f64); 2] = [(90.0, -1.2), (30.0, -0.2)];
/// As deep as the tool, or a little deeper.
const DEEP: [(f64, f64); 2] = [(90.0, -1.2), (30.0, -0.5)];

#[test]
fn a_sharp_edge_is_slid_over() {
    for (opening, height) in SHALLOW {
        let check = slid(opening, height, proxy(2.0, 500.0));
        check.assert(
            &format!("proxy over an edge of {opening}°"),
            &[
                ("it presses", check.measures.force > 0.8),
                ("P2", check.is_passive()),
                ("P3", check.is_slewed()),
                ("P4", check.stays_out()),
                ("one contact", losses(&check) <= 1),
            ],
        );
    }
}

/// At the middle of the wedge the nearest side is the other one, and the force flips: by 0.4 N and 1.9 N.
#[test]
fn the_nearest_surface_flips_at_an_edge() {
    for (opening, height) in DEEP {
        for (name, check) in [
            ("penalty", slid(opening, height, penalty(2.0, 500.0))),
            ("vcp", slid(opening, height, vcp(2.0, 500.0))),
        ] {
            assert!(
                !check.is_slewed(),
                "{name} over an edge of {opening}°: {:#?}",
                check.measures
            );
        }
    }
}

/// Far below the edge the proxy crosses it late, but in one tick: no energy comes of it, and what is sent is for the slew limit to turn.
#[test]
fn deep_below_an_edge_the_contact_changes_sides_once() {
    for opening in [90.0, 30.0] {
        let check = slid(opening, -3.0, proxy(2.0, 500.0));
        assert_eq!(check.trace.crossings(|p| p.x > 0.0), 1);
        check.assert(
            &format!("proxy deep below an edge of {opening}°"),
            &[
                ("P2", check.is_passive()),
                ("P4", check.stays_out()),
                ("one contact", losses(&check) <= 1),
            ],
        );
    }
}

/// The plane of a side goes on beyond the edge until it is taken anew.
#[test]
fn a_tangent_plane_jumps_behind_an_edge() {
    for (opening, height) in DEEP {
        let check = slid(opening, height, plane(2.0, 500.0, 30.0));
        assert!(check.measures.jump > 0.7, "{opening}°: {:#?}", check.measures);
    }
}
