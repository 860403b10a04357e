//! Regions that are no box: what a mask leaves, against sparse forms, and what becomes of masks that leave little.

use bspline::primitives::Sphere;
use bspline::{Field, HierarchicalSpline};
use dynamics::constraints::{Constraint, ConstraintError, Hold, On};
use dynamics::integrators::Integrator;
use dynamics::lattice::{Lattice, OnBox, Rim};
use dynamics::matter::{Matter, Quantity};
use dynamics::paint::Substance;
use dynamics::patch::{Patch, PatchError};
use dynamics::region::{Cells, Region, RegionError, RegionMask, RegionOptions};
use dynamics::response::Against;
use dynamics::solve::{Method, SolverOptions};
use dynamics::sparse::{Mask, MaskError, MaskedWay};
use dynamics::springs::{Law, Neighbours, Plasticity};
use glam::DVec3;

use crate::region::{CELLS, Random, damped, field};
use crate::replay::{different, without_counters};
use crate::sparse::{Reference, apart, error_of_step, painted, pins, product, random_region};

const WAYS: [MaskedWay; 4] = [
    MaskedWay::Band,
    MaskedWay::SparseFactor,
    MaskedWay::SparseIteration,
    MaskedWay::Cycle,
];

/// A ball, a half, scattered samples or a layer.
fn random_mask(random: &mut Random, dims: [usize; 3]) -> Vec<bool> {
    let kind = random.below(4);
    let centre = dims.map(|m| m as f64 * (0.3 + 0.4 * random.unit()));
    let radius = 0.25 * (1.0 + random.unit()) * dims[0] as f64;
    let at = |i: usize| [i / dims[2] / dims[1], i / dims[2] % dims[1], i % dims[2]].map(|i| i as f64);
    let count = dims.iter().product();
    let mut inside = |i: usize| {
        let p = at(i);
        let r = (0..3).map(|a| (p[a] - centre[a]).powi(2)).sum::<f64>().sqrt();
        match kind {
            0 => r < radius,
            1 => p[1] < centre[1],
            2 => random.unit() < 0.4,
            _ => (r - radius).abs() < 1.2,
        }
    };
    (0..count).map(&mut inside).collect()
}

/// The patch of a random region with a random mask that leaves something, painted anew; with what it rests at.
fn random_patch(random: &mut Random, way: MaskedWay) -> Patch<f64> {
    loop {
        let (_, region) = random_region(random);
        let patch = region.patch();
        let (lattice, d) = (patch.lattice().clone(), patch.state().d.clone());
        let rim = if random.unit() < 0.5 {
            Rim::Free
        } else {
            Rim::Fixed
        };
        let inside = random_mask(random, lattice.sample_dims());
        let Ok(mask) = Mask::new(&lattice, inside, rim, Neighbours::Six) else {
            continue;
        };
        let matter = painted(random, d.len(), 3.0);
        let options = SolverOptions {
            masked: way,
            iterations: 400,
            tolerance: Some(1e-14),
            ..SolverOptions::default()
        };
        let law = patch.springs().law();
        let patch = Patch::new(lattice, matter, law, Neighbours::Six, &d, options).unwrap();
        return patch.with_mask(mask).unwrap();
    }
}

fn cut(mask: &Mask, list: &mut [f64]) {
    for (v, inside) in list.iter_mut().zip(mask.inside()) {
        *v *= f64::from(u8::from(*inside));
    }
}

#[test]
fn masked_steps_are_those_of_sparse_forms_whatever_solves_them() {
    for way in WAYS {
        let mut worst = 0.0_f64;
        for seed in 0..20 {
            let mut random = Random(1000 + seed);
            let mut patch = random_patch(&mut random, way);
            let rest = patch.state().d.clone();
            let n = patch.lattice().coefficient_count();
            let mut external = random.list(rest.len());
            let (p, v) = (random.list(n), random.list(n));
            let pins = pins(&mut random, &patch);
            // A pin where nothing moves is refused, by name; two close to a border may hang on one coefficient.
            let held = patch.set_constraints(&pins);
            assert!(
                matches!(
                    held,
                    Ok(())
                        | Err(PatchError::Constraint(
                            ConstraintError::Unreachable { .. } | ConstraintError::Inconsistent { .. }
                        ))
                ),
                "{held:?}"
            );
            patch.set_state(&p, &v).unwrap();
            patch.set_force(&external).unwrap();
            cut(patch.mask().unwrap(), &mut external);
            let dt = 0.05 * 10f64.powf(2.0 * random.unit());
            for integrator in [Integrator::Paper, Integrator::TrBdf2] {
                let e = error_of_step(&mut patch.clone(), integrator, dt, &external, &rest);
                worst = worst.max(e);
                assert!(e < 1e-8, "{way:?}, seed {seed}, {integrator:?}: {e:.1e}");
            }
            let moving = patch.mask().unwrap().moving().to_vec();
            let still = |list: &[f64]| (0..n).all(|c| list[c] == 0.0 || moving.binary_search(&c).is_ok());
            patch.step(Integrator::TrBdf2, dt).unwrap();
            assert!(
                still(&patch.state().p) && still(&patch.state().v),
                "{way:?}, seed {seed}"
            );
        }
        println!("{way:?}: {worst:.1e}");
    }
}

