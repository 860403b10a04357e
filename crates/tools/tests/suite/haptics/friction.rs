//! What friction feels like: its angle can be read off the force.

use glam::DVec3;
use tools::haptics::Contact;
use tools::haptics::simulated::{Path, SimulatedHand};

use super::common::{HalfSpace, Loop, Rubbing, proxy};

#[test]
fn the_angle_of_friction_is_recovered() {
    for coefficient in [0.1, 0.3, 0.7, 1.2] {
        let of = |x, z| DVec3::new(x, 0.0, z);
        let path = Path::smooth([
            (0.1, of(0.0, 4.0)),
            (0.6, of(0.0, -4.0)),
            (1.0, of(0.0, -4.0)),
            (2.5, of(30.0, -4.0)),
        ]);
        let floor = Rubbing {
            solid: HalfSpace::floor(0.0),
            coefficient,
        };
        let check = Loop::new(SimulatedHand::light(path), 2.5).touch(floor, proxy(2.0, 500.0));
        // While it slides the force leans by the angle of friction.
        let slides = check
            .trace
            .between(1.2, 2.4)
            .iter()
            .filter(|t| t.contact == Contact::Slides);
        let angles: Vec<f64> = slides.map(|t| (-t.force.x).atan2(t.force.z)).collect();
        assert!(angles.len() > 200, "{} ticks slide", angles.len());
        let mean = angles.iter().sum::<f64>() / angles.len() as f64;
        let wanted = coefficient.atan();
        assert!(
            (mean / wanted - 1.0).abs() < 0.02,
            "{mean} rad in place of {wanted}"
        );
        // Never more than the cone.
        let most = check
            .trace
            .ticks
            .iter()
            .map(|t| t.force.x.abs() - coefficient * t.force.z)
            .fold(0.0, f64::max);
        assert!(most < 1e-3, "{most} N outside the cone of {coefficient}");
        assert!(check.is_passive() && check.stays_out());
    }
}

#[test]
fn friction_holds_a_tool_at_rest() {
    let of = |x, z| DVec3::new(x, 0.0, z);
    // The hand pulls sideways by half of what friction holds.
    let path = Path::smooth([(0.1, of(0.0, 4.0)), (0.6, of(0.0, -4.0)), (1.0, of(1.0, -4.0))]);
    let floor = Rubbing {
        solid: HalfSpace::floor(0.0),
        coefficient: 0.7,
    };
    let check = Loop::new(SimulatedHand::light(path), 3.0).touch(floor, proxy(2.0, 500.0));
    let held = check.trace.last(1.0);
    assert!(held.iter().all(|t| t.contact == Contact::Sticks));
    let drift = held[0].proxy.at.distance(held[held.len() - 1].proxy.at);
    assert!(drift < 1e-6, "it crept by {drift} mm");
    check.assert(
        "held by friction",
        &[("P1", check.rests()), ("P2", check.is_passive())],
    );
}
