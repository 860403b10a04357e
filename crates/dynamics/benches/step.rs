//! Seconds of processor time of one step, by size, sampling and material.
//!
//! `cargo bench -p dynamics --bench step`. The rows of [Hua04 table 2], whose times, 1.0, 6.9, 15.8, 38.2
//! and 74.9 ms, hold the graphical update too. Painted is a stiff ball at a contrast of 100; steps are 30 times the
//! explicit limit of the uniform material.

use std::collections::BTreeMap;

use bspline::hierarchical::Lattice as FieldLattice;
use bspline::polygonize::{BlockMesh, PolygonizeOptions};
use bspline::{Aabb, Frame, HierarchicalSpline, TensorSpline};
use criterion::measurement::{Measurement, ValueFormatter, WallTime};
use criterion::{BatchSize, BenchmarkId, Criterion, criterion_group, criterion_main};
use dynamics::integrators::Integrator;
use dynamics::lattice::{Lattice, Rim, TensorWorkspace};
use dynamics::matter::{Matter, Quantity};
use dynamics::patch::Patch;
use dynamics::region::{Cells, Region, RegionOptions};
use dynamics::solve::SolverOptions;
use dynamics::springs::{Law, Neighbours, StepMatrix, Weights};
use dynamics::study::{Pattern, loads, spring_weights};
use glam::{DAffine3, DVec3};
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

/// Steps of painted patches until their factor is made.
const SETTLED: usize = 200;

fn patch(n: usize, m: usize, rim: Rim, contrast: f64) -> Patch<f32> {
    let lattice = Lattice::cube(n, m, rim, 1.0).expect("a lattice");
    // Held by weak ground springs: a patch that drifts for ever has nothing but its drift to solve for.
    let mut matter = Matter {
        ground: Quantity::Constant(0.01),
        ..Matter::default()
    };
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
    let d = vec![0.0; m * m * m];
    let law = Law::Linear { scale: 1.0 };
    let options = SolverOptions::default();
    let mut p = Patch::new(lattice, matter, law, Neighbours::Six, &d, options).expect("a patch");
    let force: Vec<f32> = loads(m)[0].iter().map(|&f| 1e-3 * f as f32).collect();
    p.set_force(&force).expect("finite");
    let count = p.lattice().coefficient_count();
    let steps = if contrast > 1.0 && count <= options.background_limit {
        SETTLED
    } else {
        1
    };
    for _ in 0..steps {
        p.step(Integrator::Paper, time_step()).expect("a step");
    }
    p
}

/// Thirty times the explicit limit of samples without splines.
fn time_step() -> f64 {
    30.0 * 2.0 / 12.0_f64.sqrt()
}

const TABLE: [(usize, usize); 5] = [(5, 10), (10, 10), (10, 15), (15, 15), (15, 20)];

fn rows(mut row: impl FnMut(String, &str, Patch<f32>)) {
    for (n, m) in TABLE {
        for (material, contrast) in [("uniform", 1.0), ("painted", 100.0)] {
            row(
                format!("{n}-{m} free"),
                material,
                patch(n, m, Rim::Free, contrast),
            );
        }
    }
    for (material, contrast) in [("uniform", 1.0), ("painted", 100.0)] {
        row("15-20 rim".into(), material, patch(15, 20, Rim::Fixed, contrast));
    }
}

fn step(c: &mut Criterion<CpuTime>) {
    let mut group = c.benchmark_group("step");
    rows(|name, material, mut p| {
        group.bench_function(BenchmarkId::new(name, material), |b| {
            b.iter(|| p.step(Integrator::Paper, time_step()).expect("a step"));
        });
    });
    group.finish();
}

