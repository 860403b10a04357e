//! The tensor path against assembled sparse forms: products, steps, rest and responses of random regions.

use std::collections::BTreeMap;
use std::sync::Arc;

use bspline::hierarchical::{BrickKey, Corrections, Lattice as FieldLattice, LevelCorrections};
use bspline::{HierarchicalSpline, KnotVector};
use dynamics::constraints::{Constraint, Hold, On};
use dynamics::integrators::Integrator;
use dynamics::lattice::{Axis, Lattice, OnBox, Rim, SampleBox, TensorWorkspace};
use dynamics::matter::{Matter, Quantity};
use dynamics::patch::{Patch, State};
use dynamics::region::{Cells, Region, RegionOptions};
use dynamics::response::Against;
use dynamics::solve::SolverOptions;
use dynamics::sparse::{OUTSIDE, SparseCholesky, SparseForms, multiply, nested_dissection};
use dynamics::springs::{Law, Neighbours, SpringWeights, StepMatrix};
use glam::{DAffine3, DMat3, DVec3};
use nalgebra::{DMatrix, DVector};
use sprs::CsMat;

use crate::region::Random;

const SEEDS: u64 = 20;

impl Random {
    pub fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }

    pub fn list(&mut self, n: usize) -> Vec<f64> {
        (0..n).map(|_| 2.0 * self.unit() - 1.0).collect()
    }

    /// Over `decades` powers of ten.
    fn spread(&mut self, n: usize, decades: f64) -> Vec<f64> {
        (0..n).map(|_| 10f64.powf(decades * self.unit())).collect()
    }
}

/// Matter painted all over, `decades` of contrast in stiffness.
pub fn painted(random: &mut Random, samples: usize, decades: f64) -> Matter {
    Matter {
        stiffness: Quantity::PerSample(random.spread(samples, decades)),
        mass: Quantity::PerSample(random.spread(samples, 1.0)),
        damping: Quantity::PerSample(random.list(samples).iter().map(|v| v.abs()).collect()),
        ground: Quantity::PerSample(random.list(samples).iter().map(|v| v.max(0.0)).collect()),
        spring_factors: None,
    }
}

pub fn product(m: &CsMat<f64>, x: &[f64]) -> Vec<f64> {
    let mut y = vec![0.0; m.rows()];
    multiply(m, x, &mut y);
    y
}

/// `‖a - b‖/‖b‖`.
pub fn apart(a: &[f64], b: &[f64]) -> f64 {
    let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|v| v * v).sum::<f64>().sqrt();
    let size = norm(&mut b.iter().copied()).max(f64::MIN_POSITIVE);
    norm(&mut a.iter().zip(b).map(|(a, b)| a - b)) / size
}

/// `a + factor·b`.
pub fn plus(a: &[f64], factor: f64, b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + factor * b).collect()
}

/// One to five cells an axis, any rim that leaves something free, cells of any shape.
fn random_lattice(random: &mut Random, cubic: bool) -> Lattice<f64> {
    let h = 0.3 + random.unit();
    let mut axis = |a: usize| {
        let cells = 1 + random.below(5);
        let rim = if cells > 3 && random.unit() < 0.6 {
            Rim::Fixed
        } else {
            Rim::Free
        };
        let fixed = if rim == Rim::Fixed { 6 } else { 0 };
        let samples = (cells + 3 - fixed).max(4) + 2 * cells + random.below(4);
        let spacing = if cubic { h } else { 0.2 + random.unit() };
        let knots = KnotVector::clamped_uniform(3, cells, 0.0, 1.0).unwrap();
        Axis::new(a, knots, rim, samples, spacing * (samples - 1) as f64).unwrap()
    };
    Lattice::new([axis(0), axis(1), axis(2)])
}

