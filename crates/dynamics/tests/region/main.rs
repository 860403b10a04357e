//! Regions of a hierarchical field: what baking keeps, how a solid is let go, and when it sleeps.

mod sleep;

use std::collections::BTreeMap;
use std::sync::Arc;

use bspline::hierarchical::{BrickKey, Corrections, Lattice, LevelCorrections, LevelEdit};
use bspline::{Field, HierarchicalSpline, Real};
use dynamics::integrators::Integrator;
use dynamics::lattice::LatticeError;
use dynamics::matter::{Matter, Quantity};
use dynamics::patch::PatchError;
use dynamics::region::{Cells, Region, RegionError, RegionOptions, Schedule, Thresholds, Turn};
use dynamics::springs::{Law, Neighbours, Weights};
use glam::{DAffine3, DMat3, DQuat, DVec3};

const INTEGRATORS: [Integrator; 4] = [
    Integrator::Paper,
    Integrator::Symplectic,
    Integrator::Verlet,
    Integrator::TrBdf2,
];

/// Numbers in `0..1`.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        ((z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb) >> 11) as f64 / (1u64 << 53) as f64
    }
}

fn lattice() -> Lattice {
    let turned = DMat3::from_quat(DQuat::from_rotation_z(0.4)) * DMat3::from_diagonal(DVec3::splat(2.0));
    Lattice {
        world_from_lattice: DAffine3::from_mat3_translation(turned, DVec3::new(10.0, -20.0, 5.0)),
        cells: [12, 9, 14],
    }
}

/// A half-space with bumps on `levels` levels: level 0 and 1 everywhere, level 2 where `x` is in the lower half.
fn field<T: Real>(levels: usize) -> HierarchicalSpline<T> {
    let lattice = lattice();
    let mut random = Random(7);
    let levels = (0..levels).map(|level| {
        let n = lattice.cells_at(level).map(|n| n + 3);
        let mut bricks: LevelCorrections<T> = BTreeMap::new();
        let end = if level == 2 { n[0] / 2 } else { n[0] };
        for x in 0..end {
            for y in 0..n[1] {
                for z in 0..n[2] {
                    let slope = if level == 0 {
                        2.0 * (6.2 - f64::from(x))
                    } else {
                        0.0
                    };
                    let value = slope + 0.3 * (random.unit() - 0.5) / (level + 1) as f64;
                    let key = BrickKey([x, y, z].map(|s| s / 8));
                    let brick = bricks
                        .entry(key)
                        .or_insert_with(|| Arc::new(Corrections::empty()));
                    Arc::make_mut(brick).set([x, y, z].map(|s| s as usize % 8), T::from_f64(value));
                }
            }
        }
        bricks
    });
    HierarchicalSpline::from_corrections(lattice, 1.0, levels.collect())
}

const CELLS: Cells = Cells {
    level: 1,
    first: [7, 3, 5],
    count: [10, 9, 12],
};

fn options<T: Real>(field: &HierarchicalSpline<T>) -> RegionOptions {
    RegionOptions {
        samples_per_cell: [2.0; 3],
        ..RegionOptions::of(field, 1)
    }
}

fn damped() -> Matter {
    Matter {
        damping: Quantity::Constant(3.0),
        ..Matter::default()
    }
}

/// A push on the samples round the middle.
fn push<T: Real>(region: &Region<T>, size: f64) -> Vec<T> {
    let [nx, ny, nz] = region.patch().lattice().sample_dims();
    let mut force = vec![T::zero(); nx * ny * nz];
    for (i, f) in force.iter_mut().enumerate() {
        let at = [i / nz / ny, i / nz % ny, i % nz];
        let near = [nx, ny, nz].iter().zip(at).all(|(n, i)| i.abs_diff(n / 2) < 3);
        *f = T::from_f64(if near { size } else { 0.0 });
    }
    force
}

/// A region of `field` pushed out of its rest.
fn pushed<T: Real>(field: &HierarchicalSpline<T>, cells: Cells, matter: Matter) -> Region<T> {
    let mut region = Region::new(field, cells, matter, &options(field)).unwrap();
    region.set_force(&push(&region, 0.3)).unwrap();
    for _ in 0..8 {
        region
            .step(Integrator::TrBdf2, 0.3)
            .unwrap()
            .expect("awake under a force");
    }
    region
}