#[test]
fn masked_rest_and_responses_are_those_of_sparse_forms() {
    let mut worst = [0.0_f64; 2];
    for seed in 0..20 {
        let mut random = Random(2000 + seed);
        let mut patch = random_patch(&mut random, MaskedWay::Best);
        let mut force = random.list(patch.state().d.len());
        let load = OnBox {
            at: patch.lattice().all_samples(),
            values: &force.clone(),
        };
        cut(patch.mask().unwrap(), &mut force);
        let reference = Reference::new(&patch);
        let b = product(reference.forms.sampling.transposed(), &force);
        let dt = 0.2;
        let scaled: Vec<f64> = b.iter().map(|b| dt * dt * b).collect();
        let exact = [
            reference.solve(&reference.forms.step(0.5 * dt, dt * dt), &scaled, &[]),
            reference.solve(&reference.forms.stiffness, &b, &[]),
        ];
        let found = [
            patch.respond(Integrator::Paper, dt, &[load]).unwrap(),
            patch.static_response(Against::Painted, &[load]).unwrap(),
        ];
        for k in 0..2 {
            let d = product(reference.forms.sampling.matrix(), &exact[k]);
            let e = apart(&found[k][0].d, &d);
            worst[k] = worst[k].max(e);
            assert!(e < 1e-7, "seed {seed}: {k} {e:.1e}");
        }
    }
    println!("response and rest: {worst:?}");
}

#[test]
fn a_mask_of_all_samples_is_the_box() {
    for (law, neighbours) in [
        (Law::Linear { scale: 1.0 }, Neighbours::Six),
        (Law::FourD { scale: 2.0 }, Neighbours::Eighteen),
    ] {
        let lattice = Lattice::<f64>::cube(11, 13, Rim::Fixed, 0.5).unwrap();
        let mut random = Random(3);
        let d = random.list(13 * 13 * 13);
        let matter = painted(&mut random, d.len(), 2.0);
        let options = SolverOptions::default();
        let whole = Patch::new(lattice, matter, law, neighbours, &d, options).unwrap();
        for rim in [Rim::Free, Rim::Fixed] {
            for integrator in [Integrator::TrBdf2, Integrator::Verlet, Integrator::Auto] {
                let all = Mask::new(whole.lattice(), vec![true; d.len()], rim, neighbours).unwrap();
                assert!(!all.parts()[0].floats && all.parts().len() == 1);
                let mut pair = [whole.clone(), whole.clone().with_mask(all).unwrap()];
                for patch in &mut pair {
                    patch.set_force(&d).unwrap();
                    for _ in 0..3 {
                        patch.step(integrator, 0.02).unwrap();
                    }
                }
                let e = apart(&pair[1].state().p, &pair[0].state().p);
                assert!(e < 1e-9, "{rim:?} {integrator:?}: {e:.1e}");
            }
        }
    }
}

/// A ball in the middle of the region, in the world.
fn ball(field: &HierarchicalSpline<f32>, cells: Cells, share: f64) -> Sphere {
    let region = Region::new(field, cells, Matter::default(), &options(field)).unwrap();
    let ends = region.patch().lattice().sample_dims().map(|m| m - 1);
    let (a, b) = (region.sample_position([0; 3]), region.sample_position(ends));
    Sphere::new(0.5 * (a + b), share * 0.5 * (b - a).length() / 3f64.sqrt()).unwrap()
}

fn options(field: &HierarchicalSpline<f32>) -> RegionOptions {
    RegionOptions {
        samples_per_cell: [4.0 / 3.0; 3],
        ..RegionOptions::of(field, 1)
    }
}

