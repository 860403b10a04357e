//! What the gates of a servo add: nothing that is sent changes faster than the slew limit, whatever the contact does.

use glam::{DVec2, DVec3};
use tools::haptics::simulated::{Change, Path, SimulatedHand, World};
use tools::haptics::{Obstacle, Pose, ServoOptions, Workspace};

use super::common::{Bumps, Check, Edge, HalfSpace, Loop, Sheet, proxy};

fn of(x: f64, z: f64) -> DVec3 {
    DVec3::new(x, 0.0, z)
}

fn served(path: Path, seconds: f64, stiffness: f64, obstacle: impl Obstacle + 'static) -> Check {
    let setup = Loop {
        stiffness,
        ..Loop::new(SimulatedHand::light(path), seconds)
    };
    setup.serve(obstacle, |k| Box::new(proxy(2.0, k)))
}

#[test]
fn what_is_sent_keeps_to_the_slew_limit() {
    let hit = Path::straight([(0.1, of(0.0, 15.0)), (0.154, of(0.0, -12.0))]);
    let slide = |z| Path::straight([(0.0, of(-12.0, 16.0)), (0.2, of(-12.0, z)), (0.44, of(12.0, z))]);
    let bumps = Bumps {
        amplitude: 1.2,
        waves: DVec2::new(4.0, 7.0),
    };
    let over = Path::straight([
        (0.0, of(0.0, 6.0)),
        (0.2, of(0.0, -1.0)),
        (0.5, DVec3::new(40.0, 20.0, -1.0)),
        (0.8, of(0.0, -1.0)),
    ]);
    let edge = |opening: f64| Edge {
        half: (0.5 * opening).to_radians(),
    };
    let checks = [
        ("sheet", served(hit.clone(), 1.5, 500.0, Sheet { thickness: 1.0 })),
        ("sheet, stiff", served(hit, 1.5, 1500.0, Sheet { thickness: 1.0 })),
        ("edge of 90°", served(slide(-3.0), 1.0, 500.0, edge(90.0))),
        ("edge of 30°", served(slide(-3.0), 1.0, 500.0, edge(30.0))),
        ("bumps", served(over, 1.2, 500.0, bumps)),
    ];
    for (name, check) in checks {
        check.assert(
            name,
            &[
                ("it is felt", check.measures.force > 0.8),
                ("P2", check.is_passive()),
                ("P3", check.is_slewed()),
                ("P4", check.stays_out()),
            ],
        );
    }
}

/// What is wished may be too stiff for the delay; what is granted is not.
#[test]
fn a_stiffness_that_the_device_cannot_hold_is_not_granted() {
    for delay in [0.0, 2e-3, 10e-3] {
        let path = Path::straight([(0.1, of(0.0, 14.0)), (0.3, of(0.0, -4.0))]);
        let mut setup = Loop::new(SimulatedHand::light(path), 4.0);
        setup.device.delay = delay;
        let options = ServoOptions {
            stiffness: 20_000.0,
            is_bound: true,
            ..setup.served()
        };
        let mut rig = setup.rig(World::still(HalfSpace::floor(0.0)), options, |k| {
            Box::new(proxy(2.0, k))
        });
        setup.stiffness = rig.drive.granted().stiffness;
        assert!(setup.stiffness <= setup.device.stable_stiffness(4.0));
        let check = setup.check(rig.run(setup.seconds), &Workspace::default());
        check.assert(
            &format!("{} N/m granted at {delay} s", setup.stiffness),
            &[
                ("pressed", check.measures.steady.z > 0.1),
                ("P1", check.rests()),
                ("P2", check.is_passive()),
                ("P3", check.is_slewed()),
            ],
        );
    }
}

