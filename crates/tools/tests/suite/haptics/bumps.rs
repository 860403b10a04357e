//! S8: a bumpy surface whose field is no distance, at 0.15 m/s.

use glam::{DVec2, DVec3};
use tools::haptics::Renderer;
use tools::haptics::simulated::{Path, SimulatedHand};

use super::common::{Bumps, Check, Loop, penalty, proxy, vcp};

/// Waves of 1.2 mm, 4 and 7 mm long; there and back over 45 mm.
fn slid(renderer: impl Renderer + 'static) -> Check {
    let of = |x, y| DVec3::new(x, y, -1.0);
    let path = Path::straight([
        (0.0, DVec3::new(0.0, 0.0, 6.0)),
        (0.2, of(0.0, 0.0)),
        (0.5, of(40.0, 20.0)),
        (0.8, of(0.0, 0.0)),
        (0.9, DVec3::new(0.0, 0.0, 8.0)),
    ]);
    let setup = Loop::new(SimulatedHand::light(path), 1.2);
    let bumps = Bumps {
        amplitude: 1.2,
        waves: DVec2::new(4.0, 7.0),
    };
    setup.touch(bumps, renderer)
}

#[test]
fn a_bumpy_surface_is_slid_over() {
    let check = slid(proxy(2.0, 500.0));
    check.assert(
        "proxy on bumps",
        &[("P2", check.is_passive()), ("P4", check.stays_out())],
    );
}

/// Where the field is no distance K (r − φ) n is no gradient: it gives back more than was put in.
#[test]
fn the_penalty_method_creates_energy_on_bumps() {
    let check = slid(penalty(2.0, 500.0));
    assert!(check.measures.returned > 5e-4, "{:#?}", check.measures);
    // The ray of the stateless contact ends on the surface, but begins along the same gradient.
    let check = slid(vcp(2.0, 500.0));
    assert!(
        check.measures.returned > 2e-4 && check.stays_out(),
        "{:#?}",
        check.measures
    );
}
