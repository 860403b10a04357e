//! Links in virtual time: a device in memory, and the three threads as steps of a millisecond each.

use glam::DVec3;
use tools::haptics::{Device, DeviceError};

use super::*;
use crate::devices::clock::Clock;
use crate::devices::fake::Fake;
use crate::devices::rawhid::report::{LENGTH, Reports, with_currents};
use crate::devices::rawhid::variants::Variant;
use crate::devices::rawhid::{Arm, Board};
use std::sync::Arc;

/// A force board and all that drives it.
struct Rig {
    clock: Clock,
    board: Fake,
    link: Arc<Link>,
    reader: Reader,
    writer: Writer,
    device: Linked,
    now: f64,
}

/// A report of an arm whose third motor has turned a quarter, the place where it is calibrated.
fn pose(third: i16) -> [u8; LENGTH] {
    let mut report = [0; LENGTH];
    report[4..6].copy_from_slice(&third.to_le_bytes());
    report
}

impl Rig {
    fn new() -> Self {
        let (clock, link) = (Clock::standing(), Arc::<Link>::default());
        let board = Fake::new(clock.clone());
        let arm = Variant::named("woodenhaptics-2019").unwrap();
        let reader = Reader::new(
            Box::new(board.clone()),
            Box::new(Reports::default()),
            link.clone(),
            clock.clone(),
        );
        let writer = Writer::new(
            Box::new(board.clone()),
            Box::new(Board::new(arm, true)),
            link.clone(),
            clock.clone(),
            0.001,
        );
        let device = Linked::new(Box::new(Arm::new(arm, false)), link.clone(), clock.clone());
        Self {
            clock,
            board,
            link,
            reader,
            writer,
            device,
            now: 0.0,
        }
    }

    /// A tick of all three. What the haptic thread got, and what it may send.
    fn tick(&mut self, force: DVec3) -> Result<(), DeviceError> {
        self.now += 1e-3;
        self.clock.set(self.now);
        self.reader.step();
        let done = self
            .device
            .read()
            .and_then(|_| self.device.send(force, DVec3::ZERO));
        self.writer.step();
        done
    }

    /// A stroke under way: the board tells and pushes.
    fn in_stroke() -> Self {
        let mut rig = Self::new();
        for ms in 1..=50 {
            rig.board.say(f64::from(ms) * 1e-3, &pose(6000));
        }
        for _ in 0..50 {
            rig.tick(DVec3::new(0.0, 0.0, 2.0)).unwrap();
        }
        assert!(rig.pushes(), "2 N are currents");
        rig
    }

    /// Whether the last report written asks for a current.
    fn pushes(&self) -> bool {
        self.board
            .written()
            .last()
            .is_some_and(|(_, report)| report != &with_currents([0; 3]))
    }

    /// Seconds from a time to the report that ends the force.
    fn zero_after(&self, from: f64) -> f64 {
        let written = self.board.written();
        let zero = written
            .iter()
            .find(|(at, report)| *at >= from && report == &with_currents([0; 3]));
        zero.expect("a report without force").0 - from
    }
}

#[test]
fn before_the_first_report_there_is_no_pose_and_no_force() {
    let mut rig = Rig::new();
    for _ in 0..20 {
        assert!(matches!(rig.tick(DVec3::Z), Err(DeviceError::Silent(_))));
    }
    // The board speaks when it is spoken to: it gets its zeros all the time.
    let written = rig.board.written();
    assert!(written.len() >= 20 && written.iter().all(|(_, r)| r == &with_currents([0; 3])));
}

#[test]
fn a_pose_is_read_and_a_force_is_sent_in_the_same_millisecond() {
    let mut rig = Rig::in_stroke();
    let reading = rig.device.read().unwrap();
    // The handle of an arm at right angles: 25 mm out of the middle towards the user, and 205 mm up.
    assert!(
        reading.pose.at.distance(DVec3::new(0.0, -25.0, 205.0)) < 1e-9,
        "{}",
        reading.pose.at
    );
    assert_eq!(reading.age, 0.0);
    let (at, report) = rig.board.written().last().unwrap().clone();
    assert!((at - rig.now).abs() < 1e-12);
    // 2 N up over the third link of 245 mm, with a capstan of a twelfth, by 60.3 mN m/A: 677 mA. The second hangs straight down.
    assert_eq!(report[..], with_currents([0, 0, 677]));
    assert_eq!(rig.device.counts().taken, 50);
}

/// Mid-stroke, the plug is pulled: the haptic thread knows at its next tick, and no force is ordered that late.
#[test]
fn unplugged_in_a_stroke_the_force_is_zero_within_10_ms() {
    let mut rig = Rig::in_stroke();
    rig.board.unplug();
    let from = rig.now;
    let mut ticks = 0;
    while rig.tick(DVec3::Z).is_ok() {
        ticks += 1;
    }
    assert!(ticks <= 1 && rig.now - from <= 0.010);
    assert!(matches!(rig.device.read(), Err(DeviceError::Gone(_))));
    assert_eq!(
        rig.device.send(DVec3::Z, DVec3::ZERO),
        Err(DeviceError::Gone("WoodenHaptics 2019".into()))
    );
    let (order, _) = rig.link.order().unwrap();
    assert_eq!(order, Order::default());
    assert!(!rig.reader.step() && !rig.writer.step(), "both threads end");
}

