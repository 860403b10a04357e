//! The V-cycle for painted material: scaled fast diagonalization as smoother, every other knot as coarse space.

use bspline::Real;

use super::band_cholesky::{BandCholesky, NotPositive};
use super::dot::dot;
use super::fast_diagonalization::FastDiagonalization;
use super::galerkin::Galerkin;
use super::pcg::{Preconditioner, add_scaled};
use crate::lattice::{Lattice, TensorProduct, TensorWorkspace};
use crate::springs::{StepMatrix, Weights};

/// How a [`VCycle`] is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VCycleOptions {
    /// Degree of the Chebyshev polynomial of the smoother.
    pub degree: usize,
    /// Coefficients up to which a level is factorized.
    pub direct_limit: usize,
    /// Lanczos steps for the largest eigenvalue of the smoother.
    pub eigenvalue_steps: usize,
}

impl Default for VCycleOptions {
    fn default() -> Self {
        Self {
            degree: 2,
            direct_limit: 1400,
            eigenvalue_steps: 10,
        }
    }
}

/// Smoother of one level, and the way to the next.
#[derive(Clone, Debug)]
struct Level<T> {
    lattice: Lattice<T>,
    smoother: FastDiagonalization<T>,
    diagonal: Galerkin,
    /// Diagonal of `H` for unit mass, and for unit springs along each axis.
    unit_diagonals: [Vec<f64>; 4],
    largest_eigenvalue: f64,
    prolong: TensorProduct<T>,
    restrict: TensorProduct<T>,
    r: Vec<T>,
    d: Vec<T>,
    z: Vec<T>,
    q: Vec<T>,
}

/// The preconditioner; [`prepare`](VCycle::prepare) it for each matrix.
#[derive(Clone, Debug)]
pub struct VCycle<T> {
    options: VCycleOptions,
    levels: Vec<Level<T>>,
    coarsest: Lattice<T>,
    assembly: Galerkin,
    factor: BandCholesky<T>,
    right: Vec<Vec<T>>,
    solution: Vec<Vec<T>>,
    samples: [Vec<T>; 2],
    workspace: TensorWorkspace<T>,
}

/// Geometric mean of the weights, those far below the largest raised to it by `floor`.
fn geometric_mean<T: Real>(weights: &Weights<T>, floor: f64) -> f64 {
    match weights {
        Weights::Constant(w) => w.as_f64(),
        Weights::Each(w) => {
            let largest = w.iter().fold(0.0_f64, |m, w| m.max(w.as_f64()));
            let low = (floor * largest).max(f64::MIN_POSITIVE);
            let logs: f64 = w.iter().map(|w| w.as_f64().max(low).ln()).sum();
            (logs / w.len() as f64).exp()
        }
    }
}

impl<T: Real> VCycle<T> {
    /// The hierarchy of a lattice for springs of the given steps.
    pub fn new(lattice: &Lattice<T>, steps: &[[isize; 3]], options: VCycleOptions) -> Self {
        let mut levels = Vec::new();
        let mut here = lattice.clone();
        let zeros = |n: usize| vec![T::zero(); n];
        while here.coefficient_count() > options.direct_limit {
            let Some(half) = here.half() else { break };
            let [prolong, restrict] = here.prolongation(&half);
            let n = here.coefficient_count();
            let mut diagonal = Galerkin::diagonal(&here, &steps[..3]);
            let unit = |which: usize, diagonal: &mut Galerkin| {
                let weight = |k: usize| Weights::Constant(if k == which { T::one() } else { T::zero() });
                let springs = crate::springs::Neighbours::Six.directions();
                let springs =
                    springs
                        .iter()
                        .enumerate()
                        .map(|(k, &direction)| crate::springs::SpringWeights {
                            direction,
                            weights: weight(k + 1),
                        });
                let s = StepMatrix::new(here.sample_dims(), weight(0), springs.collect());
                diagonal.diagonal_of(&s).to_vec()
            };
            let unit_diagonals = std::array::from_fn(|which| unit(which, &mut diagonal));
            levels.push(Level {
                smoother: FastDiagonalization::new(&here),
                diagonal: Galerkin::diagonal(&here, steps),
                unit_diagonals,
                largest_eigenvalue: 1.0,
                prolong,
                restrict,
                r: zeros(n),
                d: zeros(n),
                z: zeros(n),
                q: zeros(n),
                lattice: here,
            });
            here = half;
        }
        let assembly = Galerkin::new(&here, steps);
        let factor = BandCholesky::new(here.coefficient_count(), assembly.band());
        let sizes = || {
            let lattices = levels.iter().map(|l: &Level<T>| &l.lattice).chain([&here]);
            lattices.map(|l| zeros(l.coefficient_count())).collect::<Vec<_>>()
        };
        let samples = || zeros(lattice.sample_count());
        Self {
            options,
            right: sizes(),
            solution: sizes(),
            samples: [samples(), samples()],
            workspace: TensorWorkspace::new(),
            levels,
            coarsest: here,
            assembly,
            factor,
        }
    }

