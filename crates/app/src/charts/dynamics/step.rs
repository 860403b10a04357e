//! Steps of a patch that is painted as in the study, against the same in double precision with a direct solve.

use bspline::Real;
use dynamics::integrators::{Integrator, StepReport};
use dynamics::lattice::{Lattice, LatticeError};
use dynamics::matter::Matter;
use dynamics::patch::{Patch, PatchError};
use dynamics::solve::{Method, SolverOptions};
use dynamics::springs::{Law, Weights};
use dynamics::study::{Configuration, loads, spring_weights};

use super::{DynamicsError, median_seconds};

/// A patch of the study at rest.
pub fn patch<T: Real>(c: &Configuration, options: SolverOptions) -> Result<Patch<T>, DynamicsError> {
    patch_of(c, options, false)
}

/// `painted`: even material is given per spring, so that it is solved as if it were painted.
fn patch_of<T: Real>(
    c: &Configuration,
    options: SolverOptions,
    painted: bool,
) -> Result<Patch<T>, DynamicsError> {
    let m = c.samples;
    let lattice = |e: LatticeError| DynamicsError::Study(e.into());
    let lattice = Lattice::cube(c.coefficients, m, c.rim, 1.0).map_err(lattice)?;
    let springs = spring_weights(c.pattern, c.contrast, m, c.neighbours, 1.0);
    let constant = |w: &Weights<f64>| matches!(w, Weights::Constant(_));
    let factors = springs.iter().map(|s| {
        let share = s.direction.share;
        (0..m * m * m).map(|i| s.weights.at(i) / share).collect()
    });
    let matter = Matter {
        spring_factors: (painted || !springs.iter().all(|s| constant(&s.weights))).then(|| factors.collect()),
        ..Matter::default()
    };
    // The distance field of a ball, as the study has for the tangents of the 4-D law.
    let centre = 0.45 * (m - 1) as f64;
    let distance = |i: usize| {
        let p = [i / (m * m), i / m % m, i % m];
        let r2: f64 = p.iter().map(|c| (*c as f64 - centre).powi(2)).sum();
        T::from_f64(0.5 * centre - r2.sqrt())
    };
    let d: Vec<T> = (0..m * m * m).map(distance).collect();
    let law = if c.four_d {
        Law::FourD { scale: 1.0 }
    } else {
        Law::Linear { scale: 1.0 }
    };
    Ok(Patch::new(lattice, matter, law, c.neighbours, &d, options)?)
}

/// Increments of the densities by one step from rest, under each of the loads.
pub struct Increments {
    integrator: Integrator,
    dt: f64,
    /// Forces, of the size at which the change is compared.
    forces: Vec<Vec<f64>>,
    exact: Vec<Vec<f64>>,
}

/// What a patch made of them.
pub struct Stepped {
    /// The worst error of an increment.
    pub error: f64,
    /// Most iterations of a solve.
    pub iterations: usize,
    /// How it was solved.
    pub method: &'static str,
    /// Median of the steps.
    pub seconds: f64,
}

/// Largest change of a density by a load over the distance of the samples: as far as a tool moves matter in a step, and so
/// little of 4-D springs that their tangents stay.
const LINEAR: f64 = 1.0;
const FOUR_D: f64 = 0.1;

/// Steps in which any factor is made.
const SETTLED: usize = 400;

impl Increments {
    /// Solves directly in double precision.
    pub fn new(c: &Configuration, integrator: Integrator) -> Result<Self, DynamicsError> {
        let options = SolverOptions {
            // Beyond the limit it is iterated until rounding stops it.
            iterations: 400,
            tolerance: Some(1e-13),
            direct_limit: 6000,
            ..SolverOptions::default()
        };
        // A factor, also where fast diagonalization would do.
        let mut patch = patch_of::<f64>(c, options, true)?;
        let dt = c.dt_over_limit * patch.explicit_limit()?;
        let mut out = Self {
            integrator,
            dt,
            forces: Vec::new(),
            exact: Vec::new(),
        };
        let size = if c.four_d { FOUR_D } else { LINEAR };
        for load in loads(c.samples) {
            // A first trial tells the size.
            let trial: Vec<f64> = load.iter().map(|f| f / (dt * dt) * size).collect();
            let (moved, _) = out.one(&mut patch, &trial)?;
            let largest = moved.iter().fold(0.0f64, |a, x| a.max(x.abs()));
            let force: Vec<f64> = trial.iter().map(|f| f * size / largest).collect();
            out.exact.push(out.one(&mut patch, &force)?.0);
            out.forces.push(force);
        }
        Ok(out)
    }

    fn one<T: Real>(
        &self,
        patch: &mut Patch<T>,
        force: &[f64],
    ) -> Result<(Vec<f64>, StepReport), PatchError> {
        let n = patch.lattice().coefficient_count();
        let zeros = vec![T::zero(); n];
        patch.set_state(&zeros, &zeros)?;
        let force: Vec<T> = force.iter().map(|f| T::from_f64(*f)).collect();
        patch.set_force(&force)?;
        let report = patch.step(self.integrator, self.dt)?;
        // From the coefficients: the change of a density is much smaller than the density.
        let mut x = vec![T::zero(); patch.lattice().sample_count()];
        let mut w = dynamics::lattice::TensorWorkspace::new();
        let p = patch.state().p.clone();
        patch.lattice().sample(&p, &mut x, &mut w);
        Ok((x.into_iter().map(|x| x.as_f64()).collect(), report))
    }

    /// Steps until the factor is there that is made beside the steps, if one is.
    fn settle<T: Real>(&self, patch: &mut Patch<T>) -> Result<(), PatchError> {
        let options = SolverOptions::default();
        if !(options.direct_limit..=options.background_limit).contains(&patch.lattice().coefficient_count()) {
            return Ok(());
        }
        for _ in 0..SETTLED {
            if patch.step(self.integrator, self.dt)?.solve.method != Method::VCycle {
                break;
            }
        }
        Ok(())
    }

    /// What the default solver makes of them in precision `T`.
    pub fn judge<T: Real>(&self, c: &Configuration, clock: fn() -> f64) -> Result<Stepped, DynamicsError> {
        let mut patch = patch::<T>(c, SolverOptions::default())?;
        self.settle(&mut patch)?;
        let mut out = Stepped {
            error: 0.0,
            iterations: 0,
            method: "",
            seconds: 0.0,
        };
        for (force, exact) in self.forces.iter().zip(&self.exact) {
            let (moved, report) = self.one(&mut patch, force)?;
            let wrong: f64 = moved.iter().zip(exact).map(|(a, b)| (a - b).powi(2)).sum();
            let size: f64 = exact.iter().map(|b| b * b).sum();
            out.error = out.error.max((wrong / size).sqrt());
            out.iterations = out.iterations.max(report.solve.iteration.iterations);
            out.method = report.solve.method.name();
        }
        let mut failed = None;
        out.seconds = median_seconds(clock, || {
            if let Err(e) = patch.step(self.integrator, self.dt) {
                failed = Some(e);
            }
        });
        match failed {
            Some(e) => Err(e.into()),
            None => Ok(out),
        }
    }
}