#[test]
fn the_tensor_path_multiplies_as_sparse_forms() {
    let mut worst = 0.0_f64;
    for seed in 0..SEEDS {
        let mut random = Random(seed);
        let neighbours = [Neighbours::Six, Neighbours::Eighteen, Neighbours::TwentySix][seed as usize % 3];
        let lattice = random_lattice(&mut random, neighbours != Neighbours::Six);
        let (n, m) = (lattice.coefficient_count(), lattice.sample_count());
        let matter = painted(&mut random, m, 4.0);
        let d = random.list(m);
        let scale = 0.1 + random.unit();
        let law = Law::Linear { scale };
        let patch = Patch::new(lattice, matter, law, neighbours, &d, SolverOptions::default()).unwrap();
        let (lattice, forms) = (patch.lattice(), patch.sparse_forms());
        let lumped = patch.matter().lumped::<f64>(lattice, neighbours).unwrap();
        let (p, g) = (random.list(n), random.list(m));
        let (mut sampled, mut gathered, mut w) = (vec![0.0; m], vec![0.0; n], TensorWorkspace::new());
        lattice.sample(&p, &mut sampled, &mut w);
        lattice.gather(&g, &mut gathered, &mut w);
        let a = &forms.sampling;
        let mut errors = vec![
            apart(&sampled, &product(a.matrix(), &p)),
            apart(&gathered, &product(a.transposed(), &g)),
        ];
        let sigma2 = scale * scale;
        let slack = |mut s: Vec<SpringWeights<f64>>, factor: f64| {
            for s in &mut s {
                s.weights = s.weights.scaled(factor);
            }
            s
        };
        let springs = lumped.springs;
        let cases = [
            (lumped.mass, slack(springs.clone(), 0.0), &forms.mass),
            (lumped.damping, slack(springs.clone(), 0.0), &forms.damping),
            (
                lumped.ground.scaled(sigma2),
                slack(springs, sigma2),
                &forms.stiffness,
            ),
        ];
        for (diagonal, springs, form) in cases {
            let s = StepMatrix::new(lattice.sample_dims(), diagonal, springs);
            let mut q = vec![0.0; m];
            s.apply(&sampled, &mut q);
            lattice.gather(&q, &mut gathered, &mut w);
            errors.push(apart(&gathered, &product(form, &p)));
        }
        for e in errors {
            worst = worst.max(e);
            assert!(e < 1e-13, "seed {seed}: {e:.1e}");
        }
    }
    println!("products: {worst:.1e}");
}

/// A factor, or a V-cycle where it is due from 20 coefficients on.
fn solver(random: &mut Random) -> SolverOptions {
    if random.unit() < 0.6 {
        return SolverOptions::default();
    }
    SolverOptions {
        direct_limit: 20,
        background_limit: 0,
        iterations: 300,
        tolerance: Some(1e-13),
        ..SolverOptions::default()
    }
}

/// A random field on three levels, cells of any shape, and a region of one of its levels with paint, a load and a motion.
pub fn random_region(random: &mut Random) -> (HierarchicalSpline<f64>, Region<f64>) {
    let spacing = DVec3::from_array([0; 3].map(|_| 0.5 + random.unit()));
    let lattice = FieldLattice {
        world_from_lattice: DAffine3::from_mat3_translation(DMat3::from_diagonal(spacing), DVec3::splat(3.0)),
        cells: [12, 9, 11],
    };
    let levels = (0..3).map(|level| {
        let n = lattice.cells_at(level).map(|n| n + 3);
        let mut bricks: LevelCorrections<f64> = BTreeMap::new();
        for x in 0..n[0] {
            for y in 0..n[1] {
                for z in 0..n[2] {
                    let key = BrickKey([x, y, z].map(|s| s / 8));
                    let brick = bricks
                        .entry(key)
                        .or_insert_with(|| Arc::new(Corrections::empty()));
                    let value = (random.unit() - 0.5) / (level + 1) as f64;
                    Arc::make_mut(brick).set([x, y, z].map(|s| s as usize % 8), value);
                }
            }
        }
        bricks
    });
    let field = HierarchicalSpline::from_corrections(lattice, 1.0, levels.collect());
    let level = random.below(3);
    let count = [0; 3].map(|_| 4 + random.below(5) as u32);
    let cells = Cells {
        level,
        first: std::array::from_fn(|a| {
            let room = lattice.cells_at(level)[a] - count[a];
            random.below(room as usize + 1) as u32
        }),
        count,
    };
    let options = RegionOptions {
        samples_per_cell: [0; 3].map(|_| 1.0 + random.unit()),
        solver: solver(random),
        ..RegionOptions::of(&field, level)
    };
    let mut region = Region::new(&field, cells, Matter::default(), &options).unwrap();
    let samples = region.patch().lattice().sample_count();
    region
        .patch_mut()
        .set_matter(painted(random, samples, 3.0))
        .unwrap();
    (field, region)
}

