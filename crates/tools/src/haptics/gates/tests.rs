use glam::DVec3;

use super::super::{Abilities, Contact, DeviceError, Pose, Reading};
use super::*;

const DT: f64 = 1e-3;

/// Like a small desk device, but for its friction.
fn abilities() -> Abilities {
    Abilities {
        name: "a device".into(),
        force: 3.3,
        continuous_force: 0.0,
        torque: 100.0,
        damping: 0.3,
        stiffness: f64::INFINITY,
        resolution: 0.0,
        period: 1e-3,
        delay: 0.0,
        reach: 80.0,
    }
}

fn reading(at: DVec3, age: f64) -> Reading {
    Reading {
        pose: Pose::at(at),
        buttons: 0,
        age,
    }
}

/// Gates that are told a hand that rests unless it is said to move.
struct Rig {
    gates: Gates,
    at: DVec3,
    heartbeat: f64,
}

impl Rig {
    fn new(abilities: &Abilities, options: GateOptions) -> Self {
        Self {
            gates: Gates::new(abilities, 500.0, options).unwrap(),
            at: DVec3::ZERO,
            heartbeat: 0.0,
        }
    }

    /// Armed, and after the ramp.
    fn live(abilities: &Abilities, options: GateOptions) -> Self {
        let mut rig = Self::new(abilities, options);
        rig.gates.arm();
        for _ in 0..2100 {
            rig.tick(DVec3::ZERO, DT);
        }
        assert_eq!(rig.gates.stage(), Stage::Live);
        rig
    }

    fn tick(&mut self, wished: DVec3, dt: f64) -> DVec3 {
        self.told(Ok(&reading(self.at, 0.0)), wished, dt)
    }

    fn told(&mut self, told: Result<&Reading, &DeviceError>, wished: DVec3, dt: f64) -> DVec3 {
        let wished = Wrench {
            force: wished,
            torque: DVec3::ZERO,
        };
        match self.gates.admit(told, dt) {
            Some(_) => self.gates.pass(wished, Contact::Slides, self.heartbeat, dt).force,
            None => {
                self.gates.shut();
                self.gates.sent().force
            }
        }
    }

    /// Live, with a force of 3 N on the hand.
    fn pushing() -> Self {
        let mut rig = Self::live(&abilities(), GateOptions::default());
        for _ in 0..20 {
            rig.tick(3.0 * DVec3::X, DT);
        }
        assert_eq!(rig.gates.sent().force, 3.0 * DVec3::X);
        rig
    }

    /// Asserts that there is no force, for this reason, until somebody arms; then it comes back by the whole way.
    fn assert_latched(&mut self, why: Trip) {
        assert_eq!(self.gates.sent(), Wrench::ZERO);
        assert_eq!(self.gates.stage(), Stage::Tripped(why));
        for _ in 0..5000 {
            assert_eq!(self.tick(3.0 * DVec3::X, DT), DVec3::ZERO);
            assert_eq!(self.gates.status().trip(), Some(why));
        }
        self.gates.arm();
        for _ in 0..100 {
            assert_eq!(
                self.tick(3.0 * DVec3::X, DT),
                DVec3::ZERO,
                "the wished force is not small"
            );
        }
        for _ in 0..10 {
            self.tick(DVec3::ZERO, DT);
        }
        let first = self.tick(3.0 * DVec3::X, DT).x;
        assert!(first > 0.0 && first < 0.1, "the ramp begins with {first}");
    }
}

#[test]
fn a_force_comes_only_armed_told_small_and_by_the_ramp() {
    let mut rig = Rig::new(&abilities(), GateOptions::default());
    let push = 2.0 * DVec3::Y;
    for _ in 0..10 {
        assert_eq!(rig.tick(push, DT), DVec3::ZERO);
    }
    assert_eq!(rig.gates.stage(), Stage::Disarmed);
    rig.gates.arm();
    let silent = DeviceError::Silent("it".into());
    for _ in 0..10 {
        assert_eq!(rig.told(Err(&silent), DVec3::ZERO, DT), DVec3::ZERO);
    }
    assert_eq!(rig.gates.stage(), Stage::Homing);
    for _ in 0..10 {
        assert_eq!(rig.tick(push, DT), DVec3::ZERO);
    }
    // Four small ticks and a large one: it begins to count anew.
    for _ in 0..4 {
        assert_eq!(rig.tick(0.1 * push / 2.0, DT), DVec3::ZERO);
    }
    rig.tick(push, DT);
    assert_eq!(rig.gates.stage(), Stage::Waiting { ticks: 0 });
    for _ in 0..5 {
        assert_eq!(rig.tick(0.1 * push / 2.0, DT), DVec3::ZERO);
    }
    assert_eq!(rig.gates.stage(), Stage::Ramping { time: 0.0 });
    for tick in 1..=2100 {
        let force = rig.tick(push, DT);
        let share = f64::min(tick as f64 / 2000.0, 1.0);
        assert!((force - share * push).length() < 1e-9, "tick {tick}: {force}");
    }
    assert!(rig.gates.status().is_live());
    rig.gates.disarm();
    assert_eq!(rig.tick(push, DT), DVec3::ZERO);
}

