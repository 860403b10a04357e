//! Solvers that are drawn beside the default one.

use bspline::Real;
use dynamics::lattice::TensorWorkspace;
use dynamics::solve::{SolveError, VCycleOptions};
use dynamics::springs::StepMatrix;
use dynamics::study::{
    CoefficientSystem, ConjugateGradients, Preconditioner, Reference, Solver, StepSolver, StudyError,
    Unpreconditioned, VCycle,
};

use super::{DynamicsError, median_seconds};

/// Median seconds of a solve of `cap` iterations.
pub fn solve_seconds<T: Real>(
    reference: &Reference,
    solver: Solver,
    cap: usize,
    clock: fn() -> f64,
) -> Result<f64, DynamicsError> {
    let (mut default, matrix) = reference.prepared::<T>(cap)?;
    let g = reference.load::<T>(0);
    let lattice = default.lattice().clone();
    let mut x = vec![T::zero(); lattice.coefficient_count()];
    let mut dx = g.clone();
    let steps: Vec<[isize; 3]> = matrix.springs.iter().map(|s| s.direction.step).collect();
    let cycle = |options: VCycleOptions| -> Result<VCycle<T>, DynamicsError> {
        let mut cycle = VCycle::new(&lattice, &steps, options);
        cycle
            .prepare(&matrix)
            .map_err(|e| StudyError::from(SolveError::from(e)))?;
        Ok(cycle)
    };
    Ok(match solver {
        Solver::Default | Solver::Bridge => {
            if solver == Solver::Default {
                default.settle();
            }
            median_seconds(clock, || {
                default.solve(&matrix, &g, &mut x, &mut dx);
            })
        }
        Solver::Plain => iterate(&default, &matrix, &mut Unpreconditioned, &g, cap, clock),
        Solver::ScaledDiagonalization => {
            let options = VCycleOptions {
                blocks: 0,
                direct_limit: x.len().saturating_sub(1),
                ..VCycleOptions::default()
            };
            let mut smoother = cycle(options)?.smoother().clone();
            iterate(&default, &matrix, &mut smoother, &g, cap, clock)
        }
        Solver::SmoothedCycle => {
            let options = VCycleOptions {
                blocks: 0,
                ..VCycleOptions::default()
            };
            iterate(&default, &matrix, &mut cycle(options)?, &g, cap, clock)
        }
    })
}

fn iterate<T: Real>(
    of: &StepSolver<T>,
    matrix: &StepMatrix<T>,
    preconditioner: &mut impl Preconditioner<T>,
    g: &[T],
    cap: usize,
    clock: fn() -> f64,
) -> f64 {
    let lattice = of.lattice();
    let zeros = |n: usize| vec![T::zero(); n];
    let n = lattice.coefficient_count();
    let (mut b, mut x, mut dx) = (zeros(n), zeros(n), zeros(g.len()));
    let mut samples = [zeros(g.len()), zeros(g.len())];
    let mut gradients = ConjugateGradients::new(n);
    let mut w = TensorWorkspace::new();
    median_seconds(clock, || {
        lattice.gather(g, &mut b, &mut w);
        let mut system = CoefficientSystem {
            lattice,
            matrix,
            preconditioner,
            samples: &mut samples,
            workspace: &mut w,
        };
        gradients.solve(&mut system, &b, &mut x, cap, 0.0);
        lattice.sample(&x, &mut dx, &mut w);
    })
}
