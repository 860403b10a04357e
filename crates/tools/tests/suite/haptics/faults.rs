//! S14: devices that break while they press.

use glam::DVec3;
use tools::haptics::gates::{Stage, Trip};
use tools::haptics::simulated::{Fault, FaultKind, Path, SimulatedHand, Trace, World};

use super::common::{HalfSpace, Loop, proxy};

const FROM: f64 = 1.0;
const UNTIL: f64 = 1.3;

/// Time of the tick from which on nothing is sent.
fn silence(trace: &Trace) -> f64 {
    let last = trace
        .between(FROM - 0.1, UNTIL)
        .iter()
        .rfind(|t| t.force != DVec3::ZERO);
    last.map_or(0.0, |t| t.time + t.dt - FROM)
}

#[test]
fn a_fault_takes_the_force_away_until_it_is_armed_again() {
    let of = |z| DVec3::new(0.0, 0.0, z);
    let faults = [
        (FaultKind::NotANumber, Trip::NotFinite, 0.0),
        (FaultKind::Jump(DVec3::new(60.0, 0.0, 80.0)), Trip::TooFast, 0.0),
        (FaultKind::Unplugged, Trip::Gone, 0.0),
        (FaultKind::Frozen, Trip::Stale, 10e-3),
        (FaultKind::WriterStalls, Trip::Writer, 9e-3),
    ];
    for (kind, why, latest) in faults {
        let path = Path::smooth([
            (0.1, of(8.0)),
            (0.5, of(-4.0)),
            (2.0, of(-4.0)),
            (2.3, of(8.0)),
            (2.6, of(8.0)),
            (3.0, of(-4.0)),
        ]);
        let setup = Loop::new(SimulatedHand::light(path), 4.0);
        let world = World::still(HalfSpace::floor(0.0));
        let mut rig = setup.rig(world, setup.served(), |k| Box::new(proxy(2.0, k)));
        rig.device = rig.device.with_faults([Fault {
            from: FROM,
            until: UNTIL,
            kind,
        }]);
        let trace = rig.run(2.5);
        let before = trace.between(0.9, FROM);
        assert!(
            before.iter().all(|t| t.force.z > 1.0),
            "{kind:?}: it presses before"
        );
        let after = silence(&trace);
        assert!(after <= latest + 1e-3 + 1e-9, "{kind:?}: force for {after} s");
        assert_eq!(rig.drive.stage(), Stage::Tripped(why), "{kind:?}");
        let rest = trace.between(FROM + latest + 2e-3, 2.5);
        assert!(
            rest.iter().all(|t| t.force == DVec3::ZERO),
            "{kind:?}: it stays away"
        );
        // The motors follow what is sent, those of a writer that stalls when it goes on.
        let still = if kind == FaultKind::WriterStalls {
            UNTIL
        } else {
            FROM + latest
        };
        let motors = trace.between(still + 3e-3, 2.5);
        assert!(
            motors.iter().all(|t| t.applied == DVec3::ZERO),
            "{kind:?}: so do the motors"
        );
        rig.drive.arm();
        let again = rig.run(4.0);
        let pressed = again.last(0.5);
        assert!(
            pressed.iter().all(|t| t.force.z > 1.0),
            "{kind:?}: it presses again"
        );
        assert!(
            again
                .ticks
                .windows(2)
                .all(|w| (w[1].force - w[0].force).length() <= 0.25)
        );
    }
}
