//! The V-cycle for painted material: scaled fast diagonalization as smoother, every other knot as coarse space.
//!
//! Where mass and damping of a short step, or a low contrast, leave the smoother well conditioned, it solves without the rest:
//! coarse levels would cost more than they save, and are not even made.

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
use crate::lattice::{Banded, Lattice, SampleBox, TensorProduct, TensorWorkspace};
use crate::springs::StepMatrix;

/// Where the Chebyshev polynomials begin, relative to the largest eigenvalue.
const LOWER: f64 = 1.0 / 12.0;

/// Ratios of the extreme eigenvalues of a smoother that solves alone up to which one and two steps of its polynomial do, for
/// some six iterations.
const STEPS: [f64; 2] = [2.5, 6.0];

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
    /// Ratio of the extreme eigenvalues of the smoother, to spare included, up to which it solves alone, 0 for never: with three
    /// steps of its polynomial it then takes as many products as cycles do, and below ever fewer.
    pub alone: f64,
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
            alone: 12.0,
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
    /// Of the finest level; 0 where it is not known.
    least_eigenvalue: f64,
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
    /// Whether coarse levels and blocks are of the matrix at hand.
    is_whole: bool,
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
            levels.push(Level {
                smoother: FastDiagonalization::new(&here),
                diagonal: Galerkin::diagonal(&here, steps),
                unit_diagonals: unit_diagonals(&here),
                largest_eigenvalue: 1.0,
                least_eigenvalue: 0.0,
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
            is_whole: false,
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
    ///
    /// # Errors
    /// [`NotPositive`] as there.
    pub(super) fn refresh(&mut self, s: &StepMatrix<T>) -> Result<(), NotPositive> {
        if self.is_rough() {
            self.estimate(s);
            if self.is_whole {
                for l in 1..self.levels.len() {
                    self.levels[l].largest_eigenvalue = self.ends(s, l, false)[1];
                }
                if self.levels.first().is_some_and(|l| l.schwarz.is_some()) {
                    self.levels[0].schwarz_eigenvalue = self.ends(s, 0, true)[1];
                }
            }
            self.complete(s)?;
        }
        self.dabs = 0;
        Ok(())
    }

    /// The eigenvalues in use.
    pub(super) fn estimates(&self) -> Estimates {
        let levels = self.levels.iter();
        Estimates::new(
            self.dabs,
            levels.map(|l| [l.largest_eigenvalue, l.schwarz_eigenvalue, l.least_eigenvalue]),
        )
    }

    /// Takes the eigenvalues of another cycle of this kind, which was of the matrix at hand too.
    ///
    /// # Errors
    /// [`NotPositive`] as [`prepare`](Self::prepare).
    pub(super) fn resume(&mut self, s: &StepMatrix<T>, estimates: &Estimates) -> Result<(), NotPositive> {
        let take = |levels: &mut [Level<T>]| {
            for (level, [all, blocks, least]) in levels.iter_mut().zip(estimates.levels()) {
                (level.largest_eigenvalue, level.schwarz_eigenvalue) = (all, blocks);
                level.least_eigenvalue = least;
            }
        };
        self.dabs = estimates.dabs();
        take(&mut self.levels);
        self.complete(s)?;
        take(&mut self.levels);
        Ok(())
    }

    /// Whether the smoother of the finest level solves alone.
    pub(super) fn is_alone(&self) -> bool {
        let few = |l: &Level<T>| l.largest_eigenvalue <= self.options.alone * l.least_eigenvalue;
        self.levels.first().is_some_and(few)
    }

    fn fit(&mut self, s: &StepMatrix<T>, at: SampleBox, estimate: bool) -> Result<(), NotPositive> {
        let material = self.material(s, at);
        if !self.levels.is_empty() {
            self.fit_smoother(s, 0, &material, at);
            if estimate {
                self.estimate(s);
            }
        }
        if self.is_alone() {
            self.is_whole = false;
            self.levels[0].schwarz = None;
            return Ok(());
        }
        self.fit_rest(s, &material, at, estimate)
    }

    /// Makes what the smoother needs beside itself, if it is not there.
    fn complete(&mut self, s: &StepMatrix<T>) -> Result<(), NotPositive> {
        if self.is_alone() || self.is_whole {
            return Ok(());
        }
        let all = SampleBox::all(s.dims());
        let material = self.material(s, all);
        self.fit_rest(s, &material, all, true)
    }

    /// Means of the mass, and of the springs along each axis.
    fn material(&mut self, s: &StepMatrix<T>, at: SampleBox) -> [f64; 4] {
        let dims = s.dims();
        let mut all = [self.means[0].of(&s.mass, dims, at), 0.0, 0.0, 0.0];
        for (spring, mean) in s.springs.iter().zip(&mut self.means[1..]) {
            let b = mean.of(&spring.weights, dims, at);
            for (a, step) in all[1..].iter_mut().zip(spring.direction.step) {
                *a += b * (step * step) as f64;
            }
        }
        all
    }

    fn fit_smoother(&mut self, s: &StepMatrix<T>, l: usize, material: &[f64; 4], at: SampleBox) {
        let level = &mut self.levels[l];
        let [mass, along @ ..] = *material;
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
    }

    /// The coarse levels, their factor and the blocks.
    fn fit_rest(
        &mut self,
        s: &StepMatrix<T>,
        material: &[f64; 4],
        at: SampleBox,
        estimate: bool,
    ) -> Result<(), NotPositive> {
        // Sums that were not kept up are of a matrix before.
        let at = if self.is_whole {
            at
        } else {
            SampleBox::all(s.dims())
        };
        self.is_whole = false;
        let first = self.assembly.accumulate_on(s, at);
        let first = if self.raised == 0.0 { first } else { 0 };
        self.raised = f64::INFINITY;
        self.raised = self.assembly.factorize_sums(&mut self.factor, first)?;
        for l in 0..self.levels.len() {
            if l > 0 {
                self.fit_smoother(s, l, material, at);
                if estimate {
                    self.levels[l].largest_eigenvalue = self.ends(s, l, false)[1];
                }
            }
            self.fit_blocks(s, l, at, estimate);
        }
        self.is_whole = true;
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
            self.levels[l].schwarz_eigenvalue = self.ends(s, l, true)[1];
        }
    }

    /// Estimates the eigenvalues of the smoother of the finest level.
    fn estimate(&mut self, s: &StepMatrix<T>) {
        let [least, largest] = self.ends(s, 0, false);
        let level = &mut self.levels[0];
        (level.least_eigenvalue, level.largest_eigenvalue) = (least, largest);
    }

    /// The extreme eigenvalues of the smoother, or of the blocks, times `H`; 10 % beyond the estimates.
    fn ends(&mut self, s: &StepMatrix<T>, l: usize, blocks: bool) -> [f64; 2] {
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
        let [least, largest] = level.lanczos.ends(&mut system, self.options.eigenvalue_steps);
        [0.9 * least, 1.1 * largest]
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
        let is_alone = self.is_alone();
        let degree = self.options.degree + usize::from(self.levels[0].schwarz.is_none());
        let Level {
            lattice,
            smoother,
            schwarz,
            largest_eigenvalue,
            least_eigenvalue,
            schwarz_eigenvalue,
            r,
            d,
            z,
            q,
            ..
        } = &mut self.levels[l];
        let x = &mut self.solution[l];
        let (degree, largest, least) = if blocks {
            let largest = *schwarz_eigenvalue;
            (self.options.block_degree, largest, LOWER * largest)
        } else if is_alone {
            let ratio = *largest_eigenvalue / *least_eigenvalue;
            let degree = 1 + STEPS.iter().filter(|most| ratio > **most).count();
            (degree, *largest_eigenvalue, *least_eigenvalue)
        } else {
            (degree, *largest_eigenvalue, LOWER * *largest_eigenvalue)
        };
        let mut smoother = Smoothing {
            diagonalization: smoother,
            blocks: schwarz.as_mut().filter(|_| blocks),
        };
        let (theta, delta) = ((largest + least) / 2.0, (largest - least) / 2.0);
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

/// The diagonals of `H` for unit mass, and for unit springs along each axis, which are products of those of the axes.
fn unit_diagonals<T: Real>(lattice: &Lattice<T>) -> [Vec<f64>; 4] {
    let squares = |a: &Banded<f64>| -> Vec<f64> {
        let a = a.transposed();
        let row = |i: usize| a.row(i).1.iter().map(|w| w * w).sum();
        (0..a.rows()).map(row).collect()
    };
    let axes = lattice.axes().each_ref().map(|axis| axis.collocation());
    let (masses, springs) = (
        axes.each_ref().map(squares),
        axes.each_ref().map(|a| squares(&a.differences())),
    );
    let [nx, ny, nz] = lattice.coefficient_dims();
    std::array::from_fn(|which| {
        let along = |a: usize| if which == a + 1 { &springs[a] } else { &masses[a] };
        let (x, y, z) = (along(0), along(1), along(2));
        let at = |i: usize| x[i / nz / ny] * y[i / nz % ny] * z[i % nz];
        (0..nx * ny * nz).map(at).collect()
    })
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
        if self.is_alone() {
            self.smooth(s, 0, true);
        } else {
            self.cycle(s, 0);
        }
        z.copy_from_slice(&self.solution[0]);
    }
}
