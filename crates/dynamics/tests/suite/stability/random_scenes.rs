//! Random scenes: patterns of material, laws, integrators, steps, precisions, constraints and forces, put together by
//! chance. In each all numbers stay finite, energy comes from nowhere but the forces, and the same scene gives the same
//! bits on any thread.

use bspline::Real;
use dynamics::constraints::{Constraint, Hold, On};
use dynamics::integrators::{AdaptiveOptions, Integrator};
use dynamics::lattice::{Lattice, Rim};
use dynamics::matter::{Matter, Quantity};
use dynamics::patch::{Patch, PatchError};
use dynamics::solve::SolverOptions;
use dynamics::springs::{Law, Neighbours, Plasticity, Weights};

/// Numbers in `0..1`.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        ((z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Evenly spread logarithms.
    fn magnitude(&mut self, low: f64, high: f64) -> f64 {
        10f64.powf(self.within(low, high))
    }

    fn one_of<V: Copy>(&mut self, of: &[V]) -> V {
        of[(self.unit() * of.len() as f64) as usize]
    }

    fn chance(&mut self, share: f64) -> bool {
        self.unit() < share
    }

    /// 1 outside and `inside` in a ball, a half, a plate, single samples, or samples at random between.
    fn pattern(&mut self, dims: [usize; 3], inside: f64) -> Quantity {
        let kind = self.one_of(&[0, 1, 2, 3, 4, 5]);
        let [mx, my, mz] = dims;
        let plate = (self.unit() * mx as f64) as usize;
        let values = (0..mx * my * mz).map(|i| {
            let at = [i / (my * mz), i / mz % my, i % mz];
            let share = |a: usize| at[a] as f64 / (dims[a] - 1) as f64;
            match kind {
                0 => 1.0,
                1 if (0..3).map(|a| (share(a) - 0.4).powi(2)).sum::<f64>() < 0.08 => inside,
                2 if share(2) < 0.45 => inside,
                3 if at[0] == plate => inside,
                4 if self.chance(0.3) => inside,
                5 => inside.powf(self.unit()),
                _ => 1.0,
            }
        });
        let values: Vec<f64> = values.collect();
        if kind == 0 {
            Quantity::Constant(inside)
        } else {
            Quantity::PerSample(values)
        }
    }
}

/// What became of a scene.
#[derive(Debug, PartialEq)]
struct Outcome {
    /// Of the state at the end.
    bits: Vec<u64>,
    refused: Vec<String>,
}