/// Samples of a region that are not in its mask.
fn outside(region: &Region<f32>) -> Vec<DVec3> {
    let dims = region.patch().lattice().sample_dims();
    let inside = region.patch().mask().unwrap().inside();
    (0..inside.len())
        .filter(|i| !inside[*i])
        .map(|i| region.sample_position([i / dims[2] / dims[1], i / dims[2] % dims[1], i % dims[2]]))
        .collect()
}

#[test]
fn a_fixed_rim_changes_no_bit_beside_the_mask() {
    let field = field::<f32>(3);
    let ball = ball(&field, CELLS, 0.9);
    for rim in [Rim::Fixed, Rim::Free] {
        let mask = RegionMask::inside(&ball, rim);
        let mut region = Region::masked(&field, CELLS, &mask, damped(), &options(&field)).unwrap();
        let samples = region.patch().lattice().sample_count();
        region.set_force(&vec![0.4; samples]).unwrap();
        for _ in 0..6 {
            region.step(Integrator::TrBdf2, 0.3).unwrap().expect("awake");
        }
        let baked = region.release_clay(&field).unwrap();
        assert!(!region.mask_parts().is_empty() && region.is_asleep());
        let moved = |p: &DVec3| baked.value(*p).to_bits() != field.value(*p).to_bits();
        let beside = outside(&region);
        let centre = region.sample_position(region.patch().lattice().sample_dims().map(|m| m / 2));
        assert!((baked.value(centre) - field.value(centre)).abs() > 0.05);
        match rim {
            Rim::Fixed => assert!(!beside.iter().any(moved)),
            // Functions reach one support further.
            Rim::Free => assert!(beside.iter().any(moved) && !beside.iter().all(moved)),
        }
        // Undo is the field before; the change is in the baked one, and not twice.
        let refused = Region::masked(&field, CELLS, &mask, damped(), &options(&field))
            .unwrap()
            .bake(&baked);
        assert!(matches!(refused, Err(RegionError::Changed)));
    }
}

#[test]
fn masked_regions_that_are_kept_recut_or_restored_are_the_same() {
    for (rim, way) in [
        (Rim::Free, MaskedWay::Best),
        (Rim::Fixed, MaskedWay::SparseFactor),
    ]
    .into_iter()
    .chain([(Rim::Free, MaskedWay::Cycle)])
    {
        let mut field = field::<f32>(3);
        let ball = ball(&field, CELLS, 0.8);
        let mask = RegionMask::inside(&ball, rim);
        let options = RegionOptions {
            solver: SolverOptions {
                masked: way,
                ..SolverOptions::default()
            },
            ..options(&field)
        };
        let cut = |field: &HierarchicalSpline<f32>, matter: Matter| {
            let mut region = Region::masked(field, CELLS, &mask, matter, &options).unwrap();
            let clay = Plasticity::Clay { rate: 2.0 };
            region.patch_mut().set_plasticity(clay).unwrap();
            region
        };
        let mut kept = cut(&field, damped());
        for stroke in 0..8 {
            let matter = kept.patch().matter().clone();
            let mut recut = cut(&field, matter);
            let mut restored = Region::restore(&kept.snapshot()).unwrap();
            for step in 0..4 {
                for region in [&mut kept, &mut recut, &mut restored] {
                    region.wake();
                    let dims = region.patch().lattice().sample_dims();
                    let mut random = Random(stroke * 10 + step);
                    let force = random.list(dims.iter().product());
                    let force: Vec<f32> = force.iter().map(|f| *f as f32).collect();
                    region.set_force(&force).unwrap();
                    if stroke % 3 == 1 {
                        let at = dynamics::lattice::SampleBox {
                            first: dims.map(|m| m / 3),
                            count: [3; 3],
                        };
                        let values = [2.0 + 20.0 * random.unit(); 27];
                        let paint = OnBox { at, values: &values };
                        region.paint(Substance::Stiffness, paint).unwrap();
                    }
                    region.step(Integrator::TrBdf2, 0.1).unwrap();
                }
                let json = serde_json::to_string(&kept.snapshot()).unwrap();
                restored = Region::restore(&serde_json::from_str(&json).unwrap()).unwrap();
                for other in [&recut, &restored] {
                    let (a, b) = (without_counters(&kept), without_counters(other));
                    assert!(a == b, "{way:?} {stroke} {step}: {}", different(&a, &b));
                }
            }
            field = kept.release_clay(&field).unwrap();
        }
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let many = rayon::ThreadPoolBuilder::new().num_threads(4).build().unwrap();
        let run = || {
            let mut region = cut(&field, damped());
            let samples = region.patch().lattice().sample_count();
            region.set_force(&vec![0.2; samples]).unwrap();
            region.step(Integrator::TrBdf2, 0.1).unwrap();
            region.snapshot()
        };
        assert!(one.install(run) == many.install(run));
    }
}