/// Random world points of the lattice's box, some just outside the faces of the region, and whether they lie in it.
fn points(cells: Cells, count: usize) -> Vec<(DVec3, bool)> {
    let lattice = lattice();
    let width = 1.0 / (1u64 << cells.level) as f64;
    let low = DVec3::from_array(cells.first.map(f64::from)) * width;
    let high = low + DVec3::from_array(cells.count.map(f64::from)) * width;
    let (before, behind) = (low - 1e-7, high + 1e-7);
    let mut random = Random(11);
    (0..count)
        .map(|i| {
            let mut q = lattice.extent() * DVec3::new(random.unit(), random.unit(), random.unit());
            if i % 4 == 0 {
                q[i / 4 % 3] = [before, behind][i / 12 % 2][i / 4 % 3];
            }
            // Outside the lattice the field continues its face. The way through the world rounds by less than 1e-9.
            let at = q.clamp(DVec3::ZERO, lattice.extent());
            let inside = at.cmpgt(low - 1e-9).all() && at.cmplt(high + 1e-9).all();
            (lattice.world_from_lattice.transform_point3(q), inside)
        })
        .collect()
}

fn bits<T: Real>(field: &HierarchicalSpline<T>, p: DVec3) -> [u64; 4] {
    let (v, g) = field.value_gradient(p);
    [v, g.x, g.y, g.z].map(f64::to_bits)
}

fn state_bits<T: Real>(region: &Region<T>) -> Vec<u64> {
    let s = region.patch().state();
    let all = s.p.iter().chain(&s.v).chain(&s.d).chain(&s.w);
    all.map(|v| v.as_f64().to_bits()).collect()
}

#[test]
fn baking_keeps_the_old_version_to_the_bit() {
    let old = field::<f32>(3);
    let (copy, hash) = (old.clone(), old.sha256());
    let points = points(CELLS, 500);
    let before: Vec<_> = points.iter().map(|(p, _)| bits(&old, *p)).collect();
    let region = pushed(&old, CELLS, damped());
    let new = region.bake(&old).unwrap();
    assert_ne!(new.sha256(), hash);
    assert_eq!(
        region.bake(&old).unwrap().sha256(),
        new.sha256(),
        "the same input, the same bits"
    );
    // Undo takes the old version out of the drawer: every brick of it is still there, and is the one it was.
    assert_eq!(old.sha256(), hash);
    assert_eq!(old.unshared_brick_count(&copy), 0);
    for ((p, _), b) in points.iter().zip(before) {
        assert_eq!(bits(&old, *p), b);
    }
}

fn nothing_changes_beside<T: Real>(old: &HierarchicalSpline<T>, cells: Cells) {
    let region = pushed(old, cells, damped());
    let new = region.bake(old).unwrap();
    let (mut beside, mut changed) = (0, 0);
    for (p, inside) in points(cells, 20_000) {
        let same = bits(old, p) == bits(&new, p);
        beside += usize::from(!inside);
        changed += usize::from(!same);
        assert!(same || inside, "{p}");
    }
    assert!(beside > 1000 && changed > 300, "{beside} {changed}");
}

#[test]
fn outside_the_region_not_one_bit_changes() {
    nothing_changes_beside(&field::<f32>(2), CELLS);
    nothing_changes_beside(&field::<f32>(3), CELLS);
    nothing_changes_beside(&field::<f64>(3), CELLS);
    let old = field::<f32>(3);
    let new = pushed(&old, CELLS, damped()).bake(&old).unwrap();
    // Cells 7..17, 3..12, 5..17 lie in 3·2·3 bricks, each with up to 8 below.
    let unshared = new.unshared_brick_count(&old);
    assert!(
        (18..=18 * 9).contains(&unshared),
        "{unshared} of {}",
        new.brick_count()
    );
}

#[test]
fn a_level_the_field_lacks_is_made_in_whole_bricks() {
    let old = field::<f32>(1);
    let wanted = Cells {
        level: 2,
        first: [17, 9, 18],
        count: [6, 8, 10],
    };
    let refused = Region::new(&old, wanted, damped(), &options(&old)).unwrap_err();
    assert!(
        matches!(refused, RegionError::Spills { level: 2, .. }),
        "{refused}"
    );
    let cells = wanted.widened(&old).unwrap();
    // Bricks of level 1 are 16 cells of level 2 wide; axis y has 36.
    assert_eq!((cells.first, cells.count), ([16, 0, 16], [16, 32, 16]));
    nothing_changes_beside(&old, cells);
    // Where the level is there nothing has to be widened.
    assert_eq!(CELLS.widened(&field::<f32>(2)).unwrap(), CELLS);
}

