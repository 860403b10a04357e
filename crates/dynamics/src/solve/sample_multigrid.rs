//! Multigrid on the samples, for lattices with as many free coefficients as samples: there `H⁻¹ = A⁻¹S⁻¹A⁻ᵀ`, and `S`
//! is a Laplacian with painted weights, while `H` itself is too badly conditioned for anything.

use bspline::Real;
use bspline::vectorized;

use super::band_cholesky::{BandCholesky, NotPositive};
use super::chebyshev::Chebyshev;
use super::pcg::Preconditioner;
use crate::lattice::{Banded, TensorProduct, TensorWorkspace};
use crate::springs::StepMatrix;

/// Smoothing steps before and after the coarse correction.
const DEGREE: usize = 3;
/// Samples up to which a level is factorized.
const DIRECT_LIMIT: usize = 400;

/// A matrix that couples each sample with its 26 neighbours: 27 weights per sample, by offset, z fastest.
///
/// Weights that would reach over the border are zero.
#[derive(Clone, Debug)]
struct Stencil<T> {
    dims: [usize; 3],
    weights: [Vec<T>; 27],
}

fn slot(dx: isize, dy: isize, dz: isize) -> usize {
    (((dx + 1) * 3 + dy + 1) * 3 + dz + 1) as usize
}

impl<T: Real> Stencil<T> {
    fn zero(dims: [usize; 3]) -> Self {
        let count = dims.iter().product();
        Self {
            dims,
            weights: std::array::from_fn(|_| vec![T::zero(); count]),
        }
    }

    fn set(&mut self, s: &StepMatrix<T>) {
        for w in &mut self.weights {
            w.fill(T::zero());
        }
        let middle = slot(0, 0, 0);
        for (i, w) in self.weights[middle].iter_mut().enumerate() {
            *w = s.mass.at(i);
        }
        let steps: Vec<_> = s.springs.iter().map(|s| s.direction.step).collect();
        s.for_each_spring(|i, j, w, n| {
            let [dx, dy, dz] = steps[n];
            self.weights[middle][i] += w;
            self.weights[middle][j] += w;
            self.weights[slot(dx, dy, dz)][i] = -w;
            self.weights[slot(-dx, -dy, -dz)][j] = -w;
        });
    }

    /// `out = S x`.
    fn apply(&self, x: &[T], out: &mut [T]) {
        let [mx, my, mz] = self.dims;
        vectorized(
            #[inline(always)]
            || {
                for i in 0..mx {
                    for j in 0..my {
                        let row = (i * my + j) * mz;
                        let out = &mut out[row..row + mz];
                        out.fill(T::zero());
                        for a in i.saturating_sub(1)..(i + 2).min(mx) {
                            for b in j.saturating_sub(1)..(j + 2).min(my) {
                                let first = ((a + 1 - i) * 3 + b + 1 - j) * 3;
                                let x = &x[(a * my + b) * mz..][..mz];
                                let w = |k: usize| &self.weights[first + k][row..row + mz];
                                let (below, here, above) = (w(0), w(1), w(2));
                                for z in 0..mz {
                                    out[z] += here[z] * x[z];
                                }
                                for z in 1..mz {
                                    out[z] += below[z] * x[z - 1];
                                }
                                for z in 0..mz - 1 {
                                    out[z] += above[z] * x[z + 1];
                                }
                            }
                        }
                    }
                }
            },
        );
    }
}

/// Linear interpolation on one axis from every other sample and the last: for each fine sample its one or two coarse
/// ones with their weights.
fn interpolation(m: usize) -> (usize, Vec<[(usize, f64); 2]>) {
    let coarse = m / 2 + 1;
    let last = coarse - 1;
    let parents = |i: usize| {
        if i + 1 == m {
            [(last, 1.0), (last, 0.0)]
        } else if i.is_multiple_of(2) {
            [(i / 2, 1.0), (i / 2, 0.0)]
        } else {
            [(i / 2, 0.5), (i / 2 + 1, 0.5)]
        }
    };
    (coarse, (0..m).map(parents).collect())
}

#[derive(Clone, Debug)]
struct Level<T> {
    /// Not read on the finest level, where the springs themselves are cheaper.
    stencil: Stencil<T>,
    inverse_diagonal: Vec<T>,
    /// Bound on the largest eigenvalue of the matrix over its diagonal.
    bound: f64,
    x: Vec<T>,
    b: Vec<T>,
    r: Vec<T>,
    d: Vec<T>,
}

