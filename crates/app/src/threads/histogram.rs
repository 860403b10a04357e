//! Times, counted in classes.

use std::time::Duration;

/// Classes to a doubling: a quantile is at most a sixteenth too large.
const PER_OCTAVE: u32 = 16;
/// Doublings from 1 ns on; the last ends at 18 minutes.
const OCTAVES: u32 = 40;

/// Times, counted in classes that widen with the time. Counting one neither allocates nor waits.
#[derive(Clone, Debug)]
pub struct Histogram {
    counts: Vec<u64>,
    count: u64,
    sum: Duration,
    largest: Duration,
}

impl Default for Histogram {
    fn default() -> Self {
        Self {
            counts: vec![0; (OCTAVES * PER_OCTAVE) as usize],
            count: 0,
            sum: Duration::ZERO,
            largest: Duration::ZERO,
        }
    }
}

impl Histogram {
    /// Counts a time.
    pub fn add(&mut self, time: Duration) {
        self.counts[class(time)] += 1;
        self.count += 1;
        self.sum += time;
        self.largest = self.largest.max(time);
    }

    /// Mean; nothing of none.
    pub fn mean(&self) -> Duration {
        let nanoseconds = self.sum.as_nanos() / u128::from(self.count.max(1));
        Duration::from_nanos(nanoseconds as u64)
    }

    /// The largest.
    pub fn largest(&self) -> Duration {
        self.largest
    }

    /// A time that a share of all does not exceed: the upper end of its class.
    pub fn quantile(&self, share: f64) -> Duration {
        let rank = (share * self.count as f64).ceil() as u64;
        let mut below = 0;
        for (class, count) in self.counts.iter().enumerate() {
            below += count;
            if below >= rank && below > 0 {
                return end(class).min(self.largest);
            }
        }
        Duration::ZERO
    }
}

/// Class of a time: its doubling, and the sixteenth in that.
fn class(time: Duration) -> usize {
    let ns = (time.as_nanos() as u64).max(1);
    let octave = ns.ilog2();
    let part = match octave >= 4 {
        true => (ns >> (octave - 4)) - 16,
        false => (ns << (4 - octave)) - 16,
    };
    let class = octave * PER_OCTAVE + part as u32;
    class.min(OCTAVES * PER_OCTAVE - 1) as usize
}

/// The least time above a class.
fn end(class: usize) -> Duration {
    let (octave, part) = (class as u32 / PER_OCTAVE, class as u64 % u64::from(PER_OCTAVE));
    let ns = (17 + part) as f64 / 16.0 * (1_u64 << octave) as f64;
    Duration::from_nanos(ns.ceil() as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_at_most_a_sixteenth_too_large() {
        let mut times = Histogram::default();
        for n in 1..=100_000 {
            times.add(Duration::from_nanos(n));
        }
        for share in [0.001, 0.01, 0.5, 0.9, 0.99, 0.999, 1.0] {
            let (exact, told) = (share * 1e5, times.quantile(share).as_nanos() as f64);
            assert!(
                told >= exact && told <= exact * 17.0 / 16.0 + 1.0,
                "{share}: {told}"
            );
        }
        assert_eq!(times.count, 100_000);
        assert_eq!(times.mean(), Duration::from_nanos(50_000));
        assert_eq!(times.largest(), Duration::from_nanos(100_000));
        assert_eq!(Histogram::default().quantile(0.5), Duration::ZERO);
        times.add(Duration::from_secs(1 << 40));
        times.add(Duration::ZERO);
    }
}