/// A patch of 8³ free coefficients in double precision with a mask; matter as given.
fn cube(inside: impl Fn([usize; 3]) -> bool, rim: Rim, matter: Matter) -> Result<Patch<f64>, MaskError> {
    let lattice = Lattice::<f64>::cube(14, 16, Rim::Fixed, 1.0).unwrap();
    let at = |i: usize| [i / 256, i / 16 % 16, i % 16];
    let inside = (0..4096).map(|i| inside(at(i))).collect();
    let mask = Mask::new(&lattice, inside, rim, Neighbours::Six)?;
    let d: Vec<f64> = (0..4096).map(|i| 7.4 - at(i)[0] as f64).collect();
    let law = Law::Linear { scale: 1.0 };
    let options = SolverOptions::default();
    let patch = Patch::new(lattice, matter, law, Neighbours::Six, &d, options).unwrap();
    Ok(patch.with_mask(mask).unwrap())
}

#[test]
fn masks_that_leave_nothing_are_refused_by_name() {
    let none = cube(|_| false, Rim::Free, Matter::default());
    assert_eq!(none.err(), Some(MaskError::Empty));
    // One layer of samples holds no whole function.
    let layer = cube(|[x, ..]| x == 8, Rim::Fixed, Matter::default());
    let layer = layer.expect_err("one layer");
    assert!(matches!(layer, MaskError::Held { samples: 256, .. }), "{layer}");
    assert!(layer.to_string().contains("thicker"));
    // Only functions of the fixed rim reach the corner.
    let corner = cube(|p| p == [0; 3], Rim::Free, Matter::default());
    assert!(matches!(corner, Err(MaskError::Held { samples: 1, .. })));
    let lattice = Lattice::<f64>::cube(14, 16, Rim::Fixed, 1.0).unwrap();
    let short = Mask::new(&lattice, vec![true; 5], Rim::Free, Neighbours::Six);
    let needed = 4096;
    assert_eq!(short.err(), Some(MaskError::Length { found: 5, needed }));
    let square = Lattice::<f64>::cube(8, 8, Rim::Free, 1.0).unwrap();
    let square = Mask::new(&square, vec![true; 512], Rim::Free, Neighbours::Six);
    assert_eq!(square.err(), Some(MaskError::Square));
    // The same through a region, which also does not walk.
    let field = field::<f32>(3);
    let nowhere = RegionMask::new(|_| false, Rim::Free);
    let refused = Region::masked(&field, CELLS, &nowhere, damped(), &options(&field));
    assert!(matches!(
        refused,
        Err(RegionError::Patch(PatchError::Mask(MaskError::Empty)))
    ));
    let all = RegionMask::new(|_| true, Rim::Free);
    let region = Region::masked(&field, CELLS, &all, damped(), &options(&field)).unwrap();
    let moved = region.moved(&field, CELLS, damped());
    assert!(matches!(moved, Err(RegionError::Masked)));
    // A pin that no coefficient reaches.
    let mut patch = cube(|[x, ..]| x < 6, Rim::Fixed, Matter::default()).unwrap();
    let pin = Constraint {
        label: "far".into(),
        on: On::Samples(vec![(12 * 256 + 8 * 16 + 8, 1.0)]),
        density: 0.0,
        hold: Hold::Hard,
    };
    let refused = patch.set_constraints(&[pin]);
    assert!(matches!(
        refused,
        Err(PatchError::Constraint(ConstraintError::Unreachable { .. }))
    ));
}

/// Largest motion of the samples inside and outside under a push on the samples where `pushed`.
fn moved(patch: &mut Patch<f64>, pushed: impl Fn([usize; 3]) -> bool) -> (f64, bool) {
    let at = |i: usize| [i / 256, i / 16 % 16, i % 16];
    let force: Vec<f64> = (0..4096).map(|i| f64::from(u8::from(pushed(at(i))))).collect();
    patch.set_force(&force).unwrap();
    let before = patch.state().d.clone();
    let report = patch.step(Integrator::TrBdf2, 0.5).unwrap();
    let inside = patch.mask().unwrap().inside();
    let far = (0..4096).filter(|i| inside[*i]);
    let far = far.map(|i| (patch.state().d[i] - before[i]).abs());
    (far.fold(0.0, f64::max), report.solve.converged())
}