#[test]
fn inside_the_solid_it_waits_even_without_force() {
    let mut rig = Rig::new(&abilities(), GateOptions::default());
    rig.gates.arm();
    for _ in 0..50 {
        rig.gates.admit(Ok(&reading(DVec3::ZERO, 0.0)), DT);
        rig.gates.pass(Wrench::ZERO, Contact::Inside, 0.0, DT);
    }
    assert_eq!(rig.gates.stage(), Stage::Waiting { ticks: 0 });
}

#[test]
fn a_force_is_shortened_and_not_turned() {
    let mut rig = Rig::live(&abilities(), GateOptions::default());
    let push = DVec3::new(20.0, -12.0, 5.0);
    for _ in 0..50 {
        rig.tick(push, DT);
    }
    let sent = rig.gates.sent().force;
    assert!((sent.length() - 3.3).abs() < 1e-12);
    assert!((sent.normalize() - push.normalize()).length() < 1e-12);
    assert!(rig.gates.status().has(Status::CLAMPED));
    let gentle = GateOptions {
        force: 1.5,
        ..GateOptions::default()
    };
    let mut rig = Rig::live(&abilities(), gentle);
    for _ in 0..50 {
        rig.tick(push, DT);
    }
    assert!((rig.gates.sent().force.length() - 1.5).abs() < 1e-12);
}

#[test]
fn a_step_of_force_becomes_a_slope() {
    let mut rig = Rig::live(&abilities(), GateOptions::default());
    for tick in 1..=12 {
        assert!((rig.tick(3.0 * DVec3::X, DT).x - 0.25 * tick as f64).abs() < 1e-12);
        assert_eq!(rig.gates.status().has(Status::SLEWED), tick < 12);
    }
    // Through nothing to the other side: 6 N of way.
    let to = (0..24).map(|_| rig.tick(-3.0 * DVec3::X, DT)).last();
    assert!((to.unwrap() + 3.0 * DVec3::X).length() < 1e-12);
}

