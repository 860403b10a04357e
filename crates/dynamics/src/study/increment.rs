//! The error of one increment against double precision, and the failures that it is measured beside.

use bspline::Real;

use super::patterns::{Pattern, loads, random_masses, spring_weights, unit_random};
use crate::integrators::largest_frequency;
use crate::lattice::{Lattice, LatticeError, Rim, TensorWorkspace};
use crate::solve::fast_diagonalization::FastDiagonalization;
use crate::solve::pcg::{CoefficientSystem, Unpreconditioned};
use crate::solve::{
    BandCholesky, ConjugateGradients, Galerkin, PcgReport, Preconditioner, SolveError, SolverOptions,
    StepSolver, VCycle, VCycleOptions,
};
use crate::springs::{Neighbours, SpringWeights, StepMatrix, Weights};

/// One cell of the study: a cube, its material, its step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Configuration {
    /// Coefficients along an axis, rim included.
    pub coefficients: usize,
    /// Samples along an axis.
    pub samples: usize,
    /// What the rim does.
    pub rim: Rim,
    /// Where stiffness is painted.
    pub pattern: Pattern,
    /// Largest stiffness over smallest.
    pub contrast: f64,
    /// Largest mass over smallest, at random per sample.
    pub mass_contrast: f64,
    /// Step over the limit of the explicit scheme.
    pub dt_over_limit: f64,
    /// Springs of each sample.
    pub neighbours: Neighbours,
    /// With the tangents that the 4-D law has at rest in a ball's distance field, instead of 1.
    pub four_d: bool,
}

/// The solver under test.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Solver {
    /// What a patch uses.
    Default,
    /// What it uses in the steps after painting, while a factor is made beside them; where none is, the default.
    Bridge,
    /// Conjugate gradients without preconditioner, as the source paper has them.
    Plain,
    /// Fast diagonalization between the square roots of the diagonals.
    ScaledDiagonalization,
    /// The V-cycle without blocks.
    SmoothedCycle,
}

impl Solver {
    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Default => "default",
            Self::Bridge => "bridge",
            Self::Plain => "none",
            Self::ScaledDiagonalization => "scaled-diagonalization",
            Self::SmoothedCycle => "v-cycle-without-blocks",
        }
    }
}

/// Why a configuration cannot be studied.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StudyError {
    /// The lattice.
    #[error(transparent)]
    Lattice(#[from] LatticeError),
    /// The solver.
    #[error(transparent)]
    Solve(#[from] SolveError),
}

/// A configuration in double precision with the exact increments of its loads.
#[derive(Clone, Debug)]
pub struct Reference {
    /// What it is of.
    pub configuration: Configuration,
    lattice: Lattice<f64>,
    matrix: StepMatrix<f64>,
    loads: Vec<Vec<f64>>,
    /// Exact increments of the densities.
    exact: Vec<Vec<f64>>,
    /// Residual of the reference, relative to the impulse; the worst of the loads.
    pub residual: f64,
}

/// What a solver left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// `‖A(x - x*)‖/‖Ax*‖`, the worst of the loads.
    pub increment_error: f64,
    /// Most iterations that a load took.
    pub iterations: usize,
    /// Largest residual, relative to the impulse.
    pub residual: f64,
    /// Name of the method.
    pub method: &'static str,
}

/// Coefficients up to which a reference is factorized; beyond it is iterated to the residual that it reports.
const DIRECT_REFERENCE: usize = 4000;

impl Reference {
    /// Solves the three loads of a configuration.
    ///
    /// # Errors
    /// [`StudyError`] if the configuration is impossible.
    pub fn new(configuration: Configuration) -> Result<Self, StudyError> {
        Self::made(configuration, false)
    }

    /// The same with half of all springs slack, each at random: a tangent factor `τ` of 0, as flattened 4-D springs have.
    ///
    /// # Errors
    /// [`StudyError`] if the configuration is impossible.
    pub fn with_slack_springs(configuration: Configuration) -> Result<Self, StudyError> {
        Self::made(configuration, true)
    }

    fn made(configuration: Configuration, slack: bool) -> Result<Self, StudyError> {
        let c = configuration;
        let m = c.samples;
        let lattice = Lattice::<f64>::cube(c.coefficients, m, c.rim, 1.0)?;
        let mut springs = spring_weights(c.pattern, c.contrast, m, c.neighbours, 1.0);
        if c.four_d {
            tangents_in_a_ball(&mut springs, m);
        }
        if slack {
            slacken(&mut springs, m);
        }
        let mass = if c.mass_contrast == 1.0 {
            Weights::Constant(1.0)
        } else {
            Weights::Each(random_masses(m, c.mass_contrast))
        };
        let without_springs = springs.iter().take(3).map(|s| SpringWeights {
            direction: s.direction,
            weights: Weights::Constant(0.0),
        });
        let mass_matrix = StepMatrix::new([m; 3], mass.clone(), without_springs.collect());
        let axial = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
        let mut mass_solver = StepSolver::new(lattice.clone(), &axial, SolverOptions::default());
        mass_solver.prepare(&mass_matrix)?;
        let stiffness = StepMatrix::new([m; 3], Weights::Constant(0.0), springs);
        let dt = c.dt_over_limit * 2.0 / largest_frequency(&stiffness, &[], &mass_matrix, &mut mass_solver);
        let scaled = stiffness.springs.iter().map(|s| SpringWeights {
            direction: s.direction,
            weights: s.weights.scaled(dt * dt),
        });
        let matrix = StepMatrix::new([m; 3], mass, scaled.collect());
        let mut out = Self {
            configuration,
            lattice,
            matrix,
            loads: loads(m).to_vec(),
            exact: Vec::new(),
            residual: 0.0,
        };
        out.solve()?;
        Ok(out)
    }