    /// Number of levels, the factorized one included.
    pub fn level_count(&self) -> usize {
        self.levels.len() + 1
    }

    /// Coefficients of the factorized level.
    pub fn coarsest_count(&self) -> usize {
        self.coarsest.coefficient_count()
    }

    /// Largest eigenvalue of the smoother times `H`, as estimated, of each level.
    pub fn eigenvalues(&self) -> impl Iterator<Item = f64> + '_ {
        self.levels.iter().map(|l| l.largest_eigenvalue)
    }

    /// Makes the preconditioner fit a matrix.
    ///
    /// # Errors
    /// [`NotPositive`] if the coarsest level cannot be factorized.
    pub fn prepare(&mut self, s: &StepMatrix<T>) -> Result<(), NotPositive> {
        self.assembly.assemble(s, &mut self.factor);
        self.factor.factorize()?;
        let mass = geometric_mean(&s.mass, 1e-9);
        let mut along = [0.0; 3];
        for spring in &s.springs {
            let b = geometric_mean(&spring.weights, 1e-9);
            for (a, step) in along.iter_mut().zip(spring.direction.step) {
                *a += b * (step * step) as f64;
            }
        }
        for l in 0..self.levels.len() {
            let level = &mut self.levels[l];
            level.smoother.set(mass, along);
            let actual = level.diagonal.diagonal_of(s);
            for (i, scale) in level.smoother.scale_mut().iter_mut().enumerate() {
                let unit = &level.unit_diagonals;
                let constant =
                    mass * unit[0][i] + along[0] * unit[1][i] + along[1] * unit[2][i] + along[2] * unit[3][i];
                *scale = T::from_f64((constant / actual[i]).sqrt());
            }
            self.levels[l].largest_eigenvalue = self.largest_eigenvalue(s, l);
        }
        Ok(())
    }

    /// By preconditioned Lanczos steps (the coefficients of conjugate gradients), from a fixed start; 10 % on top.
    fn largest_eigenvalue(&mut self, s: &StepMatrix<T>, l: usize) -> f64 {
        let Self {
            levels,
            samples,
            workspace,
            options,
            ..
        } = self;
        let Level {
            lattice,
            smoother,
            r,
            d: p,
            z,
            q,
            ..
        } = &mut levels[l];
        // A rough start: any smooth one hides the largest eigenvalues.
        let mut seed = 0x9E37_79B9_7F4A_7C15_u64;
        for v in r.iter_mut() {
            seed = seed
                .wrapping_mul(0xD129_42F0_5A3B_4B79)
                .wrapping_add(0x1405_7B7E_F767_814F);
            *v = T::from_f64((seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5);
        }
        let (mut diagonal, mut off) = (Vec::new(), Vec::new());
        let (mut before, mut last_alpha, mut beta) = (0.0, 1.0, 0.0);
        for step in 0..options.eigenvalue_steps {
            smoother.apply(r, z);
            let rz = dot(r, z);
            if !(rz > 0.0) {
                break;
            }
            if step == 0 {
                p.copy_from_slice(z);
            } else {
                beta = rz / before;
                for (p, z) in p.iter_mut().zip(z.iter()) {
                    *p = *z + T::from_f64(beta) * *p;
                }
            }
            operator(lattice, s, p, q, samples, workspace);
            let alpha = rz / dot(p, q);
            diagonal.push(1.0 / alpha + if step > 0 { beta / last_alpha } else { 0.0 });
            if step > 0 {
                off.push(beta.sqrt() / last_alpha);
            }
            add_scaled(r, T::from_f64(-alpha), q);
            (before, last_alpha) = (rz, alpha);
        }
        1.1 * largest_of_tridiagonal(&diagonal, &off)
    }

    /// Solves level `l` for its right-hand side by one cycle.
    fn cycle(&mut self, s: &StepMatrix<T>, l: usize) {
        if l == self.levels.len() {
            self.solution[l].copy_from_slice(&self.right[l]);
            self.factor.solve(&mut self.solution[l]);
            return;
        }
        // x = S(b)
        self.smooth(s, l, true);
        // x += P E⁻¹ Pᵀ (b - Hx)
        self.residual(s, l);
        self.levels[l]
            .restrict
            .apply(&self.levels[l].r, &mut self.right[l + 1], &mut self.workspace);
        self.cycle(s, l + 1);
        let level = &mut self.levels[l];
        level
            .prolong
            .apply(&self.solution[l + 1], &mut level.z, &mut self.workspace);
        add_scaled(&mut self.solution[l], T::one(), &level.z);
        // x += S(b - Hx)
        self.smooth(s, l, false);
    }

    /// `r = b - Hx`.
    fn residual(&mut self, s: &StepMatrix<T>, l: usize) {
        let level = &mut self.levels[l];
        operator(
            &level.lattice,
            s,
            &self.solution[l],
            &mut level.q,
            &mut self.samples,
            &mut self.workspace,
        );
        for ((r, b), q) in level.r.iter_mut().zip(&self.right[l]).zip(&level.q) {
            *r = *b - *q;
        }
    }

    /// Chebyshev smoothing on the upper 12/13 of the spectrum, from zero or from what is there.
    fn smooth(&mut self, s: &StepMatrix<T>, l: usize, from_zero: bool) {
        if from_zero {
            let level = &mut self.levels[l];
            level.r.copy_from_slice(&self.right[l]);
            self.solution[l].fill(T::zero());
        } else {
            self.residual(s, l);
        }
        let Level {
            lattice,
            smoother,
            largest_eigenvalue,
            r,
            d,
            z,
            q,
            ..
        } = &mut self.levels[l];
        let x = &mut self.solution[l];
        let (theta, delta) = (
            *largest_eigenvalue * (1.0 + 1.0 / 12.0) / 2.0,
            *largest_eigenvalue * (1.0 - 1.0 / 12.0) / 2.0,
        );
        let sigma = theta / delta;
        let mut rho = 1.0 / sigma;
        for step in 0..self.options.degree {
            smoother.apply(r, z);
            let (keep, take) = if step == 0 {
                (0.0, 1.0 / theta)
            } else {
                let next = 1.0 / (2.0 * sigma - rho);
                let out = (next * rho, 2.0 * next / delta);
                rho = next;
                out
            };
            let (keep, take) = (T::from_f64(keep), T::from_f64(take));
            if step == 0 {
                for (d, z) in d.iter_mut().zip(z.iter()) {
                    *d = take * *z;
                }
            } else {
                for (d, z) in d.iter_mut().zip(z.iter()) {
                    *d = keep * *d + take * *z;
                }
            }
            add_scaled(x, T::one(), d);
            if step + 1 < self.options.degree {
                operator(lattice, s, d, q, &mut self.samples, &mut self.workspace);
                add_scaled(r, -T::one(), q);
            }
        }
    }
}

