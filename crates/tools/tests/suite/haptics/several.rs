//! Two objects at once.

use glam::DVec3;
use tools::haptics::Together;
use tools::haptics::simulated::{Path, SimulatedHand};
use tools::haptics::{Obstacle, Touch};

use super::common::{Ball, Loop, proxy};

const BALLS: [Ball; 2] = [
    Ball {
        middle: DVec3::new(-9.0, 0.0, 0.0),
        radius: 10.0,
    },
    Ball {
        middle: DVec3::new(9.0, 0.0, 0.0),
        radius: 10.0,
    },
];

/// Two balls that overlap, as one obstacle that owns them.
struct Pair;

impl Obstacle for Pair {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        Together(&BALLS).distance(p)
    }

    fn finest(&self) -> f64 {
        Together(&BALLS).finest()
    }

    fn touch(&self, p: DVec3) -> Touch {
        Together(&BALLS).touch(p)
    }
}

#[test]
fn the_valley_between_two_objects_holds_the_tool() {
    let of = |x, z| DVec3::new(x, 0.0, z);
    let path = Path::smooth([(0.1, of(3.0, 14.0)), (0.8, of(0.5, 0.0)), (1.0, of(-0.3, 0.0))]);
    let check = Loop::new(SimulatedHand::light(path), 3.0).touch(Pair, proxy(2.0, 500.0));
    // The middle of the tool is 12 mm from both middles.
    let valley = DVec3::new(0.0, 0.0, (12.0f64 * 12.0 - 9.0 * 9.0).sqrt());
    let end = check.trace.ticks.last().expect("ticks");
    assert!(
        (end.proxy.at - valley).length() < 0.01,
        "{} in place of {valley}",
        end.proxy.at
    );
    let wanted = 0.5 * (valley - end.read.at);
    assert!((end.force - wanted).length() < 0.02 * wanted.length());
    check.assert(
        "valley",
        &[
            ("P1", check.rests()),
            ("P2", check.is_passive()),
            ("P3", check.is_slewed()),
            ("P4", check.stays_out()),
        ],
    );
}

#[test]
fn a_tool_goes_from_one_object_to_the_other() {
    let of = |x, z| DVec3::new(x, 0.0, z);
    let path = Path::smooth([(0.0, of(-9.0, 14.0)), (0.2, of(-9.0, 9.0)), (1.0, of(9.0, 9.0))]);
    let check = Loop::new(SimulatedHand::light(path), 2.0).touch(Pair, proxy(2.0, 500.0));
    let nearest: Vec<bool> = check
        .trace
        .between(0.3, 1.5)
        .iter()
        .map(|t| t.proxy.at.x > 0.0)
        .collect();
    assert_eq!(
        nearest.windows(2).filter(|w| w[0] != w[1]).count(),
        1,
        "from one to the other, once"
    );
    check.assert(
        "from ball to ball",
        &[
            ("P1", check.rests()),
            ("P2", check.is_passive()),
            ("P3", check.is_slewed()),
            ("P4", check.stays_out()),
        ],
    );
}