    fn solve(&mut self) -> Result<(), StudyError> {
        let n = self.lattice.coefficient_count();
        let steps = self.steps();
        let mut x = vec![0.0; n];
        let zeros = || vec![0.0; self.lattice.sample_count()];
        if self.lattice.is_square() || n > DIRECT_REFERENCE {
            let options = SolverOptions {
                iterations: 400,
                tolerance: Some(1e-13),
                v_cycle: VCycleOptions {
                    degree: 3,
                    ..VCycleOptions::default()
                },
                ..SolverOptions::default()
            };
            let mut solver = StepSolver::new(self.lattice.clone(), &steps, options);
            solver.prepare(&self.matrix)?;
            for g in &self.loads {
                let mut dx = zeros();
                let report = solver.solve(&self.matrix, g, &mut x, &mut dx);
                self.residual = self.residual.max(report.iteration.residual);
                self.exact.push(dx);
            }
            return Ok(());
        }
        let mut galerkin = Galerkin::new(&self.lattice, &steps);
        let mut factor = BandCholesky::<f64>::new(n, galerkin.band());
        galerkin.assemble(&self.matrix, &mut factor);
        factor.factorize().map_err(SolveError::from)?;
        for g in &self.loads {
            // The factor, refined by conjugate gradients until rounding stops it.
            let (dx, report) = self.iterate(&mut factor, g, 3, 0.0);
            self.residual = self.residual.max(report.residual);
            self.exact.push(dx);
        }
        Ok(())
    }

    fn steps(&self) -> Vec<[isize; 3]> {
        self.matrix.springs.iter().map(|s| s.direction.step).collect()
    }

    /// Conjugate gradients on the coefficients.
    fn iterate<T: Real>(
        &self,
        preconditioner: &mut impl Preconditioner<T>,
        g: &[f64],
        cap: usize,
        tolerance: f64,
    ) -> (Vec<T>, PcgReport) {
        let axes = self.lattice.axes().clone();
        let lattice = Lattice::<T>::new(axes);
        let matrix: StepMatrix<T> = self.matrix.convert();
        let mut w = TensorWorkspace::new();
        let g: Vec<T> = g.iter().map(|&v| T::from_f64(v)).collect();
        let zeros = |n: usize| vec![T::zero(); n];
        let n = lattice.coefficient_count();
        let (mut b, mut x, mut dx) = (zeros(n), zeros(n), zeros(g.len()));
        lattice.gather(&g, &mut b, &mut w);
        let mut system = CoefficientSystem {
            lattice: &lattice,
            matrix: &matrix,
            preconditioner,
            samples: &mut [zeros(g.len()), zeros(g.len())],
            workspace: &mut w,
        };
        let report = ConjugateGradients::new(n).solve(&mut system, &b, &mut x, cap, tolerance);
        lattice.sample(&x, &mut dx, &mut w);
        (dx, report)
    }

    /// What a solver makes of the loads in at most `cap` iterations, in precision `T`.
    ///
    /// # Errors
    /// [`StudyError::Solve`] if it cannot be prepared.
    pub fn judge<T: Real>(&self, solver: Solver, cap: usize) -> Result<Outcome, StudyError> {
        let matrix: StepMatrix<T> = self.matrix.convert();
        let lattice = Lattice::<T>::new(self.lattice.axes().clone());
        let mut out = Outcome {
            increment_error: 0.0,
            iterations: 0,
            residual: 0.0,
            method: solver.name(),
        };
        let steps = self.steps();
        match solver {
            Solver::Default | Solver::Bridge => {
                let settled = solver == Solver::Default;
                let (mut solver, matrix) = self.prepared::<T>(cap)?;
                if settled {
                    solver.settle();
                }
                out.method = solver.method().name();
                let mut x = vec![T::zero(); lattice.coefficient_count()];
                let mut dx = vec![T::zero(); lattice.sample_count()];
                for (g, exact) in self.loads.iter().zip(&self.exact) {
                    let g: Vec<T> = g.iter().map(|&v| T::from_f64(v)).collect();
                    let report = solver.solve(&matrix, &g, &mut x, &mut dx);
                    out.take(&dx, exact, report.iteration);
                }
            }
            Solver::Plain => self.judge_with(
                &mut Unpreconditioned,
                cap,
                &mut out,
                std::marker::PhantomData::<T>,
            ),
            Solver::ScaledDiagonalization => {
                // The smoother of a V-cycle is just that.
                let mut cycle = VCycle::new(
                    &lattice,
                    &steps,
                    VCycleOptions {
                        blocks: 0,
                        direct_limit: lattice.coefficient_count().saturating_sub(1),
                        ..VCycleOptions::default()
                    },
                );
                cycle.prepare(&matrix).map_err(SolveError::from)?;
                let mut smoother: FastDiagonalization<T> = cycle.smoother().clone();
                self.judge_with(&mut smoother, cap, &mut out, std::marker::PhantomData::<T>);
            }
            Solver::SmoothedCycle => {
                let options = VCycleOptions {
                    blocks: 0,
                    ..VCycleOptions::default()
                };
                let mut cycle = VCycle::new(&lattice, &steps, options);
                cycle.prepare(&matrix).map_err(SolveError::from)?;
                self.judge_with(&mut cycle, cap, &mut out, std::marker::PhantomData::<T>);
            }
        }
        Ok(out)
    }

