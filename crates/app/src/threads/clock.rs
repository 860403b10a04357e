//! Time as threads see it.

use std::time::Duration;

use rustix::io::Errno;
use rustix::thread::clock_nanosleep_absolute;
use rustix::time::{ClockId, Timespec, clock_gettime};

/// Time since some moment, the same for all threads.
pub fn now() -> Duration {
    duration(clock_gettime(ClockId::Monotonic))
}

/// Time that the processor has spent on this thread.
pub fn thread_time() -> Duration {
    duration(clock_gettime(ClockId::ThreadCPUTime))
}

fn duration(t: Timespec) -> Duration {
    Duration::new(t.tv_sec as u64, t.tv_nsec as u32)
}

/// Sleeps until a moment of [`now`].
pub fn sleep_until(moment: Duration) {
    let request = Timespec {
        tv_sec: moment.as_secs() as i64,
        tv_nsec: i64::from(moment.subsec_nanos()),
    };
    // A signal ends a sleep early; nothing else is wrong with these arguments.
    while clock_nanosleep_absolute(ClockId::Monotonic, &request) == Err(Errno::INTR) {}
}

/// Beats at whole multiples of a period after its first moment, however long is done between them.
#[derive(Debug)]
pub struct Metronome {
    period: Duration,
    next: Duration,
}

/// What a beat came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Beat {
    /// When it came.
    pub at: Duration,
    /// Beats that were left out because their time had passed, a whole period and more.
    pub missed: u64,
}

impl Metronome {
    /// Beats from now on.
    pub fn new(period: Duration) -> Self {
        Self { period, next: now() }
    }

    /// Waits for the next beat. Beats whose time has passed are counted and left out: who comes late does not hurry after.
    pub fn wait(&mut self) -> Beat {
        self.next += self.period;
        sleep_until(self.next);
        let at = now();
        let late = at.saturating_sub(self.next);
        let missed = (late.as_nanos() / self.period.as_nanos()) as u32;
        self.next += self.period * missed;
        Beat {
            at,
            missed: u64::from(missed),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_comes_late_leaves_beats_out_and_keeps_the_beat() {
        let period = Duration::from_millis(2);
        let mut metronome = Metronome::new(period);
        let start = metronome.next;
        std::thread::sleep(Duration::from_millis(15));
        let first = metronome.wait();
        assert!(first.missed >= 6, "{first:?}");
        let mut beats = 1 + first.missed;
        for _ in 0..5 {
            let beat = metronome.wait();
            beats += 1 + beat.missed;
            let due = start + period * beats as u32;
            assert!(beat.at >= due && beat.at < due + period, "{beat:?}");
        }
    }
}