/// A ball in the patch, with the change of its free coefficients.
fn surface(p: &Patch<f32>) -> TensorSpline<f32> {
    let axis = &p.lattice().axes()[0];
    let (n, first) = (axis.knots().coefficient_count(), axis.first_free());
    let free = axis.free_count();
    let u = axis.knots().knots();
    let size = axis.spacing() * (axis.sample_count() - 1) as f64;
    let greville = |i: usize| size * (u[i + 1] + u[i + 2] + u[i + 3]) / 3.0;
    let coefficients = (0..n * n * n).map(|e| {
        let ijk = [e / (n * n), e / n % n, e % n];
        let q = DVec3::from_array(ijk.map(greville)) - DVec3::splat(0.5 * size);
        let ball = (0.35 * size - q.length()) as f32;
        let inner = ijk.map(|i| i.wrapping_sub(first));
        if inner.iter().all(|&i| i < free) {
            ball + p.state().p[(inner[0] * free + inner[1]) * free + inner[2]]
        } else {
            ball
        }
    });
    let knots = std::array::from_fn(|a| p.lattice().axes()[a].knots().clone());
    let map = DAffine3::from_scale(DVec3::splat(size));
    TensorSpline::new(knots, coefficients.collect(), map, 1.0).expect("a spline")
}

/// The step, the moved spline, and its surface anew on cells as large as the distance of the samples.
fn step_and_remesh(c: &mut Criterion<CpuTime>) {
    let mut group = c.benchmark_group("step and re-mesh");
    group.sample_size(10);
    rows(|name, material, mut p| {
        let m = p.lattice().sample_dims()[0];
        let all = Aabb::new(DVec3::ZERO, DVec3::splat((m - 1) as f64));
        let frame = Frame::over(&all, [(m - 1) as u32; 3]);
        let options = PolygonizeOptions::default();
        let (mut mesh, _) = BlockMesh::new(&surface(&p), &frame, &options).expect("a frame");
        group.bench_function(BenchmarkId::new(name, material), |b| {
            b.iter(|| {
                p.step(Integrator::Paper, time_step()).expect("a step");
                mesh.update(&surface(&p), &[all]).expect("few blocks")
            });
        });
    });
    group.finish();
}

/// The first step after painting, and one of another length.
fn changes(c: &mut Criterion<CpuTime>) {
    let mut group = c.benchmark_group("step after a change");
    group.sample_size(10);
    for (n, m, rim, name) in [
        (15, 20, Rim::Fixed, "rim"),
        (15, 20, Rim::Free, "free"),
        (15, 15, Rim::Free, "free"),
        (24, 32, Rim::Free, "free"),
    ] {
        let mut p = patch(n, m, rim, 100.0);
        let matter = p.matter().clone();
        group.bench_function(format!("{n}-{m} {name} longer and shorter"), |b| {
            let mut longer = false;
            b.iter(|| {
                longer = !longer;
                let factor = if longer { 1.5 } else { 1.0 };
                p.step(Integrator::Paper, factor * time_step()).expect("a step")
            });
        });
        group.bench_function(format!("{n}-{m} {name} repainted"), |b| {
            b.iter(|| {
                p.set_matter(matter.clone()).expect("matter");
                p.step(Integrator::Paper, time_step()).expect("a step")
            });
        });
        // The steps between painting and the factor.
        p.step(Integrator::Paper, time_step()).expect("a step");
        group.bench_function(format!("{n}-{m} {name} while a factor is made"), |b| {
            b.iter_batched_ref(
                || p.clone(),
                |p| p.step(Integrator::Paper, time_step()).expect("a step"),
                BatchSize::PerIteration,
            );
        });
    }
    group.finish();
}

/// From 10³ to 128³ samples.
fn sizes(c: &mut Criterion<CpuTime>) {
    let mut group = c.benchmark_group("sizes");
    group.sample_size(10);
    for (n, m, contrast) in [
        (7, 10, 1.0),
        (12, 16, 1.0),
        (24, 32, 1.0),
        (48, 64, 1.0),
        (64, 128, 1.0),
        (32, 64, 1.0),
        (16, 64, 1000.0),
        (32, 64, 1000.0),
    ] {
        let mut p = patch(n, m, Rim::Free, contrast);
        group.bench_function(format!("{n}-{m} contrast {contrast}"), |b| {
            b.iter(|| p.step(Integrator::Paper, time_step()).expect("a step"));
        });
    }
    group.finish();
}