/// Runs scene number `seed`.
fn play<T: Real>(seed: u64) -> Result<Outcome, String> {
    let mut random = Random(seed.wrapping_mul(0x1234_5678_9abc_def1));
    let r = &mut random;
    let rim = r.one_of(&[Rim::Fixed, Rim::Free]);
    let coefficients = match rim {
        Rim::Fixed => 7 + (r.unit() * 6.0) as usize,
        Rim::Free => 4 + (r.unit() * 7.0) as usize,
    };
    let free = match rim {
        Rim::Fixed => coefficients - 6,
        Rim::Free => coefficients,
    };
    let samples = (free + (r.unit() * 5.0) as usize).max(2).max(coefficients.min(6));
    let spacing = r.magnitude(-3.0, 3.0);
    let lattice = match Lattice::<T>::cube(coefficients, samples, rim, spacing) {
        Ok(lattice) => lattice,
        Err(_) => {
            return Ok(Outcome {
                bits: vec![],
                refused: vec![],
            });
        }
    };
    let dims = lattice.sample_dims();
    let count = lattice.sample_count();
    // Of a distance field, of CT numbers, of something tiny.
    let size = r.one_of(&[1.0, 1.0, 1000.0, 1e-6]);
    let scale = spacing / size;
    let law = if r.chance(0.4) {
        Law::FourD { scale }
    } else {
        Law::Linear { scale }
    };
    let neighbours = r.one_of(&[Neighbours::Six, Neighbours::Eighteen, Neighbours::TwentySix]);
    let contrast = r.magnitude(-4.0, 4.0);
    let stiffness = r.pattern(dims, contrast);
    let heavy = r.magnitude(-2.0, 3.0);
    let mut mass = r.pattern(dims, heavy);
    if r.chance(0.5) {
        mass = Quantity::Constant(1.0);
    }
    let damping = if r.chance(0.5) {
        r.magnitude(-2.0, 1.0)
    } else {
        0.0
    };
    let damping = r.pattern(dims, damping);
    let unit = (size / spacing).powi(2);
    let scaled = |q: Quantity, by: f64| match q {
        Quantity::Constant(v) => Quantity::Constant(v * by),
        Quantity::PerSample(v) => Quantity::PerSample(v.iter().map(|v| v * by).collect()),
    };
    // A frequency of about one for the lattice, whatever its spacing.
    let matter = Matter {
        stiffness,
        mass: scaled(mass, 1.0 / unit),
        damping: scaled(damping, 1.0 / unit),
        ground: Quantity::Constant(if r.chance(0.3) {
            0.01 / spacing.powi(2)
        } else {
            0.0
        }),
        spring_factors: None,
    };
    let steepness = r.one_of(&[0.0, 1.0, 1.0, 20.0]);
    let d: Vec<T> = (0..count)
        .map(|i| {
            let x = (i / (dims[1] * dims[2])) as f64;
            T::from_f64(size * (steepness * (0.4 * dims[0] as f64 - x) + 0.1 * r.unit()))
        })
        .collect();
    let options = SolverOptions {
        direct_limit: r.one_of(&[1000, 1000, 20]),
        background_limit: r.one_of(&[6000, 30]),
        ..SolverOptions::default()
    };
    let place = |e: PatchError| format!("made: {e}");
    let mut p = Patch::new(lattice, matter, law, neighbours, &d, options).map_err(place)?;
    if r.chance(0.2) {
        p.springs_mut().rest_mut().scale = Weights::Constant(T::from_f64(r.within(0.5, 1.6)));
    }
    if r.chance(0.25) {
        let rate = r.magnitude(-1.0, 1.0);
        p.set_plasticity(Plasticity::Clay { rate }).map_err(place)?;
    }
    let mut refused = Vec::new();
    if r.chance(0.35) {
        let constraints = (0..1 + (r.unit() * 3.0) as usize).map(|i| {
            let sample = (r.unit() * count as f64) as usize;
            let hold = if r.chance(0.5) {
                Hold::Hard
            } else {
                Hold::Spring(r.magnitude(-3.0, 3.0) * spacing)
            };
            Constraint {
                label: format!("{i}"),
                on: On::Samples(vec![(sample, 1.0)]),
                density: d[sample].as_f64() + size * r.within(-1.0, 1.0),
                hold,
            }
        });
        let constraints: Vec<_> = constraints.collect();
        // At the rim nothing may move, so some contradict it.
        if let Err(e) = p.set_constraints(&constraints) {
            refused.push(e.to_string());
        }
    }
    let push = size * r.magnitude(-2.0, 0.5) * spacing.powi(3) / unit;
    let force: Vec<T> = (0..count)
        .map(|_| T::from_f64(push * r.within(-1.0, 1.0)))
        .collect();
    let limit = p.explicit_limit().map_err(place)?;
    let limit = if limit.is_finite() { limit } else { 1.0 };
    let scheme = r.one_of(&[
        Some(Integrator::Paper),
        Some(Integrator::TrBdf2),
        Some(Integrator::Symplectic),
        Some(Integrator::Verlet),
        Some(Integrator::Auto),
        None,
    ]);
    let explicit = matches!(scheme, Some(Integrator::Symplectic | Integrator::Verlet));
    let dt = limit
        * if explicit {
            r.within(0.05, 0.94)
        } else {
            r.magnitude(-1.0, 2.0)
        };
    let adaptive = AdaptiveOptions {
        tolerance: 1e-2 * size,
        shortest: 1e-4 * dt,
        longest: 4.0 * dt,
        energy_gain: 0.01,
        acceleration: None,
    };
    let told = format!(
        "{} {coefficients}/{samples} {rim:?} {law:?} {neighbours:?} {scheme:?} dt {:.2} limits, contrast {contrast:.1e}, mass \
         {heavy:.1e}, constraints {}, {:?}, steep {steepness}, size {size}",
        T::NAME,
        dt / limit,
        p.constraints().len(),
        options.direct_limit,
    );
    let (mut gained, mut largest) = (0.0_f64, p.energy().total());
    let clay = !matches!(p.plasticity(), Plasticity::Elastic);
    for step in 0..12 {
        if step == 0 || step == 6 {
            let zero = vec![T::zero(); count];
            p.set_force(if step == 0 { &force } else { &zero })
                .map_err(place)?;
        }
        let before = p.energy().total();
        let result = match scheme {
            Some(integrator) => p.step(integrator, dt),
            None => p.adaptive_step(dt, &adaptive).map(|a| {
                if a.gained > 0.02 && a.step.dt > 1.01 * adaptive.shortest {
                    refused.push(format!("adaptive gained {:.2e} in {:.2e}", a.gained, a.step.dt));
                }
                a.step
            }),
        };
        let report = match result {
            Ok(report) => report,
            Err(e) => return Err(format!("step {step}: {e}; {told}")),
        };
        let state = p.state();
        let lists = [&state.p, &state.v, &state.d, &state.w];
        if !lists.iter().all(|l| l.iter().all(|v| v.is_finite())) {
            return Err(format!("step {step}: not finite; {told}"));
        }
        if !(report.work.is_finite() && report.solve.iteration.residual.is_finite()) {
            return Err(format!("step {step}: {report:?}; {told}"));
        }
        let after = p.energy().total();
        gained += after - before - report.work;
        largest = largest.max(after).max(report.work.abs());
    }
    // Explicit schemes keep an energy near the true one; 4-D springs are not convex, so only step control bounds them.
    let allowed = match (scheme, law) {
        (Some(Integrator::Paper | Integrator::TrBdf2), Law::Linear { .. }) => 0.02,
        (None, _) => 0.15,
        (_, Law::Linear { .. }) => 1.0,
        _ => f64::INFINITY,
    };
    // In single precision springs are stretched by the rounding of their densities too.
    let stiffest = (0..count).fold(0.0_f64, |m, i| m.max(p.matter().stiffness.at(i)));
    let dense = p.state().d.iter().fold(0.0_f64, |m, d| m.max(d.as_f64().abs()));
    let rounding = count as f64 * stiffest * spacing * (scale * T::UNIT_ROUND_OFF * dense).powi(2);
    if gained > allowed * largest && largest > 1e5 * rounding && !clay {
        return Err(format!(
            "{:.2e} of {largest:.2e} gained; {told}",
            gained / largest
        ));
    }
    let state = p.state();
    let all = state.p.iter().chain(&state.v).chain(&state.d).chain(&state.w);
    let bits = all.map(|v| v.as_f64().to_bits()).collect();
    Ok(Outcome { bits, refused })
}