#[test]
fn each_part_of_a_mask_in_pieces_moves_on_its_own() {
    // Two slabs further apart than functions reach, and away from the rim.
    let lattice = Lattice::<f64>::cube(22, 24, Rim::Fixed, 1.0).unwrap();
    let at = |i: usize| [i / 576, i / 24 % 24, i % 24];
    let slabs =
        |[x, y, z]: [usize; 3]| (5..7).contains(&x.min(23 - x)) && y.abs_diff(11) < 3 && z.abs_diff(11) < 3;
    let inside = (0..13824).map(|i| slabs(at(i))).collect();
    let mask = Mask::new(&lattice, inside, Rim::Free, Neighbours::Six).unwrap();
    let parts = mask.parts();
    assert_eq!(parts.len(), 2);
    assert!(parts.iter().all(|p| p.samples == 50 && p.floats), "{parts:?}");
    let d: Vec<f64> = (0..13824).map(|i| 7.4 - at(i)[0] as f64).collect();
    let (law, options) = (Law::Linear { scale: 1.0 }, SolverOptions::default());
    let patch = Patch::new(lattice, Matter::default(), law, Neighbours::Six, &d, options).unwrap();
    let mut patch = patch.with_mask(mask).unwrap();
    let force: Vec<f64> = (0..13824).map(|i| f64::from(u8::from(at(i)[0] < 12))).collect();
    patch.set_force(&force).unwrap();
    let report = patch.step(Integrator::TrBdf2, 0.5).unwrap();
    assert!(report.solve.converged());
    let motion = |x: usize| {
        let i = x * 576 + 11 * 24 + 11;
        (patch.state().d[i] - d[i]).abs()
    };
    assert!(
        motion(5) > 0.05 && motion(17) < 1e-4 * motion(5),
        "{} {}",
        motion(5),
        motion(17)
    );
    // Nothing holds them: under a lasting force they would go for ever, and it says so.
    let load = vec![1.0; d.len()];
    let load = OnBox {
        at: patch.lattice().all_samples(),
        values: &load,
    };
    let lasting = patch.static_response(Against::Painted, &[load]);
    assert!(matches!(lasting, Err(PatchError::Unheld)), "{lasting:?}");
    // A part that reaches the rim of the box hangs on it.
    let held = cube(|[x, ..]| x < 8, Rim::Free, Matter::default()).unwrap();
    assert!(!held.mask().unwrap().parts()[0].floats);
}

#[test]
fn without_stiffness_a_mask_is_dust_that_says_so_at_rest() {
    let matter = Matter {
        stiffness: Quantity::Constant(0.0),
        ..Matter::default()
    };
    for rim in [Rim::Free, Rim::Fixed] {
        let mut patch = cube(|[x, y, z]| x.max(y).max(z) < 12, rim, matter.clone()).unwrap();
        let (far, converged) = moved(&mut patch, |p| p == [8; 3]);
        assert!(converged && far > 1e-3 && far.is_finite(), "{rim:?}: {far}");
        let load = vec![1.0; 4096];
        let load = OnBox {
            at: patch.lattice().all_samples(),
            values: &load,
        };
        let lasting = patch.static_response(Against::Painted, &[load]);
        assert!(
            matches!(lasting, Err(PatchError::Unheld | PatchError::Static { .. })),
            "{lasting:?}"
        );
    }
}