/// `out = AᵀSA x`.
fn operator<T: Real>(
    lattice: &Lattice<T>,
    s: &StepMatrix<T>,
    x: &[T],
    out: &mut [T],
    samples: &mut [Vec<T>; 2],
    w: &mut TensorWorkspace<T>,
) {
    let [a, b] = samples;
    lattice.sample(x, a, w);
    s.apply(a, b);
    lattice.gather(b, out, w);
}

/// Largest eigenvalue of a symmetric tridiagonal matrix, by bisection on Sturm sequences.
pub(crate) fn largest_of_tridiagonal(diagonal: &[f64], off: &[f64]) -> f64 {
    let around = |i: usize| {
        let left = if i > 0 { off[i - 1].abs() } else { 0.0 };
        left + off.get(i).map_or(0.0, |o| o.abs())
    };
    let mut low = diagonal.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut high = (0..diagonal.len())
        .map(|i| diagonal[i] + around(i))
        .fold(low, f64::max);
    // Eigenvalues above t are as many as positive pivots of T - t.
    let has_above = |t: f64| {
        let mut pivot = 1.0;
        (0..diagonal.len()).any(|i| {
            let coupling = if i > 0 {
                off[i - 1] * off[i - 1] / pivot
            } else {
                0.0
            };
            pivot = diagonal[i] - t - coupling;
            pivot > 0.0
        })
    };
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if has_above(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

impl<T: Real> Preconditioner<T> for VCycle<T> {
    fn apply(&mut self, s: &StepMatrix<T>, r: &[T], z: &mut [T]) {
        self.right[0].copy_from_slice(r);
        self.cycle(s, 0);
        z.copy_from_slice(&self.solution[0]);
    }
}