/// Pins on samples: soft and hard, if there are coefficients to spare.
pub fn pins(random: &mut Random, patch: &Patch<f64>) -> Vec<Constraint> {
    let count = if patch.lattice().coefficient_count() > 30 {
        3
    } else {
        0
    };
    let middle: [usize; 3] = patch.lattice().sample_dims().map(|m| m / 2);
    let [_, my, mz] = patch.lattice().sample_dims();
    let at = (0..count).map(|k| {
        let index = ((middle[0] + k) * my + middle[1]) * mz + middle[2];
        let on = On::Samples(vec![(index, 1.0), (index + 1, random.unit())]);
        Constraint {
            label: format!("pin {k}"),
            on,
            density: random.unit(),
            hold: if k == 0 { Hold::Spring(20.0) } else { Hold::Hard },
        }
    });
    at.collect()
}

/// What the sparse forms say of a patch: the forms, its hard rows with targets on `p`, and its soft ones. Coefficients are
/// those that move.
pub struct Reference {
    pub forms: SparseForms,
    moving: Vec<usize>,
    places: Vec<[usize; 3]>,
    hard: Vec<(Vec<f64>, f64)>,
    soft: Vec<(Vec<f64>, f64, f64)>,
}

impl Reference {
    pub fn new(patch: &Patch<f64>) -> Self {
        let forms = patch.sparse_forms();
        let [_, ny, nz] = patch.lattice().coefficient_dims();
        let sigma2 = patch.springs().law().scale().powi(2);
        let all = || (0..patch.lattice().coefficient_count()).collect();
        let moving: Vec<usize> = patch.mask().map_or_else(all, |m| m.moving().to_vec());
        let mut out = Self {
            places: moving
                .iter()
                .map(|i| [i / nz / ny, i / nz % ny, i % nz])
                .collect(),
            moving,
            forms,
            hard: Vec::new(),
            soft: Vec::new(),
        };
        let here = product(out.forms.sampling.matrix(), &out.state(patch).p);
        for c in patch.constraints() {
            let On::Samples(weights) = &c.on else {
                unreachable!("pins are on samples")
            };
            let mut of_samples = vec![0.0; here.len()];
            let mut target = c.density;
            for (i, w) in weights {
                of_samples[*i] = *w;
                target -= w * (patch.state().d[*i] - here[*i]);
            }
            let row = product(out.forms.sampling.transposed(), &of_samples);
            match c.hold {
                Hold::Hard => out.hard.push((row, target)),
                Hold::Spring(k) => out.soft.push((row, sigma2 * k, target)),
            }
        }
        out
    }

    /// Of all coefficients, those that move.
    pub fn of_moving(&self, all: &[f64]) -> Vec<f64> {
        self.moving.iter().map(|&i| all[i]).collect()
    }

    /// The state of a patch on them.
    pub fn state(&self, patch: &Patch<f64>) -> State<f64> {
        let state = patch.state();
        State {
            p: self.of_moving(&state.p),
            v: self.of_moving(&state.v),
            ..state.clone()
        }
    }

    /// `Hx = b` with `Cx` given.
    pub fn solve(&self, h: &CsMat<f64>, b: &[f64], c: &[f64]) -> Vec<f64> {
        let mut factor = SparseCholesky::plan(h, nested_dissection(h, &self.places));
        factor.factorize(h).unwrap();
        let mut solved = |b: &[f64]| {
            let mut x = b.to_vec();
            factor.solve(&mut x);
            // One refinement.
            let mut rest = plus(b, -1.0, &product(h, &x));
            factor.solve(&mut rest);
            plus(&x, 1.0, &rest)
        };
        let mut x = solved(b);
        let columns: Vec<Vec<f64>> = self.hard.iter().map(|(row, _)| solved(row)).collect();
        let k = columns.len();
        if k > 0 {
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let schur = DMatrix::from_fn(k, k, |i, j| dot(&self.hard[i].0, &columns[j]));
            let gap = DVector::from_fn(k, |i, _| c[i] - dot(&self.hard[i].0, &x));
            let pull = schur.lu().solve(&gap).unwrap();
            for (column, pull) in columns.iter().zip(pull.iter()) {
                x = plus(&x, *pull, column);
            }
        }
        x
    }

