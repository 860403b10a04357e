//! What tools ask before they act: responses of a step and of rest, forces on a box, stiffness at a place.

use std::f64::consts::PI;

use bspline::Real;
use dynamics::constraints::{Constraint, Hold, On};
use dynamics::integrators::Integrator;
use dynamics::lattice::{Lattice, OnBox, Rim, SampleBox, TensorWorkspace};
use dynamics::matter::{Matter, Quantity};
use dynamics::patch::{Patch, PatchError};
use dynamics::response::Against;
use dynamics::solve::SolverOptions;
use dynamics::springs::{Law, Neighbours, Plasticity, StepMatrix, Weights};
use nalgebra::{DMatrix, DVector};

use crate::common::dense;
use crate::region::Random;

const M: usize = 12;
const SIGMA: f64 = 0.5;

/// Stiffness of 1, of `contrast` in a ball off the centre.
fn ball(m: usize, contrast: f64) -> Vec<f64> {
    let at = |i: usize| [i / m / m, i / m % m, i % m].map(|i| i as f64 / (m - 1) as f64);
    let inside = |[x, y, z]: [f64; 3]| (x - 0.4).hypot(y - 0.5).hypot(z - 0.55) < 0.3;
    (0..m * m * m)
        .map(|i| if inside(at(i)) { contrast } else { 1.0 })
        .collect()
}

fn matter(m: usize, contrast: f64) -> Matter {
    Matter {
        stiffness: Quantity::PerSample(ball(m, contrast)),
        damping: Quantity::Constant(0.7),
        ..Matter::default()
    }
}

fn patch<T: Real>(m: usize, n: usize, rim: Rim, law: Law, matter: Matter, direct_limit: usize) -> Patch<T> {
    let lattice = Lattice::<T>::cube(n, m, rim, 0.5).unwrap();
    let d: Vec<T> = (0..m * m * m)
        .map(|i| T::from_f64(0.3 * (i / m / m) as f64))
        .collect();
    let options = SolverOptions {
        direct_limit,
        background_limit: 6 * direct_limit,
        ..SolverOptions::default()
    };
    Patch::new(lattice, matter, law, Neighbours::Six, &d, options).unwrap()
}

const LINEAR: Law = Law::Linear { scale: SIGMA };

/// Two loads on boxes of a lattice of `m` samples.
fn loads<T: Real>(m: usize) -> Vec<(SampleBox, Vec<T>)> {
    let mut random = Random(5);
    let boxes = [([m / 3; 3], [3, 2, 4]), ([m / 2, m / 2, m / 4], [2, 3, 3])];
    boxes
        .into_iter()
        .map(|(first, count)| {
            let at = SampleBox { first, count };
            (at, (0..at.len()).map(|_| T::from_f64(random.unit())).collect())
        })
        .collect()
}

fn on<T>(loads: &[(SampleBox, Vec<T>)]) -> Vec<OnBox<'_, T>> {
    loads
        .iter()
        .map(|(at, values)| OnBox { at: *at, values })
        .collect()
}

fn full<T: Real>(load: &OnBox<T>, dims: [usize; 3]) -> Vec<T> {
    let mut all = vec![T::zero(); dims.iter().product()];
    load.at
        .indices(dims)
        .zip(load.values)
        .for_each(|(i, v)| all[i] = *v);
    all
}

/// `‖a - b‖/‖b‖`.
fn error<T: Real>(a: &[T], b: &[f64]) -> f64 {
    let apart = a
        .iter()
        .zip(b)
        .map(|(a, b)| (a.as_f64() - b).powi(2))
        .sum::<f64>();
    (apart / b.iter().map(|b| b * b).sum::<f64>()).sqrt()
}

