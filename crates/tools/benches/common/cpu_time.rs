//! Processor time on one core: other processes on the machine change it little, and no thread waits for another.

use criterion::Criterion;
use criterion::measurement::{Measurement, ValueFormatter, WallTime};
use rustix::time::{ClockId, clock_gettime};

pub struct CpuTime;

/// Measures `groups` by it.
pub fn on_one_core(groups: impl FnOnce(&mut Criterion<CpuTime>) + Send) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    pool.expect("a thread").install(|| {
        let seconds = std::time::Duration::from_secs_f64;
        let criterion = Criterion::default().with_measurement(CpuTime);
        let criterion = criterion
            .warm_up_time(seconds(0.3))
            .measurement_time(seconds(1.0));
        let mut criterion = criterion.configure_from_args();
        groups(&mut criterion);
        criterion.final_summary();
    });
}

/// Nanoseconds.
fn now() -> f64 {
    let t = clock_gettime(ClockId::ProcessCPUTime);
    t.tv_sec as f64 * 1e9 + t.tv_nsec as f64
}

impl Measurement for CpuTime {
    type Intermediate = f64;
    type Value = f64;
    fn start(&self) -> f64 {
        now()
    }
    fn end(&self, start: f64) -> f64 {
        now() - start
    }
    fn add(&self, a: &f64, b: &f64) -> f64 {
        a + b
    }
    fn zero(&self) -> f64 {
        0.0
    }
    fn to_f64(&self, value: &f64) -> f64 {
        *value
    }
    fn formatter(&self) -> &dyn ValueFormatter {
        // Nanoseconds, as wall time has them.
        WallTime.formatter()
    }
}