    /// All forces on the coefficients but damping.
    fn force(&self, patch: &Patch<f64>, state: &State<f64>, external: &[f64], rest: &[f64]) -> Vec<f64> {
        let mut force = external.to_vec();
        patch.springs().clone().add_forces(&state.d, &mut force);
        let sigma2 = patch.springs().law().scale().powi(2);
        for (i, f) in force.iter_mut().enumerate() {
            let (share, source) = patch.mask().map_or((1.0, i), |m| match (m.rim(), m.inside()[i]) {
                (Rim::Free, false) => (OUTSIDE, m.nearest(i)),
                _ => (1.0, i),
            });
            *f -= share
                * sigma2
                * patch.matter().ground.at(source)
                * patch.lattice().sample_volume()
                * (state.d[i] - rest[i]);
        }
        let mut on = product(self.forms.sampling.transposed(), &force);
        for (row, k, target) in &self.soft {
            let gap: f64 = target - row.iter().zip(&state.p).map(|(r, p)| r * p).sum::<f64>();
            on = plus(&on, k * gap, row);
        }
        on
    }

    /// What is missing to the hard constraints, less `rate` times their velocity.
    fn gaps(&self, state: &State<f64>) -> Vec<f64> {
        let gap = |(row, target): &(Vec<f64>, f64)| {
            target - row.iter().zip(&state.p).map(|(r, p)| r * p).sum::<f64>()
        };
        self.hard.iter().map(gap).collect()
    }
}

/// By how much a step of a patch differs from that of the sparse forms, relative to its increment and its velocity. Forces
/// and rest are those of the samples inside.
pub fn error_of_step(
    patch: &mut Patch<f64>,
    integrator: Integrator,
    dt: f64,
    external: &[f64],
    rest: &[f64],
) -> f64 {
    let reference = Reference::new(patch);
    let SparseForms {
        mass,
        damping,
        sampling,
        ..
    } = &reference.forms;
    let start = reference.state(patch);
    let force = reference.force(patch, &start, external, rest);
    let times = |factor: f64, v: &[f64]| v.iter().map(|v| factor * v).collect::<Vec<f64>>();
    let (moved, velocity) = if integrator == Integrator::Paper {
        let h = reference.forms.step(0.5 * dt, dt * dt);
        let b = product(mass, &times(dt, &start.v));
        let b = plus(&b, -0.5 * dt * dt, &product(damping, &start.v));
        let x = reference.solve(&h, &plus(&b, dt * dt, &force), &reference.gaps(&start));
        let v = times(1.0 / dt, &x);
        (x, v)
    } else {
        // Trapezoidal rule to γΔt, then backward differences, written as in the documentation.
        let gamma = 2.0 - 2f64.sqrt();
        let beta = (1.0 - gamma).powi(2) / (gamma * (2.0 - gamma));
        let c = 0.5 * gamma * dt;
        let h = reference.forms.step(c, c * c);
        let b = product(mass, &times(2.0 * c, &start.v));
        let e = reference.solve(&h, &plus(&b, 2.0 * c * c, &force), &reference.gaps(&start));
        let middle = State {
            p: plus(&start.p, 1.0, &e),
            v: plus(&times(1.0 / c, &e), -1.0, &start.v),
            d: plus(&start.d, 1.0, &product(sampling.matrix(), &e)),
            w: Vec::new(),
        };
        let force = reference.force(patch, &middle, external, rest);
        let mixed = plus(&times(1.0 + beta, &middle.v), -beta, &start.v);
        let b = times(c, &product(mass, &mixed));
        let b = plus(&b, beta, &product(mass, &e));
        let b = plus(&b, beta * c, &product(damping, &e));
        let x = reference.solve(&h, &plus(&b, c * c, &force), &reference.gaps(&middle));
        let v = times(1.0 / c, &plus(&x, -beta, &e));
        (plus(&x, 1.0, &e), v)
    };
    patch.step(integrator, dt).unwrap();
    let increment = plus(&patch.state().d, -1.0, &start.d);
    let exact = product(sampling.matrix(), &moved);
    let rates = product(sampling.matrix(), &velocity);
    apart(&increment, &exact).max(apart(&patch.state().w, &rates))
}

