//! The V-cycle for painted material: scaled fast diagonalization as smoother, every other knot as coarse space.

use bspline::Real;
use serde::{Deserialize, Serialize};

use super::band_cholesky::{BandCholesky, NotPositive};
use super::chebyshev::Chebyshev;
use super::estimates::{self, Estimates};
use super::fast_diagonalization::FastDiagonalization;
use super::galerkin::Galerkin;
use super::lanczos::Lanczos;
use super::mean::GeometricMean;
use super::pcg::{CoefficientSystem, Preconditioner, add_scaled};
use super::schwarz::Schwarz;
use crate::lattice::{Lattice, SampleBox, TensorProduct, TensorWorkspace};
use crate::springs::{StepMatrix, Weights};

/// Where the Chebyshev polynomials begin, relative to the largest eigenvalue.
const LOWER: f64 = 1.0 / 12.0;

/// How a [`VCycle`] is made.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct VCycleOptions {
    /// Degree of the Chebyshev polynomial of the smoother, one more where there are no blocks.
    pub degree: usize,
    /// Coefficients up to which a level is factorized.
    pub direct_limit: usize,
    /// Lanczos steps for the largest eigenvalue of the smoother.
    pub eigenvalue_steps: usize,
    /// Size of the overlapping blocks that are solved exactly where material is painted, 0 for none.
    pub blocks: usize,
    /// Distance of the blocks.
    pub stride: usize,
    /// Degree of the Chebyshev polynomial of the blocks.
    pub block_degree: usize,
    /// Ratio within a block, of the actual diagonal to that of constant material, from which on it is solved.
    pub block_contrast: f64,
    /// The same ratio over the whole level from which on there are blocks at all: they cost several times what the rest of
    /// a cycle does, and up to a contrast of some hundred three iterations without them do as well.
    pub block_onset: f64,
    /// Coefficients of the finest level up to which it has blocks: their matrix takes 3 kB a coefficient.
    pub block_limit: usize,
}

impl Default for VCycleOptions {
    fn default() -> Self {
        Self {
            degree: 2,
            direct_limit: 1400,
            eigenvalue_steps: 10,
            blocks: 5,
            stride: 3,
            block_degree: 3,
            block_contrast: 3.0,
            block_onset: 200.0,
            block_limit: 20_000,
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
    /// Actual diagonal over that of constant material.
    variation: Vec<f64>,
    all: Option<Galerkin>,
    schwarz: Option<Schwarz<T>>,
    schwarz_eigenvalue: f64,
    lanczos: Lanczos<T>,
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
    assembly: Galerkin,
    factor: BandCholesky<T>,
    /// By which share the diagonal of the factor was raised.
    raised: f64,
    /// Of the mass, and of the springs of each direction.
    means: Vec<GeometricMean>,
    right: Vec<Vec<T>>,
    solution: Vec<Vec<T>>,
    /// Dabs of paint since the eigenvalues were estimated, that one included.
    dabs: usize,
    samples: [Vec<T>; 2],
    workspace: TensorWorkspace<T>,
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
                variation: vec![1.0; n],
                // What blocks are for, material that changes within a few splines, coarse levels do not see.
                all: (levels.is_empty() && options.blocks > 0 && n <= options.block_limit)
                    .then(|| Galerkin::new(&here, steps)),
                schwarz: None,
                schwarz_eigenvalue: 1.0,
                lanczos: Lanczos::new(n),
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
            assembly,
            factor,
            raised: 0.0,
            dabs: 0,
            means: vec![GeometricMean::default(); steps.len() + 1],
        }
    }

    /// The smoother of the finest level.
    ///
    /// # Panics
    /// If the finest level is factorized.
    #[cfg(feature = "study")]
    pub fn smoother(&self) -> &FastDiagonalization<T> {
        &self.levels[0].smoother
    }

    /// Makes the preconditioner fit a matrix.
    ///
    /// # Errors
    /// [`NotPositive`] if the coarsest level cannot be factorized.
    pub fn prepare(&mut self, s: &StepMatrix<T>) -> Result<(), NotPositive> {
        self.dabs = 0;
        self.fit(s, SampleBox::all(s.dims()), true)
    }