fn baked_field_is_the_patch<T: Real>(tolerance: f64) {
    for levels in [2, 3] {
        let old = field::<T>(levels);
        let region = pushed(&old, CELLS, damped());
        let new = region.bake(&old).unwrap();
        let [nx, ny, nz] = region.patch().lattice().sample_dims();
        let (mut worst, mut moved) = (0.0f64, 0.0f64);
        for (i, d) in region.patch().state().d.iter().enumerate() {
            let p = region.sample_position([i / nz / ny, i / nz % ny, i % nz]);
            worst = worst.max((new.value(p) - d.as_f64()).abs());
            moved = moved.max((new.value(p) - old.value(p)).abs());
        }
        assert_eq!(region.patch().state().d.len(), nx * ny * nz);
        // The field is about 12 at most: tens of units of rounding, of the steps too.
        assert!(
            worst < tolerance && moved > 0.1,
            "{levels} levels: {worst:.1e} of {moved:.1e}"
        );
    }
}

#[test]
fn the_field_inside_is_that_of_the_patch() {
    baked_field_is_the_patch::<f32>(2e-5);
    baked_field_is_the_patch::<f64>(1e-13);
}

#[test]
fn finer_levels_are_carried_along() {
    let (fine, coarse) = (field::<f64>(3), field::<f64>(2));
    let region = pushed(&fine, CELLS, damped());
    let (new, new_coarse) = (region.bake(&fine).unwrap(), region.bake(&coarse).unwrap());
    assert_eq!(new.corrections(2), fine.corrections(2));
    let mut worst = 0.0f64;
    for (p, _) in points(CELLS, 4000) {
        let (detail, change) = (
            fine.value(p) - coarse.value(p),
            new_coarse.value(p) - coarse.value(p),
        );
        worst = worst.max((new.value(p) - coarse.value(p) - change - detail).abs());
    }
    assert!(worst < 1e-13, "{worst:.1e}");
}

#[test]
fn baking_is_smooth_across_the_rim() {
    let old = field::<f64>(2);
    let new = pushed(&old, CELLS, damped()).bake(&old).unwrap();
    // Of a change that is C² the second derivative along the axis vanishes at the face as the distance does.
    let q = |x: f64| {
        lattice()
            .world_from_lattice
            .transform_point3(DVec3::new(x, 3.9, 5.6))
    };
    let axis = lattice().world_from_lattice.matrix3.x_axis.normalize();
    let bend = |x: f64| {
        axis.dot((new.jet(q(x)).hessian - old.jet(q(x)).hessian) * axis)
            .abs()
    };
    let (near, far) = (bend(3.5 + 1e-6), bend(3.8));
    assert!(far > 1e-3 && near < 1e-4 * far, "{near:.1e} {far:.1e}");
}

#[test]
fn released_clay_stays_to_the_bit() {
    let old = field::<f32>(3);
    for law in [Law::Linear { scale: 1.0 }, Law::FourD { scale: 0.8 }] {
        let matter = Matter {
            ground: Quantity::Constant(0.2),
            ..damped()
        };
        let options = RegionOptions {
            law,
            neighbours: Neighbours::Eighteen,
            ..options(&old)
        };
        let mut region = Region::new(&old, CELLS, matter, &options).unwrap();
        region.patch_mut().springs_mut().rest_mut().scale = Weights::Constant(1.1);
        region.set_force(&push(&region, 0.2)).unwrap();
        for _ in 0..3 {
            region.step(Integrator::TrBdf2, 0.1).unwrap();
        }
        let before: Vec<f32> = region.patch().state().d.clone();
        let clay = region.release_clay(&old).unwrap();
        assert_ne!(clay.sha256(), old.sha256());
        assert!(region.is_asleep());
        let at_rest = state_bits(&region);
        assert_eq!(region.patch().state().d, before);
        for integrator in INTEGRATORS {
            for _ in 0..4 {
                region.wake();
                region.step(integrator, 0.01).unwrap().expect("awake");
            }
        }
        assert!(region.is_asleep());
        assert_eq!(state_bits(&region), at_rest, "{law:?}");
        assert_eq!(region.bake(&clay).unwrap().sha256(), clay.sha256());
        assert_eq!(region.patch_mut().energy().total(), 0.0);
    }
}