#[test]
fn steps_of_random_regions_are_those_of_sparse_forms() {
    let mut worst = [0.0_f64; 2];
    for seed in 0..SEEDS {
        let mut random = Random(100 + seed);
        let (_, mut region) = random_region(&mut random);
        let rest = region.patch().state().d.clone();
        let constraints = pins(&mut random, region.patch());
        let count = region.patch().lattice().coefficient_count();
        let external = random.list(rest.len());
        let (p, v) = (random.list(count), random.list(count));
        let patch = region.patch_mut();
        patch.set_constraints(&constraints).unwrap();
        patch.set_state(&p, &v).unwrap();
        patch.set_force(&external).unwrap();
        let dt = 0.05 * 10f64.powf(2.0 * random.unit());
        for (k, integrator) in [Integrator::Paper, Integrator::TrBdf2].into_iter().enumerate() {
            let mut patch = region.patch().clone();
            let e = error_of_step(&mut patch, integrator, dt, &external, &rest);
            worst[k] = worst[k].max(e);
            let dims = patch.lattice().coefficient_dims();
            let name = integrator.name();
            assert!(
                e < 1e-11,
                "seed {seed}, {name}: {e:.1e}, Δt {dt:.2}, {dims:?} coefficients"
            );
        }
    }
    println!("steps: {worst:?}");
}

#[test]
fn rest_and_responses_of_random_regions_are_those_of_sparse_forms() {
    let mut worst = [0.0_f64; 2];
    for seed in 0..SEEDS {
        let mut random = Random(200 + seed);
        let (_, mut region) = random_region(&mut random);
        let constraints = pins(&mut random, region.patch());
        let patch = region.patch_mut();
        patch.set_constraints(&constraints).unwrap();
        let dims = patch.lattice().sample_dims();
        let at = SampleBox {
            first: dims.map(|m| m / 3),
            count: dims.map(|m| m.div_ceil(3)),
        };
        let values = random.list(at.len());
        let load = OnBox { at, values: &values };
        let mut all = vec![0.0; patch.lattice().sample_count()];
        for (i, v) in at.indices(dims).zip(&values) {
            all[i] = *v;
        }
        let dt = 0.2;
        let reference = Reference::new(patch);
        let b = product(reference.forms.sampling.transposed(), &all);
        let none = vec![0.0; reference.hard.len()];
        let h = reference.forms.step(0.5 * dt, dt * dt);
        let scaled: Vec<f64> = b.iter().map(|b| dt * dt * b).collect();
        let exact = [
            reference.solve(&h, &scaled, &none),
            reference.solve(&reference.forms.stiffness, &b, &none),
        ];
        let found = [
            patch.respond(Integrator::Paper, dt, &[load]).unwrap(),
            patch.static_response(Against::Painted, &[load]).unwrap(),
        ];
        for k in 0..2 {
            let d = product(reference.forms.sampling.matrix(), &exact[k]);
            let e = apart(&found[k][0].d, &d).max(apart(&found[k][0].p, &exact[k]));
            worst[k] = worst[k].max(e);
            assert!(e < 1e-8, "seed {seed}: {} {e:.1e}", ["response", "rest"][k]);
        }
    }
    println!("response and rest: {worst:?}");
}

#[test]
fn tangents_of_the_four_d_law_are_in_the_sparse_forms() {
    for seed in 0..6 {
        let mut random = Random(300 + seed);
        let lattice = random_lattice(&mut random, true);
        let (n, m) = (lattice.coefficient_count(), lattice.sample_count());
        let d: Vec<f64> = random.list(m).iter().map(|v| 2.0 * v).collect();
        let law = Law::FourD { scale: 1.5 };
        let options = SolverOptions::default();
        let matter = painted(&mut random, m, 2.0);
        let mut patch = Patch::new(lattice, matter, law, Neighbours::Eighteen, &d, options).unwrap();
        let p: Vec<f64> = random.list(n).iter().map(|p| 0.3 * p).collect();
        patch.set_state(&p, &vec![0.0; n]).unwrap();
        let load = random.list(m);
        let load = OnBox {
            at: patch.lattice().all_samples(),
            values: &load,
        };
        let reference = Reference::new(&patch);
        let b = product(reference.forms.sampling.transposed(), load.values);
        let dt = 0.5;
        let scaled: Vec<f64> = b.iter().map(|b| dt * dt * b).collect();
        let exact = reference.solve(&reference.forms.step(0.5 * dt, dt * dt), &scaled, &[]);
        let found = patch.respond(Integrator::Paper, dt, &[load]).unwrap();
        let d = product(reference.forms.sampling.matrix(), &exact);
        let e = apart(&found[0].d, &d);
        assert!(e < 1e-11, "seed {seed}: {e:.1e}");
    }
}