/// One V-cycle as a preconditioner of `S`; [`prepare`](SampleMultigrid::prepare) it for each matrix.
#[derive(Clone, Debug)]
pub struct SampleMultigrid<T> {
    levels: Vec<Level<T>>,
    /// From each level but the first to the one before, and back.
    prolong: Vec<TensorProduct<T>>,
    restrict: Vec<TensorProduct<T>>,
    factor: BandCholesky<T>,
    workspace: TensorWorkspace<T>,
}

impl<T: Real> SampleMultigrid<T> {
    /// The levels below `dims` samples.
    pub fn new(dims: [usize; 3]) -> Self {
        let mut levels = Vec::new();
        let mut here = dims;
        loop {
            let count: usize = here.iter().product();
            let zeros = || vec![T::zero(); count];
            levels.push(Level {
                stencil: Stencil::zero(here),
                inverse_diagonal: zeros(),
                bound: 2.0,
                x: zeros(),
                b: zeros(),
                r: zeros(),
                d: zeros(),
            });
            let next = here.map(|m| if m > 3 { m / 2 + 1 } else { m });
            if count <= DIRECT_LIMIT || next == here {
                break;
            }
            here = next;
        }
        let [_, my, mz] = here;
        let count: usize = here.iter().product();
        let (mut prolong, mut restrict) = (Vec::new(), Vec::new());
        for pair in levels.windows(2) {
            let (fine, coarse) = (pair[0].stencil.dims, pair[1].stencil.dims);
            let up = parents(fine, coarse);
            let p: [Banded<T>; 3] = std::array::from_fn(|a| {
                let row = |p: &[(usize, f64); 2]| {
                    let taken = p.iter().filter(|p| p.1 != 0.0);
                    taken.map(|p| (p.0, T::from_f64(p.1))).collect::<Vec<_>>()
                };
                Banded::from_rows(coarse[a], up[a].iter().map(row))
            });
            let t: [Banded<T>; 3] = std::array::from_fn(|a| p[a].transposed());
            prolong.push(TensorProduct::new(p.each_ref()));
            restrict.push(TensorProduct::new(t.each_ref()));
        }
        Self {
            levels,
            prolong,
            restrict,
            factor: BandCholesky::new(count, ((my + 1) * mz + 1).min(count - 1)),
            workspace: TensorWorkspace::new(),
        }
    }

    /// Makes the cycle fit a matrix.
    ///
    /// # Errors
    /// [`NotPositive`] if the coarsest level cannot be factorized.
    pub fn prepare(&mut self, s: &StepMatrix<T>) -> Result<(), NotPositive> {
        self.levels[0].stencil.set(s);
        for l in 0..self.levels.len() {
            if l > 0 {
                let (finer, rest) = self.levels.split_at_mut(l);
                rest[0].stencil = coarsened(&finer[l - 1].stencil, rest[0].stencil.dims);
            }
            let level = &mut self.levels[l];
            level.bound = 0.0;
            let w = &level.stencil.weights;
            for i in 0..level.inverse_diagonal.len() {
                let diagonal = w[slot(0, 0, 0)][i];
                let row: f64 = w.iter().map(|w| w[i].as_f64().abs()).sum();
                level.bound = level.bound.max(row / diagonal.as_f64());
                level.inverse_diagonal[i] = T::one() / diagonal;
            }
        }
        let last = &self.levels[self.levels.len() - 1].stencil;
        self.factor.clear();
        let [mx, my, mz] = last.dims;
        for i in 0..mx * my * mz {
            let at = [i / (my * mz), i / mz % my, i % mz];
            for (o, w) in last.weights.iter().enumerate() {
                let to = [at[0] + o / 9, at[1] + o / 3 % 3, at[2] + o % 3];
                if (0..3).any(|a| to[a] == 0 || to[a] > last.dims[a]) {
                    continue;
                }
                let j = ((to[0] - 1) * my + to[1] - 1) * mz + to[2] - 1;
                if j <= i {
                    self.factor.set(i, j, w[i].as_f64());
                }
            }
        }
        self.factor.factorize()
    }

    /// `z ≈ S⁻¹ r`.
    pub fn apply(&mut self, s: &StepMatrix<T>, r: &[T], z: &mut [T]) {
        self.levels[0].b.copy_from_slice(r);
        self.cycle(s, 0);
        z.copy_from_slice(&self.levels[0].x);
    }

