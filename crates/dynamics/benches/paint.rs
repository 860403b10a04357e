//! What a dab of paint, and other changes of a patch that moves, cost in processor time, as multiples of a step.
//!
//! `cargo bench -p dynamics --bench paint [-- coefficients/samples … strokes]`. A cube with a fixed rim and a stiff ball at a contrast of 10
//! is pulled by a tool that moves; a step of eq. 12 is a sixtieth of a second, thirty times the explicit limit. A dab a step, 60
//! of them along a stroke, over twenty strokes; the error is that of an increment against a solver of the matter of that step.

use std::collections::BTreeMap;
use std::sync::Arc;

use bspline::HierarchicalSpline;
use bspline::hierarchical::{BrickKey, Corrections, Lattice as FieldLattice, LevelCorrections};
use dynamics::constraints::{Constraint, Hold, On};
use dynamics::integrators::Integrator;
use dynamics::lattice::{Lattice, OnBox, Rim, SampleBox};
use dynamics::matter::{Matter, Quantity};
use dynamics::paint::Substance;
use dynamics::patch::Patch;
use dynamics::region::{Cells, Region, RegionOptions, Thresholds};
use dynamics::solve::SolverOptions;
use dynamics::springs::{Law, Neighbours};
use glam::DAffine3;
use rustix::time::{ClockId, clock_gettime};

const DABS: usize = 60;
const STROKES: u64 = 20;
/// Times that a single change is timed.
const AGAIN: usize = 5;

fn seconds() -> f64 {
    let t = clock_gettime(ClockId::ProcessCPUTime);
    t.tv_sec as f64 + t.tv_nsec as f64 * 1e-9
}

fn median(mut list: Vec<f64>) -> f64 {
    list.sort_by(f64::total_cmp);
    list[list.len() / 2]
}

/// A number in `[0, 1)` from a seed, which moves on.
fn unit(seed: &mut u64) -> f64 {
    *seed = seed
        .wrapping_mul(6364136223846793005)
        .wrapping_add(1442695040888963407);
    (*seed >> 11) as f64 / (1u64 << 53) as f64
}

fn patch(n: usize, m: usize) -> Patch<f32> {
    let lattice = Lattice::cube(n, m, Rim::Fixed, 1.0).expect("a lattice");
    let mut matter = Matter {
        damping: Quantity::Constant(0.2),
        ..Matter::default()
    };
    let centre = 0.5 * (m - 1) as f64;
    for (i, k) in matter.stiffness.paint(m * m * m).iter_mut().enumerate() {
        let p = [i / (m * m), i / m % m, i % m].map(|c| c as f64 - centre);
        if p.iter().map(|c| c * c).sum::<f64>() < (0.3 * m as f64).powi(2) {
            *k = 10.0;
        }
    }
    let d: Vec<f32> = (0..m * m * m).map(|i| 0.4 * (i / m / m) as f32).collect();
    let law = Law::Linear { scale: 1.0 };
    let mut p = Patch::new(
        lattice,
        matter,
        law,
        Neighbours::Six,
        &d,
        SolverOptions::default(),
    )
    .expect("a patch");
    push(&mut p, 0.5);
    for _ in 0..200 {
        p.step(Integrator::Paper, time_step()).expect("a step");
    }
    p
}

/// A tool that pulls at a share of the edge.
fn push(p: &mut Patch<f32>, at: f64) {
    let edge = p.lattice().spacing()[0] * (p.lattice().sample_dims()[0] - 1) as f64;
    let (at, kernel) = p.lattice().gaussian([at * edge, 0.5 * edge, 0.5 * edge], 2.0);
    let values: Vec<f32> = kernel.iter().map(|k| 3.0 * *k as f32).collect();
    p.set_force_on(OnBox { at, values: &values }).expect("a force");
}

fn time_step() -> f64 {
    30.0 * 2.0 / 12.0_f64.sqrt()
}

fn timed(p: &mut Patch<f32>, dt: f64) -> (f64, usize) {
    let begun = seconds();
    let report = p.step(Integrator::Paper, dt).expect("a step");
    (seconds() - begun, report.solve.iteration.iterations)
}

