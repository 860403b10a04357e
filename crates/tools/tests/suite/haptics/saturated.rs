//! S15: a hand stronger than the device.

use glam::DVec3;
use tools::haptics::simulated::{Path, Preset, SimulatedHand, Tick};

use super::common::{Check, Groove, HalfSpace, Loop, proxy, vcp};

fn judge(name: &str, check: &Check) {
    let is_full = |t: &&Tick| t.force.length() > 0.999 * check.most;
    let full: Vec<&Tick> = check.trace.ticks.iter().filter(is_full).collect();
    assert!(
        full.len() > 50,
        "{name}: the limit is reached in {} ticks",
        full.len()
    );
    for t in full {
        let way = (t.proxy.at - t.read.at).normalize();
        assert!(
            t.force.normalize().distance(way) < 1e-9,
            "{name}: turned at {} s",
            t.time
        );
    }
    check.assert(
        name,
        &[
            ("never above", check.measures.force <= check.most * (1.0 + 1e-12)),
            ("P2", check.is_passive()),
            ("P4", check.stays_out()),
        ],
    );
}

#[test]
fn twenty_newtons_move_the_hand_and_not_the_proxy() {
    let of = |x, z| DVec3::new(x, 0.0, z);
    for preset in [Preset::Omni, Preset::Falcon, Preset::Wooden] {
        let push = SimulatedHand::none(of(0.0, 4.0), 20.0 * DVec3::new(0.6, 0.0, -0.8));
        let setup = Loop {
            device: preset.mechanics(),
            ..Loop::new(push, 0.25)
        };
        judge(
            preset.name(),
            &setup.touch(HalfSpace::floor(0.0), proxy(2.0, 500.0)),
        );
        // 20 N at most, and a way back.
        let path = Path::smooth([
            (0.1, of(3.0, 12.0)),
            (0.5, of(1.0, -60.0)),
            (1.0, of(1.0, -60.0)),
            (1.5, of(3.0, 14.0)),
        ]);
        let setup = Loop {
            device: preset.mechanics(),
            ..Loop::new(SimulatedHand::light(path).of_strength(20.0), 2.0)
        };
        let check = setup.touch(Groove { half: 0.6 }, proxy(2.0, 500.0));
        judge(preset.name(), &check);
        let end = check.trace.ticks.last().expect("ticks");
        assert_eq!(
            end.force,
            DVec3::ZERO,
            "{preset:?}: it came out the way it went in"
        );
    }
}

/// 60 mm below no ray of the stateless contact comes out, and on the way there the side changes.
#[test]
fn twenty_newtons_take_the_stateless_contact_along() {
    let of = |x, z| DVec3::new(x, 0.0, z);
    let path = Path::smooth([(0.1, of(3.0, 12.0)), (0.5, of(1.0, -60.0)), (1.0, of(1.0, -60.0))]);
    for preset in [Preset::Omni, Preset::Falcon, Preset::Wooden] {
        let setup = Loop {
            device: preset.mechanics(),
            ..Loop::new(SimulatedHand::light(path.clone()).of_strength(20.0), 1.2)
        };
        let check = setup.touch(Groove { half: 0.6 }, vcp(2.0, 500.0));
        assert!(
            check.measures.deepest > 50.0 && !check.is_slewed(),
            "{:#?}",
            check.measures
        );
    }
}
