//! Three threads, weakly synced: haptics, simulation, graphics.
//!
//! Each reads the newest whole snapshot of the others, through [`exchange`], and waits for none. Where the hand is flows one way, what may be
//! touched the other. A simulation that stalls leaves the haptic thread what it showed last; from half a second on the force fades.
//! Whoever starts them is the recorder: it takes the records of ticks from a ring.

pub mod clock;
mod graphics;
pub mod grip;
pub mod hand;
mod haptic;
pub mod histogram;
mod priority;
pub mod rehearsal;
pub mod sculpting;
pub mod shown;
mod simulation;
pub mod touch;

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

use document::DocumentError;
use tools::haptics::{Device, Servo, TickRecord};

use clock::now;
use hand::Hand;
use sculpting::Sculpting;
use shown::Shown;

pub use graphics::GraphicsReport;
pub use haptic::HapticReport;
pub use simulation::{Show, SimulationReport};

/// Records for which there is room: two seconds of them.
const RECORDS: usize = 2048;
/// Time from look to look of the recorder.
const LOOK: Duration = Duration::from_millis(10);

/// What the threads work on.
pub struct Session {
    /// In the hand.
    pub device: Box<dyn Device>,
    /// Between hand and solid.
    pub servo: Servo,
    /// What is worked on.
    pub sculpting: Sculpting,
    /// What may be touched of it.
    pub show: Show,
    /// From tick to tick of the haptic thread, 1 ms at most.
    pub tick: Duration,
    /// From step to step of the simulation.
    pub step: Duration,
}

/// What the threads tell at their end.
#[derive(Clone, Debug)]
pub struct Report {
    /// Of the haptic thread.
    pub haptic: HapticReport,
    /// Of the simulation thread.
    pub simulation: SimulationReport,
    /// Of the graphics thread.
    pub graphics: GraphicsReport,
}

impl Session {
    /// Runs until `goes_on` says no, which is asked some hundred times a second, and tells `keep` of every tick, in order. Gives the document in
    /// the hand back.
    ///
    /// # Errors
    /// That an edit cannot be written. All threads have stopped, and the device is without force.
    ///
    /// # Panics
    /// If a thread panics; the device is without force.
    pub fn run(
        self,
        mut goes_on: impl FnMut() -> bool,
        mut keep: impl FnMut(&TickRecord),
    ) -> Result<(Sculpting, Report), DocumentError> {
        let Self {
            device,
            servo,
            mut sculpting,
            show,
            tick,
            step,
        } = self;
        let stop = AtomicBool::new(false);
        // Until its first step the simulation counts as alive.
        let heartbeat = AtomicU64::new(now().as_nanos() as u64);
        let (hand_out, hand_in) = exchange::latest(Hand::nobody);
        let (touch_out, touch_in) = exchange::latest(Shown::nothing);
        let (sight_out, sight_in) = exchange::latest(Shown::nothing);
        let (records_out, mut records) = rtrb::RingBuffer::new(RECORDS);
        let (stop, heartbeat) = (&stop, &heartbeat);
        let haptic_links = haptic::Links {
            shown: touch_in,
            hand: hand_out,
            records: records_out,
            heartbeat,
            stop,
        };
        let simulation_links = simulation::Links {
            hand: hand_in,
            shown: [touch_out, sight_out],
            heartbeat,
            stop,
        };
        let stroked = &mut sculpting;
        let report = thread::scope(|scope| {
            let named = |name: &str| thread::Builder::new().name(name.into());
            let started = "the system has threads enough";
            let haptic = named("haptics")
                .spawn_scoped(scope, move || haptic::run(device, servo, tick, haptic_links))
                .expect(started);
            let simulation = named("simulation")
                .spawn_scoped(scope, move || {
                    simulation::run(stroked, show, step, simulation_links)
                })
                .expect(started);
            let graphics = named("graphics")
                .spawn_scoped(scope, move || graphics::run(sight_in, stop))
                .expect(started);
            let _stop = StopAtEnd(stop);
            // A thread that ended by itself has failed: its own join tells how.
            while goes_on() && !haptic.is_finished() && !simulation.is_finished() && !graphics.is_finished() {
                thread::sleep(LOOK);
                while let Ok(record) = records.pop() {
                    keep(&record);
                }
            }
            stop.store(true, Ordering::Relaxed);
            let whole = "no thread panics";
            let haptic = haptic.join().expect(whole);
            while let Ok(record) = records.pop() {
                keep(&record);
            }
            let simulation = simulation.join().expect(whole);
            let graphics = graphics.join().expect(whole);
            simulation.map(|simulation| Report {
                haptic,
                simulation,
                graphics,
            })
        })?;
        Ok((sculpting, report))
    }
}

/// Stops all threads when whoever started them goes, also by a panic: else they would be waited for for ever.
struct StopAtEnd<'a>(&'a AtomicBool);

impl Drop for StopAtEnd<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests;