/// A product with the matrix of a step alone: what an iteration costs but for the preconditioner.
fn operator(c: &mut Criterion<CpuTime>) {
    let mut group = c.benchmark_group("product");
    for (n, m) in [(7, 10), (12, 16), (24, 32), (48, 64), (96, 128)] {
        let lattice = Lattice::<f32>::cube(n, m, Rim::Free, 1.0).expect("a lattice");
        let springs = spring_weights(Pattern::StiffBall, 100.0, m, Neighbours::Six, 1.0);
        let s = StepMatrix::new([m; 3], Weights::Constant(1.0), springs).convert::<f32>();
        let mut x = vec![1.0; lattice.coefficient_count()];
        let (mut d, mut q) = (vec![0.0; m * m * m], vec![0.0; m * m * m]);
        let mut w = TensorWorkspace::new();
        group.bench_function(format!("{n}-{m}"), |b| {
            b.iter(|| {
                lattice.sample(&x, &mut d, &mut w);
                s.apply(&d, &mut q);
                lattice.gather(&q, &mut x, &mut w);
                // As large as before.
                x.fill(1.0);
            });
        });
    }
    group.finish();
}

/// Forty steps of 48 × 12 × 12 cells under a push on one end that grows from step to step, with all of them awake and with
/// parts asleep.
fn sleep(c: &mut Criterion<CpuTime>) {
    let lattice = FieldLattice {
        world_from_lattice: DAffine3::IDENTITY,
        cells: [48, 12, 12],
    };
    let flat = HierarchicalSpline::<f32>::from_corrections(lattice, 1.0, vec![BTreeMap::new()]);
    let cells = Cells {
        level: 0,
        first: [0; 3],
        count: lattice.cells,
    };
    let mut group = c.benchmark_group("forty steps under a growing push");
    group.sample_size(10);
    for (material, contrast) in [("uniform", 1.0), ("painted", 30.0)] {
        let mut matter = Matter {
            damping: Quantity::Constant(3.0),
            ..Matter::default()
        };
        if contrast > 1.0 {
            let stiffness = matter.stiffness.paint(65 * 17 * 17).iter_mut();
            stiffness.step_by(7).for_each(|k| *k = contrast);
        }
        let options = RegionOptions::of(&flat, 0);
        let region = Region::new(&flat, cells, matter, &options).expect("a region");
        let near = |i: usize| {
            let at = [i / 289, i / 17 % 17, i % 17].map(|k| k as f32);
            (at[0] - 12.0).powi(2) + (at[1] - 8.0).powi(2) + (at[2] - 8.0).powi(2)
        };
        let push: Vec<f32> = (0..65 * 289).map(|i| (-0.3 * near(i)).exp()).collect();
        for (name, parts) in [("awake", false), ("parts asleep", true)] {
            let mut region = region.clone();
            region.set_parts_sleep(parts);
            group.bench_function(BenchmarkId::new(name, material), |b| {
                b.iter_batched_ref(
                    || region.clone(),
                    |region| {
                        for step in 0..40 {
                            let size = 0.002 * (10 + step) as f32;
                            let force: Vec<f32> = push.iter().map(|f| size * f).collect();
                            region.set_force(&force).expect("finite");
                            region.step(Integrator::TrBdf2, 0.1).expect("a step");
                        }
                    },
                    BatchSize::PerIteration,
                );
            });
        }
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().with_measurement(CpuTime).warm_up_time(std::time::Duration::from_millis(300)).measurement_time(std::time::Duration::from_secs(1));
    targets = step, step_and_remesh, changes, sizes, operator, sleep
}
criterion_main!(benches);