/// S10: while no tick comes the last force is held for 2 ms and is gone after 5; what follows is a small step from there.
#[test]
fn a_missing_tick_fades_the_force() {
    let path = Path::smooth([(0.1, of(0.0, 14.0)), (0.6, of(0.0, -4.0))]);
    let mut setup = Loop::new(SimulatedHand::light(path), 3.0);
    setup.timing.stalls = vec![(1.2, 8e-3), (1.6, 4e-3), (2.0, 12e-3)];
    let check = setup.serve(HalfSpace::floor(0.0), |k| Box::new(proxy(2.0, k)));
    for &(at, long) in &setup.timing.stalls {
        let stalled = check
            .trace
            .ticks
            .iter()
            .position(|t| t.time >= at - 1e-9)
            .expect("in time");
        let (during, after) = (&check.trace.ticks[stalled], &check.trace.ticks[stalled + 1]);
        assert!((during.dt - long).abs() < 1e-9 && during.force.z > 1.0);
        let left = ((5e-3 - long) / 3e-3).clamp(0.0, 1.0) * during.force;
        assert!(
            (during.applied - left).length() < 1e-2,
            "{} left after {long} s",
            during.applied
        );
        let step = (after.force - during.applied).length();
        assert!(step <= 0.25 + 1e-9, "{step} N when it goes on");
    }
    check.assert(
        "stalls",
        &[("P1", check.trace.last(0.5).iter().all(|t| t.force.z > 1.0))],
    );
}

/// S12: armed inside the solid there is no force; outside it comes over two seconds.
#[test]
fn a_tool_that_is_armed_inside_gets_its_force_slowly() {
    let path = Path::smooth([
        (0.5, of(0.0, -8.0)),
        (1.0, of(0.0, 6.0)),
        (1.2, of(0.0, 6.0)),
        (1.7, of(0.0, -4.0)),
    ]);
    let setup = Loop::new(SimulatedHand::light(path), 5.0);
    let mut options = setup.served();
    options.gates.ramp = 2.0;
    let mut rig = setup.rig(World::still(HalfSpace::floor(0.0)), options, |k| {
        Box::new(proxy(2.0, k))
    });
    let check = setup.check(rig.run(setup.seconds), &Workspace::default());
    let ticks = &check.trace.ticks;
    let clear = ticks
        .iter()
        .position(|t| t.read.at.z >= 2.0)
        .expect("it comes out");
    assert!(clear > 500 && ticks[..clear].iter().all(|t| t.force == DVec3::ZERO));
    // The share of the wished force that is sent rises over two seconds.
    let since = ticks[clear].time;
    for t in &ticks[clear..] {
        let wished = 0.5 * (t.proxy.at - t.read.at).length();
        let most = ((t.time - since) / 2.0).min(1.0) * wished + 1e-2;
        assert!(
            t.force.length() <= most,
            "{} of {wished} N at {} s",
            t.force.length(),
            t.time
        );
    }
    check.assert(
        "armed inside",
        &[
            ("pressed later", check.measures.steady.z > 1.0),
            ("P1", check.rests()),
            ("P3", check.is_slewed()),
        ],
    );
}

/// A simulation that is not heard of for half a second and more: the force fades, and what comes back gives the hand no energy.
#[test]
fn what_comes_back_after_a_long_stall_gives_no_energy() {
    for silent in [0.45, 0.52, 0.55, 0.58, 0.62, 0.7, 1.0, 1.7] {
        let path = Path::smooth([(0.1, of(0.0, 14.0)), (0.3, of(0.0, -4.0))]);
        let setup = Loop::new(SimulatedHand::light(path), 4.0);
        let start = Pose::at(of(0.0, 14.0));
        let floor = || std::sync::Arc::new(HalfSpace::floor(0.0));
        let world = World::changing(1.0 / silent, Change::Steps, &start, |_, _| floor());
        let mut rig = setup.rig(world, setup.served(), |k| Box::new(proxy(2.0, k)));
        let check = setup.check(rig.run(setup.seconds), &Workspace::default());
        println!(
            "{silent} s: {} J, {} N",
            check.measures.returned, check.measures.force
        );
        check.assert(
            &format!("{silent} s without a word"),
            &[
                ("pressed", check.measures.force > 1.0),
                ("P2", check.is_passive()),
                ("P3", check.is_slewed()),
            ],
        );
    }
}