#[test]
fn a_response_is_what_a_step_moves_more() {
    let pin = |label: &str, sample: usize, hold| Constraint {
        label: label.into(),
        on: On::Samples(vec![(sample, 1.0)]),
        density: 0.3 * (sample / M / M) as f64 + 0.05,
        hold,
    };
    let at = |i: usize| (i * M + i) * M + i;
    for integrator in [Integrator::Paper, Integrator::TrBdf2] {
        for held in [false, true] {
            let mut before = patch::<f64>(M, 10, Rim::Fixed, LINEAR, matter(M, 30.0), 1000);
            let loads = loads(M);
            let loads = on(&loads);
            if held {
                let pins = [
                    pin("soft", at(4), Hold::Spring(20.0)),
                    pin("hard", at(7), Hold::Hard),
                ];
                before.set_constraints(&pins).unwrap();
            }
            before.set_force_on(loads[1]).unwrap();
            before.step(integrator, 0.3).unwrap();
            let p = before.state().p.clone();
            let responses = before.respond(integrator, 0.2, &loads).unwrap();
            assert_eq!(before.state().p, p);
            for (load, response) in loads.iter().zip(&responses) {
                let (mut without, mut with) = (before.clone(), before.clone());
                let dims = before.lattice().sample_dims();
                let mut force = full(&loads[1], dims);
                for (f, j) in force.iter_mut().zip(full(load, dims)) {
                    *f += j;
                }
                with.set_force(&force).unwrap();
                with.step(integrator, 0.2).unwrap();
                without.step(integrator, 0.2).unwrap();
                let more = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a - b).collect::<Vec<_>>();
                let (a, b) = (with.state(), without.state());
                let found = [
                    error(&response.p, &more(&a.p, &b.p)),
                    error(&response.d, &more(&a.d, &b.d)),
                ];
                assert!(
                    found.iter().all(|e| *e < 2e-5),
                    "{integrator:?} {held}: {found:?}"
                );
            }
        }
    }
    let mut patch = patch::<f64>(M, 10, Rim::Fixed, LINEAR, matter(M, 30.0), 1000);
    let refused = patch.respond(Integrator::Verlet, 0.1, &[]);
    assert!(refused.is_ok_and(|r| r.is_empty()));
    let loads = loads(M);
    let refused = patch.respond(Integrator::Verlet, 0.1, &on(&loads));
    assert!(matches!(refused, Err(PatchError::Explicit { .. })));
}

/// `aM̃ + bD̃ + K̃` column by column.
fn matrix<T: Real>(patch: &Patch<T>, a: f64, b: f64) -> DMatrix<f64> {
    let lattice = Lattice::<f64>::new(patch.lattice().axes().clone());
    let lumped = patch.matter().lumped::<f64>(&lattice, Neighbours::Six).unwrap();
    let sigma2 = patch.springs().law().scale().powi(2);
    let mass = (0..lattice.sample_count())
        .map(|i| a * lumped.mass.at(i) + b * lumped.damping.at(i) + sigma2 * lumped.ground.at(i));
    let mut springs = lumped.springs;
    for s in &mut springs {
        s.weights = s.weights.scaled(sigma2);
    }
    let dims = lattice.sample_dims();
    dense(
        &lattice,
        &StepMatrix::new(dims, Weights::Each(mass.collect()), springs),
    )
}

/// `H⁻¹AᵀJ` and its densities.
fn solved<T: Real>(patch: &Patch<T>, h: &DMatrix<f64>, load: &OnBox<T>) -> [Vec<f64>; 2] {
    let lattice = Lattice::<f64>::new(patch.lattice().axes().clone());
    let force: Vec<f64> = full(load, lattice.sample_dims())
        .iter()
        .map(|v| v.as_f64())
        .collect();
    let (mut b, mut d) = (vec![0.0; lattice.coefficient_count()], vec![0.0; force.len()]);
    let mut w = TensorWorkspace::new();
    lattice.gather(&force, &mut b, &mut w);
    let x = h.clone().cholesky().unwrap().solve(&DVector::from_vec(b));
    lattice.sample(x.as_slice(), &mut d, &mut w);
    [x.as_slice().to_vec(), d]
}

