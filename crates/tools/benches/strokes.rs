//! Whole loops of force tools: force, step, difference, local mesh; in processor time of one core.
//!
//! `cargo bench -p tools --bench strokes`. The rows of [Hua04 Table 2] print 1.0, 6.9, 15.8, 38.2 and 74.9 ms for the simulation
//! and the graphical update; the name of a row says so. Tools on the default fits of `data/bunny.obj.gz` and `data/head.nii.gz` have
//! no printed time: asked for are 8 ms of points and 20 ms of curves and areas on patches of 24/32 (coefficients and samples
//! of a point on an axis), 4 ms of all on those of 15/20. A time is the mean over a stroke, from the touch to the end.

#[path = "common/cpu_time.rs"]
mod cpu_time;
#[path = "common/scans.rs"]
mod scans;

use criterion::measurement::Measurement;
use criterion::{BenchmarkId, Criterion};
use tools::study::{Looped, PatchPull, StrokeKind, TABLE_2, half_painted, mesh_about};

use cpu_time::{CpuTime, on_one_core};

/// Loops of a pull on the patches of table 2.
const PULLS: u64 = 40;
/// Loops of a stroke on a scan, if it does not end before.
const LOOPS: u64 = 60;

/// Nanoseconds of processor time that something takes.
fn spent(work: impl FnOnce()) -> f64 {
    let start = CpuTime.start();
    work();
    CpuTime.end(start)
}

fn table_2(c: &mut Criterion<CpuTime>) {
    let mut group = c.benchmark_group("Hua04 Table 2");
    group.sample_size(10);
    for (n, m, printed) in TABLE_2 {
        for (matter, painted) in [("even", false), ("half painted", true)] {
            let row = BenchmarkId::new(format!("{n}³ of {m}³ samples, printed {printed} ms"), matter);
            group.bench_function(row, |b| {
                b.iter_custom(|count| {
                    let mut sum = 0.0;
                    for _ in 0..count.div_ceil(PULLS) {
                        let mut pull = PatchPull::new(n, m, painted).expect("a row of the table");
                        sum += spent(|| (0..PULLS).for_each(|_| pull.step().expect("a step")));
                    }
                    sum / (count.div_ceil(PULLS) * PULLS) as f64 * count as f64
                });
            });
        }
    }
    group.finish();
}

fn scans(c: &mut Criterion<CpuTime>) {
    for sculpture in [scans::bunny(), scans::head()] {
        let mut group = c.benchmark_group(format!("stroke on {}", sculpture.name));
        group.sample_size(10);
        let (sizes, at) = (sculpture.sizes(), sculpture.place().expect("a surface"));
        for (radius, size) in sizes.radii {
            let layers = half_painted(&sculpture, at, 24.0 * radius, sizes.level).expect("paint");
            let mesh = mesh_about(&sculpture, at, 30.0 * radius, sizes.interval).expect("a mesh");
            for kind in StrokeKind::ALL {
                for (matter, painted) in [("even", false), ("half painted", true)] {
                    let begin = || {
                        let stroke = kind.begin(&sculpture.field, sculpture.iso, at, radius, true);
                        let stroke = stroke.expect("a tool on the surface");
                        let stroke = match painted {
                            true => stroke.painted(&layers).expect("paint"),
                            false => stroke,
                        };
                        Looped::new(&sculpture, stroke, mesh.clone())
                    };
                    let row = BenchmarkId::new(format!("{} {size}", kind.name()), matter);
                    group.bench_function(row, |b| {
                        b.iter_custom(|count| {
                            let (mut sum, mut made) = (0.0, 0);
                            while made < count {
                                let (mut looped, mut steps) = (begin(), 0);
                                while steps < LOOPS && !looped.is_over() {
                                    sum += spent(|| drop(looped.step().expect("a loop")));
                                    steps += 1;
                                }
                                made += steps;
                            }
                            sum / made as f64 * count as f64
                        });
                    });
                }
            }
        }
        group.finish();
    }
}

fn main() {
    on_one_core(|c| {
        table_2(c);
        scans(c);
    });
}