/// A dab that stiffens towards `contrast` within `radius`; returns what painting took.
fn dab(p: &mut Patch<f32>, centre: [f64; 3], radius: f64, contrast: f64) -> f64 {
    let dims = p.lattice().sample_dims();
    let at = p.lattice().samples_near(centre, radius);
    let Quantity::PerSample(stiffness) = &p.matter().stiffness else {
        unreachable!("painted")
    };
    let place = |i: usize| [i / dims[1] / dims[2], i / dims[2] % dims[1], i % dims[2]];
    let values = at.indices(dims).map(|i| {
        let q = p.lattice().sample_place(place(i));
        let apart = (0..3).map(|a| (q[a] - centre[a]).powi(2)).sum::<f64>().sqrt();
        stiffness[i].max(1.0 + (contrast - 1.0) * (1.0 - apart / radius).max(0.0))
    });
    let values: Vec<f64> = values.collect();
    let begun = seconds();
    p.paint(Substance::Stiffness, OnBox { at, values: &values })
        .expect("paint");
    seconds() - begun
}

/// `‖Δd - Δd*‖/‖Δd*‖` of the last steps of two patches, which are what their rates are of.
fn apart(p: &Patch<f32>, exact: &Patch<f32>) -> f64 {
    let (mut wrong, mut size) = (0.0, 0.0);
    for (a, b) in p.state().w.iter().zip(&exact.state().w) {
        wrong += f64::from(a - b).powi(2);
        size += f64::from(*b).powi(2);
    }
    (wrong / size).sqrt()
}

fn strokes(n: usize, m: usize, settled: &Patch<f32>, count: u64) {
    for radius in [2.0, 4.0, 6.0] {
        for contrast in [10.0, 100.0, 1000.0] {
            let (mut means, mut paints) = (0.0, 0.0);
            let mut usuals = Vec::new();
            let (mut medians, mut worst, mut iterations, mut error, mut made) =
                (Vec::new(), 0.0_f64, 0, 0.0_f64, 0);
            let mut added = Vec::new();
            for stroke in 0..count {
                let mut p = settled.clone();
                let mut seed = 17 * stroke + 3;
                let edge = (m - 1) as f64;
                let ends = [(); 2].map(|()| [(); 3].map(|()| edge * (0.2 + 0.6 * unit(&mut seed))));
                // Steps without paint at the same time: the machine may do other work later.
                let mut still = settled.clone();
                let (mut times, mut usual, mut spent) = (Vec::new(), Vec::new(), 0.0);
                for k in 0..DABS {
                    let t = k as f64 / DABS as f64;
                    let centre = std::array::from_fn(|a| ends[0][a] + t * (ends[1][a] - ends[0][a]));
                    push(&mut p, 0.35 + 0.3 * t);
                    push(&mut still, 0.35 + 0.3 * t);
                    if k % 4 == 0 {
                        timed(&mut still, time_step());
                        usual.push(timed(&mut still, time_step()).0);
                    }
                    let painting = dab(&mut p, centre, radius, contrast);
                    let mut exact = (k % 20 == 19).then(|| p.clone());
                    let (step, used) = timed(&mut p, time_step());
                    times.push(painting + step);
                    spent += painting;
                    if k % 4 == 2 {
                        let mut after = p.clone();
                        pushed(&mut after, k, time_step());
                        added.push((painting + step) / pushed(&mut after, k, time_step()).0);
                    }
                    iterations += used;
                    if let Some(exact) = &mut exact {
                        exact.set_matter(p.matter().clone()).expect("the same matter");
                        // Looking begins the factor that the step solves with.
                        let load = OnBox {
                            at: SampleBox {
                                first: [m / 2; 3],
                                count: [1; 3],
                            },
                            values: &[1.0],
                        };
                        exact
                            .respond(Integrator::Paper, time_step(), &[load])
                            .expect("a response");
                        exact.settle();
                        exact.step(Integrator::Paper, time_step()).expect("a step");
                        error = error.max(apart(&p, exact));
                    }
                }
                made += p.factorizations() - settled.factorizations();
                let usual = median(usual);
                usuals.push(1e3 * usual);
                worst = worst.max(times.iter().copied().fold(0.0, f64::max) / usual);
                means += times.iter().sum::<f64>() / usual / DABS as f64;
                paints += spent / usual / DABS as f64;
                medians.push(median(times) / usual);
            }
            let runs = count as f64;
            println!(
                "{n}/{m} dabs of radius {radius}, contrast {contrast}: {:.2} steps of {:.3} ms (worst stroke {:.2}, worst dab {worst:.1}), {:.2} of steps after it, mean {:.2}, of which painting {:.2}, \
                 {:.1} iterations, {:.1} made a stroke, error {:.2} %",
                median(medians.clone()),
                median(usuals),
                medians.iter().copied().fold(0.0, f64::max),
                median(added),
                means / runs,
                paints / runs,
                iterations as f64 / (runs * DABS as f64),
                made as f64 / runs,
                100.0 * error,
            );
        }
    }
}

