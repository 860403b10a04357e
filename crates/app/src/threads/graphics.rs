//! The graphics thread, until there is a window: it looks at what is shown, and whether it is whole.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use exchange::Reader;

use super::clock::Metronome;
use super::shown::Shown;

/// Time from picture to picture.
const FRAME: Duration = Duration::from_nanos(16_666_667);

/// What the graphics thread tells at its end.
#[derive(Clone, Debug, Default)]
pub struct GraphicsReport {
    /// Pictures.
    pub frames: u64,
    /// Snapshots seen.
    pub snapshots: u64,
    /// Snapshots that were not whole, or older than one before.
    pub torn: u64,
}

/// Looks at 60 Hz until it is to stop.
pub fn run(mut shown: Reader<Shown>, stop: &AtomicBool) -> GraphicsReport {
    let mut report = GraphicsReport::default();
    let mut metronome = Metronome::new(FRAME);
    let mut last = 0;
    while !stop.load(Ordering::Relaxed) {
        metronome.wait();
        report.frames += 1;
        if shown.refresh() {
            let seen = shown.get();
            report.snapshots += 1;
            report.torn += u64::from(!seen.is_whole() || seen.sequence <= last);
            last = seen.sequence;
        }
    }
    report
}