#[test]
fn a_released_elastic_solid_returns() {
    let old = field::<f64>(2);
    let mut region = pushed(&old, CELLS, damped());
    let largest = |r: &Region<f64>| r.patch().state().p.iter().fold(0.0f64, |m, p| m.max(p.abs()));
    let away = largest(&region);
    region.release_elastic();
    let mut steps = 0;
    while region.step(Integrator::TrBdf2, 0.3).unwrap().is_some() {
        steps += 1;
        assert!(steps < 1000, "never falls asleep");
    }
    let left = largest(&region);
    assert!(
        away > 0.1 && left < 0.02 * away,
        "{left:.1e} of {away:.1e} after {steps}"
    );
}

#[test]
fn sleep_changes_no_bit_and_ends_with_a_force() {
    let old = field::<f32>(2);
    let mut region = Region::new(&old, CELLS, damped(), &options(&old)).unwrap();
    assert!(region.is_asleep(), "cut at rest");
    let none = state_bits(&region);
    assert!(region.step(Integrator::TrBdf2, 0.3).unwrap().is_none());
    region.set_force(&push(&region, 1e-6)).unwrap();
    assert!(region.is_asleep(), "a force below the threshold");
    let force = push(&region, 0.1);
    region.set_force(&force).unwrap();
    assert!(!region.is_asleep());
    let mut steps = 0;
    while region.step(Integrator::TrBdf2, 0.3).unwrap().is_some() {
        steps += 1;
        assert!(steps < 1000, "never falls asleep under a force that is balanced");
    }
    let held = state_bits(&region);
    assert_ne!(held, none);
    assert_eq!(region.step_work(Integrator::TrBdf2), 0);
    // The force that it has balanced does not wake it, another one does.
    region.set_force(&force).unwrap();
    for _ in 0..10 {
        assert!(region.step(Integrator::Paper, 0.3).unwrap().is_none());
    }
    assert_eq!(state_bits(&region), held);
    region.set_force(&vec![0.0; force.len()]).unwrap();
    assert!(region.step(Integrator::TrBdf2, 0.3).unwrap().is_some());
}

#[test]
fn a_swinging_solid_does_not_fall_asleep() {
    let old = field::<f64>(2);
    let mut region = pushed(&old, CELLS, Matter::default());
    region.release_elastic();
    // Many turning points and passes through the balance.
    for _ in 0..300 {
        assert!(region.step(Integrator::TrBdf2, 0.05).unwrap().is_some());
    }
}

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

