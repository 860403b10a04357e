use std::time::Instant;

use rustix::time::{ClockId, clock_gettime};

/// What the process has spent so far: wall time since [`Cost::start`], processor time and memory since it began.
pub struct Cost {
    start: Instant,
}

impl Cost {
    /// Starts the clock.
    pub fn start() -> Self {
        Self {
            start: Instant::now(),
        }
    }

    /// Wall seconds since the start.
    pub fn seconds(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }
}

/// User and system seconds of all threads of this process, start-up included.
pub fn cpu_seconds() -> f64 {
    let t = clock_gettime(ClockId::ProcessCPUTime);
    t.tv_sec as f64 + t.tv_nsec as f64 * 1e-9
}

/// Largest resident size of this process so far; `None` where the system does not tell.
pub fn peak_rss_bytes() -> Option<u64> {
    status_bytes("VmHWM:")
}

/// The same of another process.
pub fn peak_rss_bytes_of(process: u32) -> Option<u64> {
    bytes_in(&format!("/proc/{process}/status"), "VmHWM:")
}

/// Resident size of this process now; `None` where the system does not tell.
pub fn rss_bytes() -> Option<u64> {
    status_bytes("VmRSS:")
}

/// Writable memory of this process that the system has promised, resident or not; `None` where it does not tell.
pub fn data_bytes() -> Option<u64> {
    status_bytes("VmData:")
}

fn status_bytes(name: &str) -> Option<u64> {
    bytes_in("/proc/self/status", name)
}

/// Reads one size line of a status, which counts in KiB.
fn bytes_in(status: &str, name: &str) -> Option<u64> {
    let status = std::fs::read_to_string(status).ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix(name))?;
    line.split_whitespace()
        .next()?
        .parse::<u64>()
        .ok()
        .map(|kib| kib * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn processor_time_grows_with_work_and_memory_has_a_peak() {
        let before = cpu_seconds();
        let mut x = 1u64;
        while cpu_seconds() - before < 1e-3 {
            x = std::hint::black_box(x.wrapping_mul(6364136223846793005).wrapping_add(1));
        }
        assert!(cpu_seconds() > before);
        // In this order: other tests of this process go on allocating.
        let now = rss_bytes().unwrap();
        assert!(now > 100_000 && peak_rss_bytes().unwrap() >= now);
    }
}