/// A step under the tool, which moves a little each time: a patch at rest has nothing to solve.
fn pushed(p: &mut Patch<f32>, count: usize, dt: f64) -> (f64, usize) {
    push(p, 0.35 + 0.3 * (count % DABS) as f64 / DABS as f64);
    timed(p, dt)
}

/// The first step after a change, and the middle and the longest of the next, in steps without it.
fn change(name: &str, settled: &Patch<f32>, dt: f64, change: impl Fn(&mut Patch<f32>)) {
    let (mut first, mut later, mut longest) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..AGAIN {
        let mut p = settled.clone();
        pushed(&mut p, 0, time_step());
        let usual = median((1..6).map(|k| pushed(&mut p, k, time_step()).0).collect());
        let begun = seconds();
        change(&mut p);
        let changing = seconds() - begun;
        first.push((changing + pushed(&mut p, 6, dt).0) / usual);
        let steps: Vec<f64> = (7..47).map(|k| pushed(&mut p, k, dt).0 / usual).collect();
        longest.push(steps.iter().copied().fold(0.0, f64::max));
        later.push(median(steps));
    }
    println!(
        "    {name}: {:.2} steps; of the next forty the middle {:.2}, the most {:.2}",
        median(first),
        median(later),
        median(longest)
    );
}

fn pins(p: &Patch<f32>, height: f64) -> Vec<Constraint> {
    let edge = p.lattice().spacing()[0] * (p.lattice().sample_dims()[0] - 1) as f64;
    let at = |k: usize| [0.3 + 0.05 * k as f64, 0.4, 0.6].map(|c| c * edge);
    (0..8)
        .map(|k| Constraint {
            label: format!("pin {k}"),
            on: On::Point {
                at: at(k),
                field: 0.3 * edge,
            },
            density: 0.3 * edge + height,
            hold: Hold::Hard,
        })
        .collect()
}