/// A long half-space of 48 cells with a push near one end.
fn long() -> (HierarchicalSpline<f64>, Region<f64>, Vec<f64>) {
    let mut lattice = lattice();
    lattice.cells = [48, 12, 12];
    lattice.world_from_lattice.matrix3 = DMat3::IDENTITY;
    let flat = HierarchicalSpline::<f64>::from_corrections(lattice, 1.0, vec![BTreeMap::new()]);
    let cells = Cells {
        level: 0,
        first: [0; 3],
        count: [48, 12, 12],
    };
    let options = RegionOptions {
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
    let (flat, mut whole, force) = long();
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

#[test]
fn regions_of_one_field_add_up() {
    let old = field::<f64>(2);
    let cells = |first: [u32; 3]| Cells {
        level: 1,
        first,
        count: [8; 3],
    };
    let (a, b) = (
        pushed(&old, cells([3, 2, 3]), damped()),
        pushed(&old, cells([8, 4, 6]), damped()),
    );
    let both = b.bake(&a.bake(&old).unwrap()).unwrap();
    let alone = [a.bake(&old).unwrap(), b.bake(&old).unwrap()];
    for (p, _) in points(cells([3, 2, 3]), 2000) {
        let sum: f64 = alone.iter().map(|f| f.value(p) - old.value(p)).sum();
        assert!((both.value(p) - old.value(p) - sum).abs() < 1e-12);
    }
}

#[test]
fn cells_that_are_not_cubic_are_sampled_in_world_lengths() {
    let mut lattice = lattice();
    lattice.world_from_lattice.matrix3 = DMat3::from_diagonal(DVec3::new(1.0, 1.0, -2.0));
    let flat = HierarchicalSpline::<f64>::from_corrections(lattice, 1.0, vec![BTreeMap::new()]);
    let cells = Cells {
        level: 0,
        first: [0; 3],
        count: [9, 8, 7],
    };
    let mut options = RegionOptions {
        samples_per_cell: [2.0, 2.0, 4.0],
        neighbours: Neighbours::Eighteen,
        ..RegionOptions::of(&flat, 0)
    };
    let region = Region::new(&flat, cells, Matter::default(), &options).unwrap();
    assert_eq!(region.patch().lattice().spacing(), [0.5; 3]);
    assert_eq!(region.patch().lattice().sample_dims(), [19, 17, 29]);
    options.samples_per_cell = [2.0; 3];
    let refused = Region::new(&flat, cells, Matter::default(), &options).unwrap_err();
    assert!(
        matches!(refused, RegionError::Patch(PatchError::NotCubic { .. })),
        "{refused}"
    );
    options.neighbours = Neighbours::Six;
    let region = Region::new(&flat, cells, Matter::default(), &options).unwrap();
    assert_eq!(region.patch().lattice().spacing(), [0.5, 0.5, 1.0]);
}

#[test]
fn regions_that_cannot_be_are_refused() {
    let old = field::<f32>(2);
    let make =
        |cells: Cells, options: &RegionOptions| Region::new(&old, cells, damped(), options).map(|_| ());
    let good = options(&old);
    let with = |first, count| Cells {
        level: 1,
        first,
        count,
    };
    let refused = [
        make(with([0; 3], [4, 3, 4]), &good),
        make(with([20, 0, 0], [5, 5, 5]), &good),
        make(with([u32::MAX, 0, 0], [5, 5, 5]), &good),
        make(Cells { level: 60, ..CELLS }, &good),
    ];
    assert!(matches!(
        refused[0],
        Err(RegionError::TooFewCells { axis: 1, count: 3 })
    ));
    assert!(matches!(
        refused[1],
        Err(RegionError::Outside {
            axis: 0,
            cells: 24,
            ..
        })
    ));
    assert!(matches!(refused[2], Err(RegionError::Outside { axis: 0, .. })));
    assert!(matches!(refused[3], Err(RegionError::Edit(_))));
    let mut options = good;
    for value in [f64::NAN, 0.0, -1.0] {
        options.samples_per_cell[2] = value;
        assert!(matches!(
            make(CELLS, &options),
            Err(RegionError::SamplesPerCell { axis: 2, .. })
        ));
    }
    options.samples_per_cell[2] = 1e300;
    assert!(matches!(make(CELLS, &options), Err(RegionError::TooLarge { .. })));
    options.samples_per_cell[2] = 0.2;
    let few = make(CELLS, &options);
    assert!(matches!(
        few,
        Err(RegionError::Lattice(LatticeError::TooFewSamples { axis: 2, .. }))
    ));
    let huge = Cells {
        level: 9,
        first: [0; 3],
        count: [4000; 3],
    };
    assert!(matches!(
        make(huge, &good),
        Err(RegionError::TooLarge { what: "cells", .. })
    ));

    let mut sheared = lattice();
    sheared.world_from_lattice.matrix3.x_axis.y += 0.1;
    let other = HierarchicalSpline::<f32>::from_corrections(sheared, 1.0, vec![BTreeMap::new()]);
    let cells = Cells {
        level: 0,
        first: [0; 3],
        count: [8; 3],
    };
    let refused = Region::new(&other, cells, damped(), &good).map(|_| ());
    assert!(matches!(refused, Err(RegionError::Sheared { .. })));
    let region = pushed(&old, CELLS, damped());
    assert!(matches!(region.bake(&other), Err(RegionError::OtherLattice)));
    assert!(matches!(region.bake(&field(1)), Err(RegionError::Spills { .. })));
    let mut force = push(&region, 1.0);
    force[3] = f32::NAN;
    assert!(region.clone().set_force(&force).is_err());
}

#[test]
fn a_region_finer_than_the_field_starts_from_the_same_values() {
    let old = field::<f64>(1);
    let edited = old
        .edited(&[LevelEdit {
            level: 0,
            function: [5; 3],
            delta: 0.5,
        }])
        .unwrap();
    let cells = Cells {
        level: 1,
        first: [8, 0, 8],
        count: [8, 16, 8],
    }
    .widened(&edited)
    .unwrap();
    let sleep = Thresholds {
        speed: 0.0,
        acceleration: 0.0,
    };
    let region = Region::new(
        &edited,
        cells,
        damped(),
        &RegionOptions {
            sleep,
            ..options(&edited)
        },
    )
    .unwrap();
    let [_, ny, nz] = region.patch().lattice().sample_dims();
    for (i, d) in region.patch().state().d.iter().enumerate() {
        let p = region.sample_position([i / nz / ny, i / nz % ny, i % nz]);
        assert!((edited.value(p) - d).abs() < 1e-13);
    }
    // Nothing moved: nothing is baked.
    assert_eq!(region.bake(&edited).unwrap().sha256(), edited.sha256());
}