    /// The same where the matrix differs from the one before on a box of samples only, springs being counted where they
    /// start. What is made is no other, to the bit, but sums cost the box, and eigenvalues, which cost ten products, are
    /// [estimated](estimates) only now and then.
    ///
    /// # Errors
    /// [`NotPositive`] as [`prepare`](Self::prepare).
    pub(super) fn follow(&mut self, s: &StepMatrix<T>, at: SampleBox) -> Result<(), NotPositive> {
        self.dabs = estimates::after(self.dabs);
        self.fit(s, at, self.dabs == 1)
    }

    /// Whether eigenvalues are those of a matrix before.
    pub(super) fn is_rough(&self) -> bool {
        self.dabs > 1
    }

    /// Estimates eigenvalues that are those of a matrix before; all is then as after [`prepare`](Self::prepare).
    pub(super) fn refresh(&mut self, s: &StepMatrix<T>) {
        if self.is_rough() {
            for l in 0..self.levels.len() {
                self.levels[l].largest_eigenvalue = self.largest_eigenvalue(s, l, false);
                if self.levels[l].schwarz.is_some() {
                    self.levels[l].schwarz_eigenvalue = self.largest_eigenvalue(s, l, true);
                }
            }
        }
        self.dabs = 0;
    }

    /// The eigenvalues in use.
    pub(super) fn estimates(&self) -> Estimates {
        let levels = self.levels.iter();
        Estimates::new(
            self.dabs,
            levels.map(|l| [l.largest_eigenvalue, l.schwarz_eigenvalue]),
        )
    }

    /// Takes the eigenvalues of another cycle of this kind.
    pub(super) fn resume(&mut self, estimates: &Estimates) {
        self.dabs = estimates.dabs();
        for (level, [all, blocks]) in self.levels.iter_mut().zip(estimates.levels()) {
            (level.largest_eigenvalue, level.schwarz_eigenvalue) = (all, blocks);
        }
    }

    fn fit(&mut self, s: &StepMatrix<T>, at: SampleBox, estimate: bool) -> Result<(), NotPositive> {
        let first = self.assembly.accumulate_on(s, at);
        let first = if self.raised == 0.0 { first } else { 0 };
        self.raised = f64::INFINITY;
        self.raised = self.assembly.factorize_sums(&mut self.factor, first)?;
        let dims = s.dims();
        let mass = self.means[0].of(&s.mass, dims, at);
        let mut along = [0.0; 3];
        for (spring, mean) in s.springs.iter().zip(&mut self.means[1..]) {
            let b = mean.of(&spring.weights, dims, at);
            for (a, step) in along.iter_mut().zip(spring.direction.step) {
                *a += b * (step * step) as f64;
            }
        }
        for l in 0..self.levels.len() {
            let level = &mut self.levels[l];
            level.smoother.set(mass, along);
            level.diagonal.accumulate_on(s, at);
            let actual = level.diagonal.sums();
            for (i, scale) in level.smoother.scale_mut().iter_mut().enumerate() {
                let unit = &level.unit_diagonals;
                let constant =
                    mass * unit[0][i] + along[0] * unit[1][i] + along[1] * unit[2][i] + along[2] * unit[3][i];
                level.variation[i] = actual[i] / constant;
                *scale = T::from_f64((constant / actual[i]).sqrt());
            }
            if estimate {
                self.levels[l].largest_eigenvalue = self.largest_eigenvalue(s, l, false);
            }
            self.fit_blocks(s, l, at, estimate);
        }
        Ok(())
    }

    /// The blocks of a level, where its material asks for them.
    fn fit_blocks(&mut self, s: &StepMatrix<T>, l: usize, at: SampleBox, estimate: bool) {
        let (options, level) = (self.options, &mut self.levels[l]);
        let range = |(low, high): (f64, f64), v: &f64| (low.min(*v), high.max(*v));
        let (low, high) = level.variation.iter().fold((f64::INFINITY, 0.0), range);
        let before = level.schwarz.take();
        let Some(all) = &mut level.all else { return };
        if high <= options.block_onset * low {
            return;
        }
        // Sums are of the matrix for which there were blocks.
        match before {
            Some(_) => all.accumulate_on(s, at),
            None => {
                all.accumulate(s);
                0
            }
        };
        let kept = before.as_ref().map(|blocks| (blocks, all.touched(at)));
        let (size, stride) = (options.blocks, options.stride);
        let blocks = Schwarz::new(all, size, stride, &level.variation, options.block_contrast, kept);
        level.schwarz = (blocks.block_count() > 0).then_some(blocks);
        if level.schwarz.is_some() && (estimate || before.is_none()) {
            self.levels[l].schwarz_eigenvalue = self.largest_eigenvalue(s, l, true);
        }
    }