/// A region of so many cells along each axis, with as stiff a ball, that a moving tool pushes and that is let go again and again:
/// what letting go and the step after it take. It is never quiet enough to sleep.
fn release(cells: u32) {
    let n = cells + 16;
    let lattice = FieldLattice {
        world_from_lattice: DAffine3::IDENTITY,
        cells: [n; 3],
    };
    let mut bricks: LevelCorrections<f32> = BTreeMap::new();
    for x in 0..n + 3 {
        for (y, z) in (0..n + 3).flat_map(|y| (0..n + 3).map(move |z| (y, z))) {
            let key = BrickKey([x, y, z].map(|c| c / 8));
            let brick = bricks
                .entry(key)
                .or_insert_with(|| Arc::new(Corrections::empty()));
            let value = 0.5 * n as f32 - x as f32 + 0.01 * ((x * 7 + y * 5 + z * 3) % 11) as f32;
            Arc::make_mut(brick).set([x, y, z].map(|c| c as usize % 8), value);
        }
    }
    let mut field = HierarchicalSpline::from_corrections(lattice, 1.0, vec![bricks]);
    let of = Cells {
        level: 0,
        first: [8; 3],
        count: [cells; 3],
    };
    let m = cells as usize * 4 / 3 + 1;
    let mut matter = Matter {
        damping: Quantity::Constant(0.2),
        ..Matter::default()
    };
    let centre = 0.5 * (m - 1) as f64;
    for (i, k) in matter.stiffness.paint(m * m * m).iter_mut().enumerate() {
        let p = [i / (m * m), i / m % m, i % m].map(|c| c as f64 - centre);
        if p.iter().map(|c| c * c).sum::<f64>() < (0.3 * m as f64).powi(2) {
            *k = 10.0;
        }
    }
    let options = RegionOptions {
        sleep: Thresholds {
            speed: f64::MIN_POSITIVE,
            acceleration: f64::MIN_POSITIVE,
        },
        ..RegionOptions::of(&field, 0)
    };
    let mut region = Region::new(&field, of, matter, &options).expect("a region");
    let dt = 30.0 * region.patch_mut().explicit_limit().expect("a limit");
    let mut at = 0;
    let mut push = |region: &mut Region<f32>| {
        // There and back, a little at a step.
        at = (at + 1) % 40;
        let along = 0.4 + 0.005 * f64::from(20 - (at - 20_i32).abs());
        let edge = region.patch().lattice().spacing()[0] * (m - 1) as f64;
        let (at, kernel) = region
            .patch()
            .lattice()
            .gaussian([along, 0.5, 0.5].map(|c| c * edge), 1.5);
        let values: Vec<f32> = kernel.iter().map(|k| 0.3 * *k as f32).collect();
        region
            .set_force_on(OnBox { at, values: &values })
            .expect("a force");
    };
    let mut step = |region: &mut Region<f32>| {
        push(region);
        let begun = seconds();
        let report = region.step(Integrator::Paper, dt).expect("a step");
        let spent = seconds() - begun;
        report.expect("a region that is pushed is awake");
        spent
    };
    let (mut usuals, mut letting_go, mut first, mut later) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for _ in 0..AGAIN {
        for _ in 0..100 {
            step(&mut region);
        }
        region.settle();
        let usual = median((0..9).map(|_| step(&mut region)).collect());
        usuals.push(usual);
        let begun = seconds();
        field = region.release_clay(&field).expect("a release");
        letting_go.push((seconds() - begun) / usual);
        first.push(step(&mut region) / usual);
        later.push((0..40).map(|_| step(&mut region) / usual).fold(0.0, f64::max));
    }
    println!(
        "{} free coefficients, a step of {:.3} ms, released: {:.2} steps, and a first step of {:.2}; the most of the next forty {:.2}",
        (cells - 3).pow(3),
        1e3 * median(usuals),
        median(letting_go),
        median(first),
        median(later)
    );
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let asked: Vec<&String> = arguments.iter().filter(|a| a.contains('/')).collect();
    let count = arguments.iter().find_map(|a| a.parse().ok()).unwrap_or(STROKES);
    let sizes = [(15, 20), (20, 27), (24, 32), (32, 43)];
    for (n, m) in sizes {
        if !asked.is_empty() && !asked.iter().any(|a| **a == format!("{n}/{m}")) {
            continue;
        }
        let settled = patch(n, m);
        let mut p = settled.clone();
        let usual = median((0..40).map(|k| pushed(&mut p, k, time_step()).0).collect());
        println!(
            "{n}/{m}: a step takes {:.3} ms, {} iterations",
            1e3 * usual,
            pushed(&mut p, 40, time_step()).1
        );
        change("nothing", &settled, time_step(), |_| ());
        change("half the time step", &settled, 0.5 * time_step(), |_| ());
        change("eight times the time step", &settled, 8.0 * time_step(), |_| ());
        change("other matter", &settled, time_step(), |p| {
            let mut matter = p.matter().clone();
            matter.mass = Quantity::Constant(2.0);
            p.set_matter(matter).expect("matter");
        });
        change("eight hard constraints", &settled, time_step(), |p| {
            let pins = pins(p, 5.0);
            p.set_constraints(&pins).expect("pins");
        });
        let mut held = settled.clone();
        held.set_constraints(&pins(&held, 5.0)).expect("pins");
        timed(&mut held, time_step());
        change("moved targets", &held, time_step(), |p| {
            let pins = pins(p, 5.1);
            p.set_constraints(&pins).expect("pins");
        });
        strokes(n, m, &settled, count);
    }
    for cells in [12, 18, 21] {
        release(cells);
    }
}