#[test]
fn whatever_is_wished_neither_the_limit_nor_the_slew_is_exceeded() {
    let quantised = Abilities {
        resolution: 0.055,
        continuous_force: 0.88,
        ..abilities()
    };
    let mut rig = Rig::live(&quantised, GateOptions::default());
    let mut seed = 7_u64;
    let mut random = || {
        seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let mut damped = 0;
    for _ in 0..50_000 {
        let was = rig.gates.sent().force;
        let wished = 20.0 * DVec3::new(random(), random(), random());
        // The hand goes where it is pushed, so that energy comes out, and shakes.
        rig.at += 0.02 * was + 0.3 * DVec3::new(random(), random(), random());
        let sent = rig.tick(wished, DT);
        assert_eq!(rig.gates.stage(), Stage::Live);
        // The limit of a warm device sinks, and the force after it.
        assert!(sent.length() <= 3.3 + 1e-9 && (sent - was).length() <= 0.25 + 1e-9);
        damped += usize::from(rig.gates.status().has(Status::PASSIVITY));
    }
    assert!(damped > 1000, "{damped}");
}

#[test]
fn a_pose_that_is_no_number_takes_the_force_away_at_once() {
    for bad in [f64::NAN, f64::INFINITY] {
        let mut rig = Rig::pushing();
        let told = reading(DVec3::new(0.0, bad, 0.0), 0.0);
        assert_eq!(rig.told(Ok(&told), 3.0 * DVec3::X, DT), DVec3::ZERO);
        rig.assert_latched(Trip::NotFinite);
    }
}

#[test]
fn a_wished_force_that_is_no_number_takes_the_force_away_at_once() {
    let mut rig = Rig::pushing();
    assert_eq!(rig.tick(DVec3::new(f64::NAN, 0.0, 0.0), DT), DVec3::ZERO);
    rig.assert_latched(Trip::NotFinite);
    let mut rig = Rig::pushing();
    rig.heartbeat = f64::NAN;
    assert_eq!(rig.tick(3.0 * DVec3::X, DT), DVec3::ZERO);
    assert_eq!(rig.gates.stage(), Stage::Tripped(Trip::NotFinite));
}

#[test]
fn a_jump_takes_the_force_away_at_once() {
    let mut rig = Rig::pushing();
    rig.at = 100.0 * DVec3::Z;
    assert_eq!(rig.tick(3.0 * DVec3::X, DT), DVec3::ZERO);
    rig.assert_latched(Trip::TooFast);
}

#[test]
fn a_hand_may_move_at_its_limit_and_not_above() {
    let counted = |x: f64| (x / 0.055).round() * 0.055;
    for (speed, is_allowed) in [(0.95, true), (1.05, false)] {
        let mut rig = Rig::pushing();
        for tick in 0..100 {
            rig.at = counted(speed * tick as f64) * DVec3::X;
            rig.tick(3.0 * DVec3::X, DT);
        }
        assert_eq!(rig.gates.stage() == Stage::Live, is_allowed, "{speed} m/s");
    }
    let mut rig = Rig::pushing();
    for tick in 0..50 {
        rig.at = 2.0 * tick as f64 * DVec3::X;
        rig.tick(3.0 * DVec3::X, DT);
    }
    rig.assert_latched(Trip::TooFast);
}

#[test]
fn a_pose_that_stays_old_is_counted_and_then_takes_the_force_away() {
    let mut rig = Rig::pushing();
    let mut last = 0.0;
    for tick in 1..=10 {
        last = 1e-3 * f64::from(tick);
        let force = rig.told(Ok(&reading(DVec3::ZERO, last)), 3.0 * DVec3::X, DT);
        assert_eq!(force, 3.0 * DVec3::X, "{last} s");
    }
    assert_eq!(rig.gates.counts().0, 8, "3 to 10 ms");
    let old = reading(DVec3::ZERO, last + 1e-4);
    assert_eq!(rig.told(Ok(&old), 3.0 * DVec3::X, DT), DVec3::ZERO);
    rig.assert_latched(Trip::Stale);
}

#[test]
fn a_slow_device_may_be_old_for_three_periods() {
    let slow = Abilities {
        period: 16e-3,
        ..abilities()
    };
    let mut rig = Rig::live(&slow, GateOptions::default());
    for age in [1e-3, 16e-3, 30e-3, 47e-3] {
        rig.told(Ok(&reading(DVec3::ZERO, age)), DVec3::X, DT);
        assert_eq!(rig.gates.stage(), Stage::Live);
    }
    assert_eq!(rig.gates.counts().0, 1);
    rig.told(Ok(&reading(DVec3::ZERO, 49e-3)), DVec3::X, DT);
    rig.assert_latched(Trip::Stale);
}

#[test]
fn a_slow_device_is_not_fast_because_its_poses_come_seldom() {
    let slow = Abilities {
        period: 16e-3,
        ..abilities()
    };
    let mut rig = Rig::live(&slow, GateOptions::default());
    for tick in 0..640 {
        // 0.5 m/s: 8 mm from pose to pose.
        let (pose, age) = (tick / 16, f64::from(tick % 16) * 1e-3);
        rig.told(Ok(&reading(8.0 * f64::from(pose) * DVec3::X, age)), DVec3::X, DT);
    }
    assert_eq!(rig.gates.stage(), Stage::Live);
    assert!((rig.gates.motion.velocity() - 0.5 * DVec3::X).length() < 1e-9);
}

#[test]
fn a_device_that_is_gone_a_silent_one_and_a_writer_that_stalls_take_the_force_away() {
    for (error, why) in [
        (DeviceError::Gone("it".into()), Trip::Gone),
        (DeviceError::Silent("it".into()), Trip::Stale),
    ] {
        let mut rig = Rig::pushing();
        assert_eq!(rig.told(Err(&error), 3.0 * DVec3::X, DT), DVec3::ZERO);
        rig.assert_latched(why);
    }
    let mut rig = Rig::pushing();
    rig.gates.trip(Trip::Writer);
    assert_eq!(rig.gates.sent(), Wrench::ZERO);
    rig.assert_latched(Trip::Writer);
}

#[test]
fn a_clock_that_stands_takes_the_force_away() {
    for bad in [0.0, -1e-3, f64::NAN] {
        let mut rig = Rig::pushing();
        assert_eq!(rig.tick(3.0 * DVec3::X, bad), DVec3::ZERO);
        rig.assert_latched(Trip::Clock);
    }
}

#[test]
fn the_first_reason_is_told_and_without_arming_there_is_none() {
    let mut rig = Rig::pushing();
    rig.gates.trip(Trip::Writer);
    rig.told(Err(&DeviceError::Gone("it".into())), DVec3::X, DT);
    assert_eq!(rig.gates.stage(), Stage::Tripped(Trip::Writer));
    let mut rig = Rig::new(&abilities(), GateOptions::default());
    rig.tick(DVec3::new(f64::NAN, 0.0, 0.0), DT);
    assert_eq!(rig.gates.stage(), Stage::Disarmed);
}

#[test]
fn the_force_fades_while_the_simulation_is_not_heard_of_and_comes_back() {
    let mut rig = Rig::pushing();
    rig.heartbeat = 0.5;
    for _ in 0..1000 {
        assert_eq!(rig.tick(3.0 * DVec3::X, DT), 3.0 * DVec3::X);
    }
    rig.heartbeat = 0.501;
    let mut was = 3.0;
    for tick in 1..=100 {
        let force = rig.tick(3.0 * DVec3::X, DT).x;
        assert!((was - force - 0.03).abs() < 1e-9, "tick {tick}: {force}");
        was = force;
    }
    for _ in 0..1000 {
        assert!(rig.tick(3.0 * DVec3::X, DT).x.abs() < 1e-9);
    }
    assert_eq!(rig.gates.stage(), Stage::Live, "it is no fault");
    rig.heartbeat = 0.0;
    was = 0.0;
    for _ in 0..101 {
        let force = rig.tick(3.0 * DVec3::X, DT).x;
        assert!(force - was < 0.03 + 1e-9);
        was = force;
    }
    assert_eq!(was, 3.0);
}

#[test]
fn after_a_stall_the_force_goes_on_from_what_the_hand_still_feels() {
    assert_eq!(
        [held(0.0), held(2e-3), held(5e-3), held(1.0)],
        [1.0, 1.0, 0.0, 0.0]
    );
    for stall in [1.5e-3, 2e-3, 3e-3, 4e-3, 5e-3, 8e-3, 0.1] {
        let mut rig = Rig::pushing();
        let left = 3.0 * held(stall);
        let force = rig.tick(3.0 * DVec3::X, stall).x;
        assert!(
            (force - f64::min(3.0, left + 0.25)).abs() < 1e-9,
            "{stall} s: {force}"
        );
        assert_eq!(rig.gates.counts().1, u64::from(stall > 2e-3));
        for _ in 0..13 {
            rig.tick(3.0 * DVec3::X, DT);
        }
        assert_eq!(rig.gates.sent().force.x, 3.0);
    }
}

#[test]
fn a_minute_at_full_force_ends_below_the_continuous_one_without_a_step() {
    let warm = Abilities {
        continuous_force: 0.88,
        ..abilities()
    };
    let mut rig = Rig::live(&warm, GateOptions::default());
    for _ in 0..14 {
        rig.tick(5.0 * DVec3::X, DT);
    }
    let mut was = rig.gates.sent().force.x;
    let (mut whole, mut largest_step) = (0, 0.0_f64);
    for _ in 0..60_000 {
        let force = rig.tick(5.0 * DVec3::X, DT).x;
        largest_step = largest_step.max((force - was).abs());
        was = force;
        whole += usize::from(force == 3.3);
    }
    assert!(was < 0.88 && was > 0.8, "{was}");
    assert!(largest_step < 0.005, "{largest_step}");
    assert!(whole > 900, "the whole force for {whole} ms");
    assert!(rig.gates.status().has(Status::WARM));
    // At rest it cools.
    for _ in 0..60_000 {
        rig.tick(DVec3::ZERO, DT);
    }
    assert_eq!(rig.gates.limit(), 3.3);
}

/// Energy that the hand got, J, from a spring of 300 N/m that pushes back with `back` N/m, on twenty ways of 5 mm, in and out
/// while the hand stays in it.
fn got_from_spring(rig: &mut Rig, back: f64) -> f64 {
    let mut got = 0.0;
    let x_at = |tick: i32| 4.0 - 2.5 * libm::cos(f64::from(tick) * 2.0 * std::f64::consts::PI / 500.0);
    for tick in 0..10_000 {
        let sent = rig.gates.sent().force.x;
        let (was, now) = (rig.at.x, x_at(tick));
        if tick > 500 {
            got += sent * (now - was) * 1e-3;
        }
        rig.at.x = now;
        let stiffness = if now > was { 300.0 } else { back };
        rig.tick(DVec3::X * (-stiffness * now * 1e-3), DT);
    }
    got
}

#[test]
fn a_spring_that_gives_more_than_it_took_is_damped() {
    let blind = GateOptions {
        passive: 0.0,
        ..GateOptions::default()
    };
    let frictionless = Abilities {
        damping: 0.0,
        ..abilities()
    };
    let given = got_from_spring(&mut Rig::live(&frictionless, blind), 320.0);
    let mut rig = Rig::live(&frictionless, GateOptions::default());
    let kept = got_from_spring(&mut rig, 320.0);
    // ½ · 20 N/m · (6.5² − 1.5²) mm² a round; what the hand put in first is its own.
    assert!(given > 7e-3, "the spring gives {given} J");
    assert!(kept < 1.5e-3, "{kept} J come through");
    assert!(rig.gates.energy() > -1e-3);
}

#[test]
fn a_spring_that_gives_what_it_took_is_left_alone() {
    let mut rig = Rig::live(&abilities(), GateOptions::default());
    let mut is_damped = false;
    let x_at = |tick: i32| 4.0 - 4.0 * libm::cos(f64::from(tick) * 2.0 * std::f64::consts::PI / 200.0);
    for tick in 0..10_000 {
        rig.at.x = x_at(tick);
        rig.tick(DVec3::X * (-0.3 * rig.at.x), DT);
        is_damped |= rig.gates.status().has(Status::PASSIVITY);
    }
    assert!(!is_damped);
}

#[test]
fn the_observer_counts_what_is_sent_and_not_what_is_wished() {
    // What is wished gives energy; what is left of it after the clamp is the same on both ways, and gives none.
    let clamped = GateOptions {
        force: 0.5,
        ..GateOptions::default()
    };
    let mut rig = Rig::live(&abilities(), clamped);
    let mut is_damped = false;
    for tick in 0..10_000 {
        let was = rig.at.x;
        rig.at.x = 6.0 - 2.0 * libm::cos(f64::from(tick) * 2.0 * std::f64::consts::PI / 500.0);
        let stiffness = if rig.at.x > was { 0.3 } else { 0.6 };
        rig.tick(DVec3::X * (-stiffness * rig.at.x), DT);
        is_damped |= rig.gates.status().has(Status::PASSIVITY);
    }
    assert!(!is_damped);
}

#[test]
fn the_observer_of_a_late_device_counts_what_the_hand_feels() {
    let energy = |delay: f64| {
        let late = Abilities {
            delay,
            damping: 0.0,
            ..abilities()
        };
        let options = GateOptions {
            passive: 0.0,
            ..GateOptions::default()
        };
        let mut rig = Rig::live(&late, options);
        let mut least = 0.0_f64;
        for tick in 0..2_000 {
            rig.at.x = 4.0 - 2.0 * libm::cos(f64::from(tick) * 2.0 * std::f64::consts::PI / 200.0);
            rig.tick(DVec3::X * (-0.5 * rig.at.x), DT);
            least = least.min(rig.gates.energy());
        }
        least
    };
    // πKA² sin ωτ a round, with 5 ms of delay and half a millisecond of holding.
    let round = std::f64::consts::PI * 500.0 * 4e-6 * libm::sin(2.0 * std::f64::consts::PI * 5.0 * 5.5e-3);
    let counted = energy(5e-3);
    assert!(
        counted < -8.0 * round && counted > -11.0 * round,
        "{counted}, a round {round}"
    );
    assert!(energy(0.0) > -1.5e-3);
}

#[test]
fn settings_that_make_no_sense_are_refused_with_their_value() {
    let bad = GateOptions {
        slew: f64::NAN,
        ..GateOptions::default()
    };
    let why = Gates::new(&abilities(), 500.0, bad).unwrap_err().to_string();
    assert!(
        why.contains("step of the force") && why.contains("NaN") && why.contains("above 0"),
        "{why}"
    );
}
