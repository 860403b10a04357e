//! What steps of many regions, and of the parts of one, cost.

use std::collections::BTreeMap;

use bspline::{Field, HierarchicalSpline, Real};
use dynamics::integrators::Integrator;
use dynamics::matter::{Matter, Quantity};
use dynamics::patch::PatchError;
use dynamics::region::{Cells, Region, RegionOptions, Schedule, Thresholds, Turn};
use glam::{DMat3, DVec3};

use super::{damped, field, lattice, options, push, state_bits};

/// A pushed region of 7³ cells from the cell `x` on.
fn pushed_at(field: &HierarchicalSpline<f32>, x: u32) -> Region<f32> {
    let cells = Cells {
        level: 1,
        first: [x, 2, 3],
        count: [7, 7, 7],
    };
    let mut region = Region::new(field, cells, damped(), &options(field)).unwrap();
    region.set_force(&push(&region, 0.3)).unwrap();
    region
}

#[test]
fn a_budget_gives_every_region_its_turn() {
    let old = field::<f32>(2);
    let new = |x| pushed_at(&old, x);
    let mut all = vec![new(0), new(8), new(16)];
    let mut some = all.clone();
    let work = some[0].step_work(Integrator::TrBdf2);
    let (mut whole, mut part) = (Schedule::default(), Schedule::default());
    for _ in 0..2 {
        let turns = whole.step(&mut all, Integrator::TrBdf2, 0.2, u64::MAX);
        assert!(turns.iter().all(|t| matches!(t, Turn::Stepped(_))));
    }
    let mut given_up = 0;
    for _ in 0..3 {
        let turns = part.step(&mut some, Integrator::TrBdf2, 0.2, 2 * work);
        given_up += turns.iter().filter(|t| **t == Turn::GivenUp).count();
    }
    assert_eq!(given_up, 3);
    for (a, b) in all.iter().zip(&some) {
        assert_eq!(state_bits(a), state_bits(b));
    }
    // A budget too small for any still moves one at a time.
    let moved = |t: &Vec<Turn>| t.iter().position(|t| matches!(t, Turn::Stepped(_)));
    let order: Vec<_> = (0..4)
        .map(|_| moved(&part.step(&mut some, Integrator::TrBdf2, 0.2, 0)))
        .collect();
    assert_eq!(order, [Some(0), Some(1), Some(2), Some(0)]);
    let failed = part.step(&mut some, Integrator::TrBdf2, f64::NAN, u64::MAX);
    assert!(
        failed
            .iter()
            .all(|t| matches!(t, Turn::Failed(PatchError::TimeStep { .. })))
    );
}

#[test]
fn a_frame_ends_when_its_time_is_spent() {
    let old = field::<f32>(2);
    let new = |x| pushed_at(&old, x);
    let mut regions = vec![new(0), new(8), new(16)];
    let mut schedule = Schedule::default();
    // A clock that a step advances by 4 ms, and frames of 6 ms.
    let mut frame = |regions: &mut [Region<f32>]| {
        let mut clock = 0.0;
        let turns = schedule.step_while(regions, Integrator::TrBdf2, 0.1, |work| {
            assert_eq!(work, 2 * 15 * 15 * 15);
            let may = clock < 0.006;
            clock += 0.004;
            may
        });
        turns
            .iter()
            .map(|t| matches!(t, Turn::Stepped(_)))
            .collect::<Vec<_>>()
    };
    assert_eq!(frame(&mut regions), [true, true, false]);
    assert_eq!(frame(&mut regions), [true, false, true]);
    assert_eq!(frame(&mut regions), [false, true, true]);
}

/// A long half-space of 48 knot intervals of so many cells each with a push near one end.
fn long(stride: u32) -> (HierarchicalSpline<f64>, Region<f64>, Vec<f64>) {
    let mut lattice = lattice();
    lattice.cells = [48, 12, 12].map(|n| n * stride);
    lattice.world_from_lattice.matrix3 = DMat3::from_diagonal(DVec3::splat(1.0 / f64::from(stride)));
    let flat = HierarchicalSpline::<f64>::from_corrections(lattice, 1.0, vec![BTreeMap::new()]);
    let cells = Cells {
        level: 0,
        first: [0; 3],
        count: lattice.cells,
    };
    let options = RegionOptions {
        stride: [stride; 3],
        samples_per_cell: [4.0 / 3.0 / f64::from(stride); 3],
        sleep: Thresholds {
            speed: 2e-4,
            acceleration: 1e-3,
        },
        ..RegionOptions::of(&flat, 0)
    };
    let region = Region::new(&flat, cells, damped(), &options).unwrap();
    let [nx, ny, nz] = region.patch().lattice().sample_dims();
    let at = |i: usize| [i / nz / ny, i / nz % ny, i % nz].map(|k| k as f64);
    let near = |i: usize| {
        let [x, y, z] = at(i);
        (x - 12.0).powi(2) + (y - 8.0).powi(2) + (z - 8.0).powi(2)
    };
    let force = (0..nx * ny * nz).map(|i| 0.05 * (-0.2 * near(i)).exp()).collect();
    (flat, region, force)
}

#[test]
fn parts_sleep_that_a_push_does_not_reach() {
    parts_sleep(1);
    parts_sleep(2);
}