#[test]
fn responses_agree_with_dense_solves() {
    // A factor, a factor beside the steps, a V-cycle, and as many coefficients as samples.
    let sizes = [
        (M, 11, Rim::Fixed, 1000),
        (M, 11, Rim::Fixed, 40),
        (M, 8, Rim::Free, 60),
        (8, 8, Rim::Free, 1000),
    ];
    for (m, n, rim, limit) in sizes {
        for contrast in [1.0, 1e2, 1e4] {
            let mut given = matter(m, contrast);
            if contrast == 1.0 {
                given.stiffness = Quantity::Constant(1.0);
            }
            if rim == Rim::Free {
                given.ground = Quantity::Constant(0.01);
            }
            let mut patch = patch::<f32>(m, n, rim, LINEAR, given, limit);
            let loads = loads(m);
            let loads = on(&loads);
            let dt = 0.3;
            let step = patch.respond(Integrator::Paper, dt, &loads).unwrap();
            let before = patch.snapshot();
            let rest = patch.static_response(Against::Painted, &loads).unwrap();
            assert!(patch.snapshot() == before, "looking changed something");
            let of_step = matrix(&patch, 1.0 / (dt * dt), 0.5 / dt);
            let of_rest = matrix(&patch, 0.0, 0.0);
            for (k, load) in loads.iter().enumerate() {
                let [_, d] = solved(&patch, &of_step, load);
                let e = error(&step[k].d, &d);
                assert!(e < 1e-4, "{m}/{n} {contrast}: step {e:.1e}, {:?}", step[k].solve);
                let [p, d] = solved(&patch, &of_rest, load);
                let e = [error(&rest[k].p, &p), error(&rest[k].d, &d)];
                assert!(
                    e[0] < 1e-4 && e[1] < 1e-4,
                    "{m}/{n} {contrast}: rest {e:.1?}, {:?}",
                    rest[k].solve
                );
            }
        }
    }
}

#[test]
fn the_reference_does_not_see_paint() {
    let against = Against::Reference {
        stiffness: 1.0,
        ground: 0.0,
    };
    let loads = loads(M);
    let loads = on(&loads);
    let mut plain = patch::<f32>(M, 11, Rim::Fixed, LINEAR, Matter::default(), 1000);
    let mut painted = patch::<f32>(M, 11, Rim::Fixed, LINEAR, matter(M, 1e3), 1000);
    let columns = |p: &mut Patch<f32>, a| p.static_response(a, &loads).unwrap();
    let reference = columns(&mut painted, against);
    assert_eq!(reference, columns(&mut plain, against));
    let same = columns(&mut plain, Against::Painted);
    assert!(reference.iter().zip(&same).all(|(a, b)| a.d == b.d));
    let stiff = columns(&mut painted, Against::Painted);
    assert!(
        stiff[0].along(loads[0], painted.lattice()) < 0.1 * reference[0].along(loads[0], plain.lattice())
    );
}

#[test]
fn compliance_is_that_of_a_ball_in_a_grounded_cube() {
    // 1/(4πK)·(1/(√π r) - 0.874/W), W up to 0.58 knot spacings before the rim.
    let (m, n, h) = (33, 27, 0.5);
    let length = h * (m - 1) as f64;
    let knot = length / (n - 3) as f64;
    let mut patch = patch::<f32>(m, n, Rim::Fixed, LINEAR, Matter::default(), 1000);
    let (r, w) = (1.5, 0.5 * length - 0.58 * knot);
    let k = SIGMA * SIGMA;
    let exact = (1.0 / (PI.sqrt() * r) - 0.874 / w) / (4.0 * PI * k);
    let found = patch
        .compliance_at([0.5 * length; 3], r, Against::Painted)
        .unwrap();
    assert!((found / exact - 1.0).abs() < 0.03, "{found} {exact}");
    let nowhere = patch.compliance_at([100.0; 3], r, Against::Painted);
    assert!(matches!(nowhere, Err(PatchError::Nowhere { .. })));
}

#[test]
fn what_nothing_holds_has_no_response() {
    let loads = loads::<f64>(M);
    let mut free = patch::<f64>(M, 8, Rim::Free, LINEAR, Matter::default(), 1000);
    let refused = free.static_response(Against::Painted, &on(&loads));
    assert!(matches!(refused, Err(PatchError::Unheld)), "{refused:?}");
    let wrong = OnBox {
        at: SampleBox {
            first: [M - 1; 3],
            count: [2; 3],
        },
        values: &[0.0; 8],
    };
    assert!(matches!(free.set_force_on(wrong), Err(PatchError::Box { .. })));
    let short = OnBox {
        values: &[0.0; 7],
        at: SampleBox {
            first: [0; 3],
            ..wrong.at
        },
    };
    assert!(matches!(free.set_force_on(short), Err(PatchError::Length { .. })));
}