/// What is wrong with the scenes of some seeds, each in the precision that its number says.
fn failures(seeds: impl Iterator<Item = u64>) -> Vec<String> {
    let seeds: Vec<u64> = seeds.collect();
    let run = |seed: u64| {
        if seed.is_multiple_of(2) {
            play::<f32>(seed)
        } else {
            play::<f64>(seed)
        }
    };
    let alone: Vec<_> = seeds.iter().map(|s| run(*s)).collect();
    let mut wrong: Vec<String> = Vec::new();
    for (seed, outcome) in seeds.iter().zip(&alone) {
        match outcome {
            Err(e) => wrong.push(format!("{seed}: {e}")),
            Ok(o) => o.refused.iter().for_each(|e| println!("{seed}: {e}")),
        }
    }
    for threads in [1, 2, 8] {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let again: Vec<_> = pool.install(|| {
            use rayon::prelude::*;
            let some: Vec<u64> = seeds.iter().copied().step_by(5).collect();
            some.into_par_iter().map(run).collect()
        });
        for (k, outcome) in again.iter().enumerate() {
            if *outcome != alone[5 * k] {
                wrong.push(format!("{}: other bits on {threads} threads", seeds[5 * k]));
            }
        }
    }
    wrong
}

#[test]
fn random_scenes_stay_finite_and_gain_nothing() {
    // Some were wrong once: among them lattices of no rank, whose factors failed.
    let once = [1291, 1404, 1724, 3039, 3162, 4150, 4880, 5292, 6291, 6902];
    let wrong = failures((0..150).chain(once));
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
#[ignore = "minutes"]
fn many_random_scenes() {
    let wrong = failures(1000..2200);
    assert!(wrong.is_empty(), "{} wrong\n{}", wrong.len(), wrong.join("\n"));
}