/// The cable still takes reports but brings none.
#[test]
fn a_board_that_falls_silent_is_without_force_within_10_ms() {
    let mut rig = Rig::in_stroke();
    let from = rig.now;
    for _ in 0..12 {
        // Whoever computes forces from an old pose goes on sending them.
        let _ = rig.tick(DVec3::Z);
    }
    let after = rig.zero_after(from + 1e-9);
    assert!(after <= 0.010, "{after}");
    assert!(
        rig.device.read().unwrap().age > 0.010,
        "and who asks is told how old it is"
    );
}

/// The haptic thread hangs while the board goes on telling.
#[test]
fn a_force_that_nobody_asks_for_again_ends_within_10_ms() {
    let mut rig = Rig::in_stroke();
    let from = rig.now;
    for ms in 1..=12 {
        rig.now = from + f64::from(ms) * 1e-3;
        rig.board.say(rig.now, &pose(6000));
        rig.clock.set(rig.now);
        rig.reader.step();
        rig.writer.step();
    }
    let after = rig.zero_after(from + 1e-9);
    assert!(after <= 0.010, "{after}");
}

#[test]
fn writes_that_fail_three_times_are_a_device_that_is_gone() {
    let mut rig = Rig::in_stroke();
    rig.board.stick();
    let from = rig.now;
    while rig.device.read().is_ok() {
        rig.board.say(rig.now, &pose(6000));
        let _ = rig.tick(DVec3::Z);
        assert!(rig.now - from < 0.010);
    }
    assert_eq!(rig.device.counts().failed, 3);
}

#[test]
fn a_force_that_is_no_number_is_no_force() {
    let mut rig = Rig::in_stroke();
    rig.board.say(rig.now, &pose(6000));
    rig.tick(DVec3::new(f64::NAN, 0.0, 2.0)).unwrap();
    assert!(!rig.pushes());
}

#[test]
fn reports_that_are_none_are_counted_and_change_nothing() {
    let mut rig = Rig::in_stroke();
    let before = rig.device.read().unwrap().pose;
    for wrong in [&[][..], &[1; 63], &[1; 65], &[1; 1024], &[1; 4000]] {
        rig.board.say(rig.now, wrong);
    }
    rig.tick(DVec3::Z).unwrap();
    // An empty one is none at all: the ones behind it come with the next look.
    rig.tick(DVec3::Z).unwrap();
    assert_eq!(rig.device.read().unwrap().pose, before);
    let counts = rig.device.counts();
    assert_eq!((counts.taken, counts.rejected), (50, 4));
}

#[test]
fn the_newest_of_several_reports_counts() {
    let mut rig = Rig::in_stroke();
    for third in [5000, 5500, 5900] {
        rig.board.say(rig.now, &pose(third));
    }
    rig.tick(DVec3::ZERO).unwrap();
    let here = rig.device.read().unwrap().pose;
    rig.board.say(rig.now, &pose(5900));
    rig.tick(DVec3::ZERO).unwrap();
    assert_eq!(rig.device.read().unwrap().pose, here);
    assert_eq!(rig.device.counts().taken, 54);
}

#[test]
fn dropped_or_in_a_panic_the_writer_leaves_no_force() {
    let rig = Rig::in_stroke();
    let (board, writer) = (rig.board.clone(), rig.writer);
    drop(writer);
    assert_eq!(board.written().last().unwrap().1, with_currents([0; 3]));
    let rig = Rig::in_stroke();
    let (board, writer) = (rig.board.clone(), rig.writer);
    let panicked = std::thread::spawn(move || {
        let _writer = writer;
        std::panic::resume_unwind(Box::new("as a panic unwinds"));
    });
    assert!(panicked.join().is_err());
    assert_eq!(board.written().last().unwrap().1, with_currents([0; 3]));
}

/// On threads and by the clock of the machine, as it is used. Only order counts: no time is held against anything.
#[test]
fn on_its_threads_a_device_ends_without_force() {
    let (clock, link) = (Clock::real(), Arc::<Link>::default());
    let board = Fake::new(clock.clone());
    let arm = Variant::named("woodenhaptics-2019").unwrap();
    let reports = Box::new(Reports::default());
    let reader = Reader::new(Box::new(board.clone()), reports, link.clone(), clock.clone());
    let composer = Box::new(Board::new(arm, true));
    let writer = Writer::new(
        Box::new(board.clone()),
        composer,
        link.clone(),
        clock.clone(),
        0.001,
    );
    let mut device = Linked::new(Box::new(Arm::new(arm, false)), link, clock.clone())
        .begin(reader, writer)
        .unwrap();
    let pushes = |(_, report): &(f64, Vec<u8>)| report != &with_currents([0; 3]);
    let mut has_pushed = false;
    while !has_pushed && clock.now() < 20.0 {
        board.say(clock.now(), &pose(6000));
        if device.read().is_ok() {
            device.send(DVec3::Z, DVec3::ZERO).unwrap();
        }
        std::thread::sleep(std::time::Duration::from_micros(500));
        has_pushed = board.written().iter().any(pushes);
    }
    assert!(has_pushed);
    drop(device);
    assert!(!pushes(board.written().last().unwrap()));
}