#[test]
fn a_contrast_of_a_million_is_right_or_not_converged() {
    let inside = |[x, y, z]: [usize; 3]| {
        let r = [x, y, z]
            .map(|i| (i as f64 - 7.5).powi(2))
            .iter()
            .sum::<f64>()
            .sqrt();
        (3.0..6.5).contains(&r)
    };
    let stiffness: Vec<f64> = (0..4096)
        .map(|i| if (i / 16) % 16 < 8 { 1e6 } else { 1.0 })
        .collect();
    for (way, exact) in WAYS.into_iter().zip([true, true, true, false]) {
        let matter = Matter {
            stiffness: Quantity::PerSample(stiffness.clone()),
            ..Matter::default()
        };
        let mut random = Random(9);
        let reference = cube(inside, Rim::Free, matter.clone()).unwrap();
        let options = SolverOptions {
            masked: way,
            ..SolverOptions::default()
        };
        let rest = reference.state().d.clone();
        let single: Vec<f32> = rest.iter().map(|d| *d as f32).collect();
        let lattice = Lattice::<f32>::new(reference.lattice().axes().clone());
        let law = Law::Linear { scale: 1.0 };
        let mut patch = Patch::new(lattice, matter, law, Neighbours::Six, &single, options)
            .unwrap()
            .with_mask(reference.mask().unwrap().clone())
            .unwrap();
        let mut external = random.list(4096);
        patch
            .set_force(&external.iter().map(|f| *f as f32).collect::<Vec<_>>())
            .unwrap();
        cut(reference.mask().unwrap(), &mut external);
        let forms = Reference::new(&reference);
        let dt = 0.3;
        let b = product(forms.forms.sampling.transposed(), &external);
        let b: Vec<f64> = b.iter().map(|b| dt * dt * b).collect();
        let x = forms.solve(&forms.forms.step(0.5 * dt, dt * dt), &b, &[]);
        let right = product(forms.forms.sampling.matrix(), &x);
        let report = patch.step(Integrator::Paper, dt).unwrap();
        let found: Vec<f64> = patch.state().p.iter().map(|p| f64::from(*p)).collect::<Vec<_>>();
        let found = product(forms.forms.sampling.matrix(), &forms.of_moving(&found));
        let e = apart(&found, &right);
        let converged = report.solve.converged();
        println!("{way:?}: {e:.1e}, {:?}", report.solve);
        assert!(e < 0.02 || !converged, "{way:?}: {e:.1e}, {:?}", report.solve);
        assert!(!exact || e < 0.02, "{way:?}: {e:.1e}");
    }
}

#[test]
fn a_layer_of_samples_moves_as_a_membrane() {
    // One sample thick and free: four layers of functions for one of samples.
    let mut patch = cube(|[x, ..]| x == 8, Rim::Free, Matter::default()).unwrap();
    assert_eq!(patch.mask().unwrap().parts().len(), 1);
    let mut external: Vec<f64> = (0..4096)
        .map(|i| {
            if (i / 16) % 16 == 8 && i % 16 == 7 {
                1.0
            } else {
                0.0
            }
        })
        .collect();
    let rest = patch.state().d.clone();
    patch.set_force(&external).unwrap();
    cut(patch.mask().unwrap(), &mut external);
    let e = error_of_step(&mut patch.clone(), Integrator::TrBdf2, 0.5, &external, &rest);
    assert!(e < 1e-6, "{e:.1e}");
    // Its height is that of a grid of springs of its own, whatever the functions do beside it.
    let load: Vec<f64> = external.clone();
    let load = OnBox {
        at: patch.lattice().all_samples(),
        values: &load,
    };
    let response = patch.static_response(Against::Painted, &[load]).unwrap();
    let height = response[0].d[8 * 256 + 8 * 16 + 7];
    assert!(
        response[0].solve.converged() && height > 0.3 && height < 3.0,
        "{height}"
    );
}

#[test]
fn the_way_is_chosen_by_size_and_every_way_can_be_asked_for() {
    for way in WAYS {
        let options = SolverOptions {
            masked: way,
            ..SolverOptions::default()
        };
        let field = field::<f32>(3);
        let ball = ball(&field, CELLS, 0.8);
        let mask = RegionMask::shell(&ball, 1.0, Rim::Free);
        let options = RegionOptions {
            solver: options,
            ..self::options(&field)
        };
        let mut region = Region::masked(&field, CELLS, &mask, damped(), &options).unwrap();
        let samples = region.patch().lattice().sample_count();
        region.set_force(&vec![0.4; samples]).unwrap();
        let report = region.step(Integrator::Paper, 0.1).unwrap().expect("awake");
        let method = match way {
            MaskedWay::SparseFactor => Method::SparseDirect,
            MaskedWay::SparseIteration => Method::SparseIteration,
            MaskedWay::Cycle => Method::VCycle,
            MaskedWay::Band | MaskedWay::Best => Method::Direct,
        };
        assert_eq!(report.solve.method, method);
        assert!(report.solve.converged(), "{way:?}: {:?}", report.solve);
    }
}
