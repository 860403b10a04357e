//! The simulation thread.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use document::{DocumentError, State};
use exchange::{Publisher, Reader};
use fitting::Control;
use glam::DVec3;
use tools::haptics::Snapshot;

use super::clock::{now, sleep_until};
use super::hand::Hand;
use super::histogram::Histogram;
use super::sculpting::Sculpting;
use super::shown::Shown;

/// Makes what may be touched of a state, round a place of the scene.
pub type Show = Box<dyn FnMut(&State, DVec3) -> Arc<Snapshot> + Send>;

/// What the simulation has to do with the other threads.
pub struct Links<'a> {
    /// Where the hand is.
    pub hand: Reader<Hand>,
    /// What the haptic thread and the graphics thread see.
    pub shown: [Publisher<Shown>; 2],
    /// When it was last alive, ns of [`now`].
    pub heartbeat: &'a AtomicU64,
    /// Whether to end.
    pub stop: &'a AtomicBool,
}

/// What the simulation thread tells at its end.
#[derive(Clone, Debug, Default)]
pub struct SimulationReport {
    /// Steps.
    pub steps: u64,
    /// Time of a step, by the clock.
    pub step: Histogram,
}

/// Steps with a period, or as fast as it can, until it is to stop; then it ends the stroke that there is.
///
/// # Errors
/// That an edit cannot be written; then it has told the others to stop.
pub fn run(
    sculpting: &mut Sculpting,
    mut show: Show,
    period: Duration,
    mut links: Links,
) -> Result<SimulationReport, DocumentError> {
    let mut report = SimulationReport::default();
    let mut control = Control::default();
    let mut sequence = 0;
    let outcome = loop {
        let start = now();
        links.heartbeat.store(start.as_nanos() as u64, Ordering::Relaxed);
        links.hand.refresh();
        let hand = *links.hand.get();
        if let Err(why) = sculpting.step(&hand, &mut control) {
            break Err(why);
        }
        let at = hand.pose.map_or(DVec3::ZERO, |pose| pose.at);
        let snapshot = show(sculpting.shown(), at);
        sequence += 1;
        let shown = Shown::new(sequence, snapshot, period.as_secs_f64());
        for end in &mut links.shown {
            // What comes back is freed here.
            end.publish(shown.clone());
        }
        report.steps += 1;
        report.step.add(now() - start);
        if links.stop.load(Ordering::Relaxed) {
            break sculpting.end(&mut control).map(drop);
        }
        // Not earlier after a late step: what was shown last is then still on its way.
        sleep_until(now() + period.saturating_sub(now() - start));
    };
    links.stop.store(true, Ordering::Relaxed);
    outcome.map(|()| report)
}