    /// What a V-cycle with options of its own makes of the loads in at most `cap` iterations, in precision `T`.
    ///
    /// # Errors
    /// [`StudyError::Solve`] if it cannot be prepared.
    pub fn judge_cycle<T: Real>(&self, options: VCycleOptions, cap: usize) -> Result<Outcome, StudyError> {
        let matrix: StepMatrix<T> = self.matrix.convert();
        let lattice = Lattice::<T>::new(self.lattice.axes().clone());
        let mut cycle = VCycle::new(&lattice, &self.steps(), options);
        cycle.prepare(&matrix).map_err(SolveError::from)?;
        let mut out = Outcome {
            increment_error: 0.0,
            iterations: 0,
            residual: 0.0,
            method: "v-cycle",
        };
        self.judge_with(&mut cycle, cap, &mut out, std::marker::PhantomData::<T>);
        Ok(out)
    }

    /// The default solver, prepared, and its matrix: to be timed.
    ///
    /// # Errors
    /// [`StudyError::Solve`].
    pub fn prepared<T: Real>(&self, cap: usize) -> Result<(StepSolver<T>, StepMatrix<T>), StudyError> {
        let matrix: StepMatrix<T> = self.matrix.convert();
        let lattice = Lattice::<T>::new(self.lattice.axes().clone());
        let options = SolverOptions {
            iterations: cap,
            ..SolverOptions::default()
        };
        let mut solver = StepSolver::new(lattice, &self.steps(), options);
        solver.prepare(&matrix)?;
        Ok((solver, matrix))
    }

    /// The impulses of a load.
    pub fn load<T: Real>(&self, index: usize) -> Vec<T> {
        self.loads[index].iter().map(|&v| T::from_f64(v)).collect()
    }

    fn judge_with<T: Real>(
        &self,
        preconditioner: &mut impl Preconditioner<T>,
        cap: usize,
        out: &mut Outcome,
        _: std::marker::PhantomData<T>,
    ) {
        for (g, exact) in self.loads.iter().zip(&self.exact) {
            let (dx, report) = self.iterate::<T>(preconditioner, g, cap, 0.0);
            out.take(&dx, exact, report);
        }
    }
}

impl Outcome {
    fn take<T: Real>(&mut self, dx: &[T], exact: &[f64], report: PcgReport) {
        let wrong: f64 = dx.iter().zip(exact).map(|(a, b)| (a.as_f64() - b).powi(2)).sum();
        let size: f64 = exact.iter().map(|b| b * b).sum();
        self.increment_error = self.increment_error.max((wrong / size).sqrt());
        self.iterations = self.iterations.max(report.iterations);
        self.residual = self.residual.max(report.residual);
    }
}

/// Lets half of the springs of a cube be 0, each at random.
fn slacken(springs: &mut [SpringWeights<f64>], m: usize) {
    for (n, s) in springs.iter_mut().enumerate() {
        let kept = |i: usize| f64::from(unit_random((i * 31 + n) as u64 ^ 0x51AC) < 0.5);
        s.weights = Weights::Each((0..m * m * m).map(|i| kept(i) * s.weights.at(i)).collect());
    }
}

/// Multiplies the springs of a cube by the tangent factor `τ = Δ²/(h² + Δ²)` that 4-D springs have at rest in the
/// distance field of a ball.
fn tangents_in_a_ball(springs: &mut [SpringWeights<f64>], m: usize) {
    let centre = 0.45 * (m - 1) as f64;
    let distance = |p: [f64; 3]| p.iter().map(|c| (c - centre).powi(2)).sum::<f64>().sqrt();
    for s in springs {
        let weight = |i: usize| {
            let p = [i / (m * m), i / m % m, i % m].map(|c| c as f64);
            let q: [f64; 3] = std::array::from_fn(|a| p[a] + s.direction.step[a] as f64);
            let delta2 = (distance(p) - distance(q)).powi(2);
            s.weights.at(i) * delta2 / (s.direction.length().powi(2) + delta2)
        };
        s.weights = Weights::Each((0..m * m * m).map(weight).collect());
    }
}