    /// Of the smoother, or of the blocks, times `H`; 10 % above the estimate.
    fn largest_eigenvalue(&mut self, s: &StepMatrix<T>, l: usize, blocks: bool) -> f64 {
        let level = &mut self.levels[l];
        let mut system = CoefficientSystem {
            lattice: &level.lattice,
            matrix: s,
            preconditioner: &mut Smoothing {
                diagonalization: &mut level.smoother,
                blocks: level.schwarz.as_mut().filter(|_| blocks),
            },
            samples: &mut self.samples,
            workspace: &mut self.workspace,
        };
        1.1 * level.lanczos.largest(&mut system, self.options.eigenvalue_steps)
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
        self.solve_blocks(s, l);
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
        self.solve_blocks(s, l);
        // x += S(b - Hx)
        self.smooth(s, l, false);
    }

    /// Chebyshev steps over the blocks, where there are any.
    fn solve_blocks(&mut self, s: &StepMatrix<T>, l: usize) {
        if self.levels[l].schwarz.is_some() {
            self.chebyshev(s, l, false, true);
        }
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

    /// Chebyshev smoothing by the diagonalization, from zero or from what is there.
    fn smooth(&mut self, s: &StepMatrix<T>, l: usize, from_zero: bool) {
        self.chebyshev(s, l, from_zero, false);
    }

    /// Chebyshev steps on the upper part of the spectrum.
    fn chebyshev(&mut self, s: &StepMatrix<T>, l: usize, from_zero: bool, blocks: bool) {
        if from_zero {
            let level = &mut self.levels[l];
            level.r.copy_from_slice(&self.right[l]);
            self.solution[l].fill(T::zero());
        } else {
            self.residual(s, l);
        }
        let degree = self.options.degree + usize::from(self.levels[0].schwarz.is_none());
        let Level {
            lattice,
            smoother,
            schwarz,
            largest_eigenvalue,
            schwarz_eigenvalue,
            r,
            d,
            z,
            q,
            ..
        } = &mut self.levels[l];
        let x = &mut self.solution[l];
        let (degree, largest) = if blocks {
            (self.options.block_degree, *schwarz_eigenvalue)
        } else {
            (degree, *largest_eigenvalue)
        };
        let mut smoother = Smoothing {
            diagonalization: smoother,
            blocks: schwarz.as_mut().filter(|_| blocks),
        };
        let (theta, delta) = (largest * (1.0 + LOWER) / 2.0, largest * (1.0 - LOWER) / 2.0);
        for (step, (keep, take)) in Chebyshev::new(theta, delta).take(degree).enumerate() {
            smoother.apply(s, r, z);
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
            if step + 1 < degree {
                operator(lattice, s, d, q, &mut self.samples, &mut self.workspace);
                add_scaled(r, -T::one(), q);
            }
        }
    }
}

/// One of the two smoothers.
struct Smoothing<'a, T> {
    diagonalization: &'a mut FastDiagonalization<T>,
    blocks: Option<&'a mut Schwarz<T>>,
}

impl<T: Real> Preconditioner<T> for Smoothing<'_, T> {
    fn apply(&mut self, _: &StepMatrix<T>, r: &[T], z: &mut [T]) {
        match &mut self.blocks {
            Some(blocks) => blocks.apply(r, z),
            None => self.diagonalization.apply(r, z),
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

impl<T: Real> Preconditioner<T> for VCycle<T> {
    fn apply(&mut self, s: &StepMatrix<T>, r: &[T], z: &mut [T]) {
        self.right[0].copy_from_slice(r);
        self.cycle(s, 0);
        z.copy_from_slice(&self.solution[0]);
    }
}