fn parts_sleep(stride: u32) {
    let (flat, mut whole, force) = long(stride);
    let mut parts = whole.clone();
    parts.set_parts_sleep(true);
    for region in [&mut whole, &mut parts] {
        region.set_force(&force).unwrap();
    }
    let all = whole.awake_samples();
    let [_, ny, nz] = whole.patch().lattice().coefficient_dims();
    let mut most = 0;
    for step in 0..60 {
        for region in [&mut whole, &mut parts] {
            region.step(Integrator::TrBdf2, 0.1).unwrap();
        }
        most = most.max(parts.awake_samples());
        let far = &parts.patch().state().p[40 * ny * nz..];
        assert!(
            far.iter().all(|p| *p == 0.0),
            "step {step}: nothing moves at the far end"
        );
    }
    assert!(most < all / 2, "{most} of {all} samples awake");
    assert_eq!(
        parts.step_work(Integrator::TrBdf2),
        2 * parts.awake_samples() as u64
    );
    let peak = whole
        .patch()
        .state()
        .p
        .iter()
        .fold(0.0_f64, |m, p| m.max(p.abs()));
    let pairs = whole.patch().state().p.iter().zip(&parts.patch().state().p);
    let worst = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(peak > 0.03 && worst < 0.02 * peak, "{worst:.1e} of {peak:.1e}");
    // The bits of what sleeps are those of the field, baked or not.
    let baked = parts.bake(&flat).unwrap();
    let far = DVec3::new(46.0, 6.0, 6.0) + flat.lattice().world_from_lattice.translation;
    assert_eq!(baked.value(far).to_bits(), flat.value(far).to_bits());
    // Let go, all of it comes to rest, part by part.
    parts.release_elastic();
    let mut steps = 0;
    while parts.step(Integrator::TrBdf2, 0.2).unwrap().is_some() {
        steps += 1;
        assert!(steps < 1000, "never falls asleep");
    }
    assert_eq!(parts.awake_samples(), 0);
    let left = parts
        .patch()
        .state()
        .p
        .iter()
        .fold(0.0_f64, |m, p| m.max(p.abs()));
    assert!(left < 0.05 * peak, "{left} of {peak}");
}

/// A Gaussian push of a region, `at` samples along its long axis.
fn gauss<T: Real>(region: &Region<T>, at: f64, size: f64) -> Vec<T> {
    let [nx, ny, nz] = region.patch().lattice().sample_dims();
    let force = (0..nx * ny * nz).map(|i| {
        let place = [i / nz / ny, i / nz % ny, i % nz].map(|k| k as f64);
        let centre = [at, 0.5 * (ny - 1) as f64, 0.5 * (nz - 1) as f64];
        let near: f64 = place.iter().zip(centre).map(|(p, c)| (p - c).powi(2)).sum();
        T::from_f64(size * (-0.3 * near).exp())
    });
    force.collect()
}

/// Operations with sleeping parts over those without, and parts that were cut.
fn cost(matter: Matter, force: impl Fn(&Region<f32>, usize) -> Vec<f32>) -> (f64, usize) {
    let mut lattice = lattice();
    lattice.cells = [48, 9, 9];
    lattice.world_from_lattice.matrix3 = DMat3::IDENTITY;
    let flat = HierarchicalSpline::<f32>::from_corrections(lattice, 1.0, vec![BTreeMap::new()]);
    let cells = Cells {
        level: 0,
        first: [0; 3],
        count: lattice.cells,
    };
    let mut whole = Region::new(&flat, cells, matter, &RegionOptions::of(&flat, 0)).unwrap();
    let mut parts = whole.clone();
    parts.set_parts_sleep(true);
    for step in 0..60 {
        let force = force(&whole, step);
        for region in [&mut whole, &mut parts] {
            region.set_force(&force).unwrap();
            region.step(Integrator::TrBdf2, 0.1).unwrap();
        }
    }
    (parts.operations() / whole.operations(), parts.cuts())
}

#[test]
fn sleep_never_costs_more_than_no_sleep() {
    // Every change of the forces once cut the part anew: twice the work of no sleep on painted matter.
    let uniform = damped();
    let mut painted = damped();
    let samples = 65 * 13 * 13;
    for (i, k) in painted.stiffness.paint(samples).iter_mut().enumerate() {
        *k = if i % 7 == 0 { 30.0 } else { 1.0 };
    }
    let swinging = Matter {
        damping: Quantity::Constant(0.0),
        ..painted.clone()
    };
    for (name, matter) in [("uniform", uniform), ("painted", painted), ("swinging", swinging)] {
        let still = cost(matter.clone(), |r, _| gauss(r, 12.0, 0.05));
        let ramped = cost(matter.clone(), |r, step| {
            gauss(r, 12.0, 0.002 * (10 + step) as f64)
        });
        let moving = cost(matter.clone(), |r, step| gauss(r, 8.0 + 0.8 * step as f64, 0.05));
        let switched = cost(matter, |r, step| {
            gauss(r, if step % 4 < 2 { 8.0 } else { 56.0 }, 0.05)
        });
        println!("{name}: still {still:?}, ramped {ramped:?}, moving {moving:?}, switched {switched:?}");
        for (ratio, _) in [still, ramped, moving, switched] {
            assert!(ratio < 1.05, "{name}: {ratio} times the operations");
        }
        if name != "swinging" {
            assert!(still.0 < 0.8 && ramped.0 < 0.8, "{name}: {still:?} {ramped:?}");
            assert!(
                ramped.1 <= still.1 + 1,
                "{name}: {} parts for {}",
                ramped.1,
                still.1
            );
        }
    }
}
