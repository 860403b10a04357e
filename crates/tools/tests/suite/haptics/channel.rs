//! S7: channels hardly wider than the tool, and hardly too narrow.

use glam::DVec3;
use tools::haptics::Renderer;
use tools::haptics::simulated::{Path, SimulatedHand};

use super::common::{Channel, Check, Loop, Passage, penalty, plane, proxy, vcp};

/// Changes of the sign of some values, those within a band about 0 left out.
fn sign_changes(values: impl Iterator<Item = f64>, band: f64) -> usize {
    let signs: Vec<bool> = values.filter(|v| v.abs() > band).map(|v| v > 0.0).collect();
    signs.windows(2).filter(|w| w[0] != w[1]).count()
}

/// Along a passage between thin walls at 20 mm/s, pushed to one side, to the other and back.
fn drifted(renderer: impl Renderer + 'static) -> Check {
    let of = |x, z| DVec3::new(x, 0.0, z);
    let path = Path::smooth([
        (0.2, of(0.0, 0.0)),
        (0.7, of(8.0, -10.0)),
        (1.2, of(-8.0, -20.0)),
        (1.7, of(8.0, -30.0)),
    ]);
    let setup = Loop::new(SimulatedHand::light(path), 3.0);
    let walls = Passage {
        gap: 4.1,
        thickness: 1.0,
    };
    setup.touch(walls, renderer)
}

fn is_between(p: DVec3) -> bool {
    p.x.abs() < 2.5
}

fn chatter(check: &Check) -> usize {
    sign_changes(check.trace.ticks.iter().map(|t| t.force.x), 0.0)
}

#[test]
fn a_narrow_passage_is_drifted_through() {
    let check = drifted(proxy(2.0, 500.0));
    // The hand changes sides twice.
    check.assert(
        "proxy in a passage",
        &[
            ("P1", check.rests()),
            ("P2", check.is_passive()),
            ("P3", check.is_continuous()),
            ("P4", check.stays_out() && check.trace.crossings(is_between) == 0),
            ("no chatter", chatter(&check) <= 2 + 2),
        ],
    );
}

#[test]
fn methods_without_memory_leave_a_passage_through_its_walls() {
    for (name, check) in [
        ("penalty", drifted(penalty(2.0, 500.0))),
        ("vcp", drifted(vcp(2.0, 500.0))),
    ] {
        assert!(check.trace.crossings(is_between) > 0, "{name}");
        assert!(!check.is_slewed(), "{name}");
    }
}

/// Down onto the mouth of a slot of a width, mm, 1 mm beside its middle, then to the middle, then on.
fn entered(gap: f64, renderer: impl Renderer + 'static) -> Check {
    let of = |x, z| DVec3::new(x, 0.0, z);
    let path = Path::smooth([
        (0.2, of(1.0, 6.0)),
        (0.6, of(1.0, -1.0)),
        (1.0, of(0.0, -1.0)),
        (1.5, of(0.0, -6.0)),
    ]);
    let setup = Loop::new(SimulatedHand::light(path), 3.0);
    setup.touch(Channel { gap }, renderer)
}

#[test]
fn a_ball_enters_a_slot_that_is_wide_enough_and_no_other() {
    let wide = entered(4.1, proxy(2.0, 500.0));
    let inside = wide.trace.ticks.last().expect("ticks").proxy.at;
    assert!(inside.z < -5.0, "it is at {inside}");
    let narrow = entered(3.95, proxy(2.0, 500.0));
    let end = narrow.trace.ticks.last().expect("ticks").proxy.at;
    // Between the two corners of the mouth.
    let rest = (2.0f64.powi(2) - 1.975f64.powi(2)).sqrt();
    assert!(
        (end - DVec3::new(0.0, 0.0, rest)).length() < 0.05,
        "it is at {end}, not {rest} above the mouth"
    );
    for check in [wide, narrow] {
        check.assert(
            "proxy at a slot",
            &[
                ("P1", check.rests()),
                ("P2", check.is_passive()),
                ("P3", check.is_slewed()),
                ("P4", check.stays_out()),
            ],
        );
    }
}

#[test]
fn a_tangent_plane_knows_one_wall_of_a_passage() {
    let check = drifted(plane(2.0, 500.0, 30.0));
    let leaves = check.trace.crossings(is_between) > 0 && !check.stays_out();
    assert!(leaves && !check.is_slewed(), "{:#?}", check.measures);
}