#[test]
fn tangents_of_the_four_d_law_are_those_of_the_steps() {
    let law = Law::FourD { scale: 2.0 };
    let mut patch = patch::<f64>(M, 10, Rim::Fixed, law, matter(M, 10.0), 1000);
    let loads = loads(M);
    let loads = on(&loads);
    patch
        .set_force_on(OnBox {
            at: loads[0].at,
            values: loads[0].values,
        })
        .unwrap();
    for _ in 0..5 {
        patch.step(Integrator::TrBdf2, 0.3).unwrap();
    }
    // Of a step of 10⁴ s nothing but the springs is left.
    let late = patch.respond(Integrator::Paper, 1e4, &loads).unwrap();
    let rest = patch.static_response(Against::Painted, &loads).unwrap();
    for (late, rest) in late.iter().zip(&rest) {
        let e = error(&late.d, &rest.d);
        assert!(e < 1e-3, "{e:.1e}");
    }
}

#[test]
fn forces_on_a_box_are_forces() {
    let mut a = patch::<f32>(M, 11, Rim::Fixed, LINEAR, matter(M, 30.0), 1000);
    a.set_plasticity(Plasticity::Clay { rate: 1.0 }).unwrap();
    let mut b = a.clone();
    let loads = loads(M);
    let loads = on(&loads);
    let dims = a.lattice().sample_dims();
    for load in [loads[0], loads[1], loads[0]] {
        a.set_force_on(load).unwrap();
        b.set_force(&full(&load, dims)).unwrap();
        a.step(Integrator::TrBdf2, 0.1).unwrap();
        b.step(Integrator::TrBdf2, 0.1).unwrap();
        assert!(a.snapshot() == b.snapshot());
    }
}

#[test]
fn samples_near_a_place_are_all_of_them() {
    let lattice = patch::<f64>(M, 10, Rim::Fixed, LINEAR, Matter::default(), 1000)
        .lattice()
        .clone();
    let dims = lattice.sample_dims();
    let mut random = Random(9);
    for _ in 0..300 {
        let at: [f64; 3] = std::array::from_fn(|_| 8.0 * random.unit() - 1.0);
        let radius = 3.0 * random.unit();
        let near = lattice.samples_near(at, radius);
        let apart = |i: usize| {
            let q = lattice.sample_place([i / M / M, i / M % M, i % M]);
            (0..3).map(|k| (q[k] - at[k]).powi(2)).sum::<f64>().sqrt()
        };
        let listed: Vec<usize> = near.indices(dims).filter(|i| apart(*i) <= radius).collect();
        let all: Vec<usize> = (0..lattice.sample_count())
            .filter(|i| apart(*i) <= radius)
            .collect();
        assert_eq!(listed, all);
        // The box is the least one, but for its corners.
        assert!(near.count.iter().all(|c| *c as f64 <= 2.0 * radius / 0.5 + 1.0));
    }
    assert!(lattice.samples_near([f64::NAN; 3], 1.0).is_empty());
}

#[test]
fn stiffness_is_read_where_it_is_painted() {
    let patch = patch::<f32>(M, 11, Rim::Fixed, LINEAR, matter(M, 50.0), 1000);
    let length = 0.5 * (M - 1) as f64;
    let at = |q: [f64; 3]| q.map(|q| q * length);
    let inside = patch.stiffness_near(at([0.4, 0.5, 0.55]), 0.8).unwrap();
    let outside = patch.stiffness_near(at([0.9, 0.9, 0.1]), 0.8).unwrap();
    let between = patch.stiffness_near(at([0.7, 0.5, 0.55]), 0.8).unwrap();
    assert!(
        (inside - 50.0).abs() < 1e-3 && (outside - 1.0).abs() < 1e-3,
        "{inside} {outside}"
    );
    assert!(between > 2.0 && between < 40.0, "{between}");
    assert_eq!(patch.stiffness_near([-50.0; 3], 1.0), None);
}
