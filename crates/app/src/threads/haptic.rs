//! The haptic thread.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use exchange::{Publisher, Reader};
use glam::DVec3;
use rtrb::Producer;
use tools::haptics::gates::Trip;
use tools::haptics::{Device, Servo, TickRecord};

use super::clock::{Metronome, now, thread_time};
use super::hand::Hand;
use super::histogram::Histogram;
use super::priority;
use super::shown::Shown;

/// What the haptic thread has to do with the others: it waits for none of them.
pub struct Links<'a> {
    /// What may be touched.
    pub shown: Reader<Shown>,
    /// Where the hand is.
    pub hand: Publisher<Hand>,
    /// What is kept of ticks.
    pub records: Producer<TickRecord>,
    /// When the simulation was last alive, ns of [`now`].
    pub heartbeat: &'a AtomicU64,
    /// Whether to end.
    pub stop: &'a AtomicBool,
}

/// What the haptic thread tells at its end.
#[derive(Clone, Debug, Default)]
pub struct HapticReport {
    /// What the system said to the wish for a priority.
    pub priority: String,
    /// Ticks that were done.
    pub ticks: u64,
    /// Ticks whose time had passed when their turn came.
    pub missed: u64,
    /// From tick to tick.
    pub period: Histogram,
    /// Time of the processor for a tick, from the pose read to the force sent.
    pub cost: Histogram,
    /// Snapshots that were not whole, or older than one before.
    pub torn: u64,
    /// Snapshots seen.
    pub snapshots: u64,
    /// Records for which there was no room.
    pub lost_records: u64,
    /// Poses that were late and not yet stale, and ticks that came after the last force had begun to fade.
    pub late_poses: u64,
    /// See `late_poses`.
    pub stalls: u64,
    /// Why there was no force at the end, if something took it away.
    pub trip: Option<Trip>,
}

/// Ticks with a period until it is to stop; then the device is left without force, as it is if anything here panics: it is dropped.
pub fn run(
    mut device: Box<dyn Device>,
    mut servo: Servo,
    period: Duration,
    mut links: Links,
) -> HapticReport {
    let mut report = HapticReport {
        priority: priority::ask(),
        ..HapticReport::default()
    };
    servo.arm();
    let mut hand = Hand::nobody();
    let mut seen = now();
    let mut metronome = Metronome::new(period);
    let mut last = now();
    while !links.stop.load(Ordering::Relaxed) {
        let beat = metronome.wait();
        report.missed += beat.missed;
        let elapsed = beat.at - last;
        last = beat.at;
        let told = device.read();
        let start = thread_time();
        if links.shown.refresh() {
            let before = report.snapshots;
            let shown = links.shown.get();
            report.torn += u64::from(shown.sequence <= before);
            report.snapshots = shown.sequence.max(before);
            seen = beat.at;
        }
        let obstacle = links.shown.get().after((beat.at - seen).as_secs_f64());
        let beaten = Duration::from_nanos(links.heartbeat.load(Ordering::Relaxed));
        let heartbeat = beat.at.saturating_sub(beaten).as_secs_f64();
        let tick = servo.tick(told.as_ref(), &obstacle, heartbeat, elapsed.as_secs_f64());
        if device.send(tick.wrench.force, tick.wrench.torque).is_err() {
            servo.trip(Trip::Writer);
        }
        if told.is_ok() {
            hand.press(tick.record.buttons);
            hand.pose = Some(servo.hand());
        }
        hand.proxy = tick.felt.proxy;
        hand.force = tick.felt.force;
        links.hand.publish(hand);
        report.lost_records += u64::from(links.records.push(tick.record).is_err());
        report.cost.add(thread_time() - start);
        report.period.add(elapsed);
        report.ticks += 1;
    }
    // A device that is gone feels nothing anyway.
    let _ = device.send(DVec3::ZERO, DVec3::ZERO);
    (report.late_poses, report.stalls) = servo.gates().counts();
    report.trip = servo.status().trip();
    report
}