    fn cycle(&mut self, s: &StepMatrix<T>, l: usize) {
        if l + 1 == self.levels.len() {
            let level = &mut self.levels[l];
            level.x.copy_from_slice(&level.b);
            self.factor.solve(&mut level.x);
            return;
        }
        let finest = (l == 0).then_some(s);
        self.levels[l].smooth(finest, true);
        self.levels[l].residual(finest);
        let (fine, coarse) = self.levels.split_at_mut(l + 1);
        self.restrict[l].apply(&fine[l].r, &mut coarse[0].b, &mut self.workspace);
        self.cycle(s, l + 1);
        let (fine, coarse) = self.levels.split_at_mut(l + 1);
        let level = &mut fine[l];
        self.prolong[l].apply(&coarse[0].x, &mut level.r, &mut self.workspace);
        for (x, r) in level.x.iter_mut().zip(&level.r) {
            *x += *r;
        }
        level.smooth(finest, false);
    }
}

impl<T: Real> Preconditioner<T> for SampleMultigrid<T> {
    fn apply(&mut self, s: &StepMatrix<T>, r: &[T], z: &mut [T]) {
        SampleMultigrid::apply(self, s, r, z);
    }
}

impl<T: Real> Level<T> {
    /// `r = b - Sx`.
    fn residual(&mut self, finest: Option<&StepMatrix<T>>) {
        match finest {
            Some(s) => s.apply(&self.x, &mut self.r),
            None => self.stencil.apply(&self.x, &mut self.r),
        }
        for (r, b) in self.r.iter_mut().zip(&self.b) {
            *r = *b - *r;
        }
    }

    /// Chebyshev steps on the upper part of the spectrum of the diagonally scaled matrix.
    fn smooth(&mut self, finest: Option<&StepMatrix<T>>, from_zero: bool) {
        let (high, low) = (self.bound, self.bound / 8.0);
        let (theta, delta) = ((high + low) / 2.0, (high - low) / 2.0);
        if from_zero {
            self.x.fill(T::zero());
        }
        for (step, (keep, take)) in Chebyshev::new(theta, delta).take(DEGREE).enumerate() {
            if step == 0 && from_zero {
                self.r.copy_from_slice(&self.b);
            } else {
                self.residual(finest);
            }
            let (keep, take) = (T::from_f64(keep), T::from_f64(take));
            let terms = self.r.iter().zip(&self.inverse_diagonal);
            if step == 0 {
                for (d, (r, i)) in self.d.iter_mut().zip(terms) {
                    *d = take * (*r * *i);
                }
            } else {
                for (d, (r, i)) in self.d.iter_mut().zip(terms) {
                    *d = keep * *d + take * (*r * *i);
                }
            }
            for (x, d) in self.x.iter_mut().zip(&self.d) {
                *x += *d;
            }
        }
    }
}

/// Parents of the samples on each axis; an axis that is not coarsened keeps its samples.
fn parents(fine: [usize; 3], coarse: [usize; 3]) -> [Vec<[(usize, f64); 2]>; 3] {
    std::array::from_fn(|a| {
        if fine[a] == coarse[a] {
            (0..fine[a]).map(|i| [(i, 1.0), (i, 0.0)]).collect()
        } else {
            interpolation(fine[a]).1
        }
    })
}

/// `PᵀSP`, one axis after the other.
fn coarsened<T: Real>(fine: &Stencil<T>, dims: [usize; 3]) -> Stencil<T> {
    let all = parents(fine.dims, dims);
    let mut here: Option<Stencil<T>> = None;
    for axis in (0..3).rev() {
        let source = here.as_ref().unwrap_or(fine);
        if source.dims[axis] == dims[axis] {
            here = Some(source.clone());
            continue;
        }
        let mut to = source.dims;
        to[axis] = dims[axis];
        let mut out = Stencil::zero(to);
        let up = &all[axis];
        let [_, my, mz] = source.dims;
        for i in 0..source.weights[0].len() {
            let at = [i / (my * mz), i / mz % my, i % mz];
            for o in 0..27 {
                let w = source.weights[o][i];
                if w == T::zero() {
                    continue;
                }
                let step = [o / 9, o / 3 % 3, o % 3];
                let other = at[axis] + step[axis] - 1;
                for (a, wa) in up[at[axis]] {
                    for (b, wb) in up[other] {
                        if wa * wb == 0.0 {
                            continue;
                        }
                        let mut place = at;
                        place[axis] = a;
                        let mut step = step;
                        step[axis] = b + 1 - a;
                        let place = (place[0] * to[1] + place[1]) * to[2] + place[2];
                        out.weights[(step[0] * 3 + step[1]) * 3 + step[2]][place] += T::from_f64(wa * wb) * w;
                    }
                }
            }
        }
        here = Some(out);
    }
    here.expect("three axes")
}
