//! Seconds of processor time of one step, by size, sampling and material.
//!
//! `cargo bench -p dynamics --bench step`. The rows of Table 2 of Hua and Qin (2004), whose times, 1.0, 6.9, 15.8, 38.2
//! and 74.9 ms, hold the graphical update too. Painted is a stiff ball at a contrast of 100; steps are 30 times the
//! explicit limit of the uniform material.

use criterion::measurement::{Measurement, ValueFormatter, WallTime};
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use dynamics::integrators::Integrator;
use dynamics::lattice::{Lattice, Rim};
use dynamics::matter::Matter;
use dynamics::patch::Patch;
use dynamics::solve::SolverOptions;
use dynamics::springs::{Law, Neighbours};
use dynamics::study::loads;
use rustix::time::{ClockId, clock_gettime};

/// Processor time of the process: other processes on the machine do not change it.
struct CpuTime;

impl Measurement for CpuTime {
    type Intermediate = f64;
    type Value = f64;
    fn start(&self) -> f64 {
        let t = clock_gettime(ClockId::ProcessCPUTime);
        t.tv_sec as f64 * 1e9 + t.tv_nsec as f64
    }
    fn end(&self, start: f64) -> f64 {
        self.start() - start
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

fn patch(n: usize, m: usize, rim: Rim, contrast: f64, iterations: usize) -> Patch<f32> {
    let lattice = Lattice::cube(n, m, rim, 1.0).expect("a lattice");
    let mut matter = Matter::default();
    if contrast > 1.0 {
        let centre = 0.5 * (m - 1) as f64;
        for (i, k) in matter.stiffness.paint(m * m * m).iter_mut().enumerate() {
            let p = [i / (m * m), i / m % m, i % m];
            let r2: f64 = p.iter().map(|&c| (c as f64 - centre).powi(2)).sum();
            if r2 < (0.3 * m as f64).powi(2) {
                *k = contrast;
            }
        }
    }
    let options = SolverOptions {
        iterations,
        ..SolverOptions::default()
    };
    let d = vec![0.0; m * m * m];
    let law = Law::Linear { scale: 1.0 };
    let mut p = Patch::new(lattice, matter, law, Neighbours::Six, &d, options).expect("a patch");
    let force: Vec<f32> = loads(m)[0].iter().map(|&f| f as f32).collect();
    p.set_force(&force).expect("finite");
    p
}

fn step(c: &mut Criterion<CpuTime>) {
    let mut group = c.benchmark_group("step");
    group.sample_size(10);
    let dt = 30.0 * 2.0 / 12.0_f64.sqrt();
    for (n, m) in [(5, 10), (10, 10), (10, 15), (15, 15), (15, 20)] {
        for (material, contrast) in [("uniform", 1.0), ("painted", 100.0)] {
            for (rim, name) in [(Rim::Free, "free"), (Rim::Fixed, "rim")] {
                if rim == Rim::Fixed && n < 15 {
                    continue;
                }
                let mut p = patch(n, m, rim, contrast, 8);
                p.step(Integrator::Paper, dt).expect("a step");
                group.bench_function(BenchmarkId::new(format!("{n}/{m} {name}"), material), |b| {
                    b.iter(|| p.step(Integrator::Paper, dt).expect("a step"));
                });
            }
        }
    }
    group.finish();
}

fn repaint(c: &mut Criterion<CpuTime>) {
    let mut group = c.benchmark_group("step after repainting");
    group.sample_size(10);
    let dt = 30.0 * 2.0 / 12.0_f64.sqrt();
    for (n, m, rim, name) in [
        (15, 20, Rim::Fixed, "rim"),
        (15, 20, Rim::Free, "free"),
        (15, 15, Rim::Free, "free"),
    ] {
        let mut p = patch(n, m, rim, 100.0, 8);
        p.step(Integrator::Paper, dt).expect("a step");
        let matter = p.matter().clone();
        group.bench_function(format!("{n}/{m} {name}"), |b| {
            b.iter(|| {
                p.set_matter(matter.clone()).expect("matter");
                p.step(Integrator::Paper, dt).expect("a step")
            });
        });
    }
    group.finish();
}

fn large(c: &mut Criterion<CpuTime>) {
    let mut group = c.benchmark_group("large step");
    group.sample_size(10);
    let dt = 30.0 * 2.0 / 12.0_f64.sqrt();
    for (n, m, contrast, iterations) in [(32, 64, 1.0, 8), (32, 64, 1000.0, 4), (48, 64, 1.0, 8)] {
        let mut p = patch(n, m, Rim::Free, contrast, iterations);
        p.step(Integrator::Paper, dt).expect("a step");
        group.bench_function(
            format!("{n}/{m} contrast {contrast}, {iterations} iterations"),
            |b| {
                b.iter(|| p.step(Integrator::Paper, dt).expect("a step"));
            },
        );
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().with_measurement(CpuTime).warm_up_time(std::time::Duration::from_millis(300)).measurement_time(std::time::Duration::from_secs(1));
    targets = step, repaint, large
}
criterion_main!(benches);
