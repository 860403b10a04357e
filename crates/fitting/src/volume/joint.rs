//! Joint least squares over the active functions of all levels by preconditioned conjugate gradients.

use bspline::Real;
use rayon::prelude::*;

use super::active::{ActiveSet, Packed};
use super::domain::{Domain, Samples};
use super::gram::apply_normal_matrix;
use super::residual::{correlations, residual};
use crate::level::SolverOutcome;
use crate::level::cg::{Stop, System, conjugate_gradients};
use crate::{Control, FitError};

/// Elements of one term of a dot product; the terms are summed in order, whatever the thread count.
const DOT_CHUNK: usize = 1 << 14;
/// Accumulators of a dot product.
const DOT_LANES: usize = 8;

/// Active functions of all levels with their coefficients.
#[derive(Clone, Debug)]
pub(crate) struct Fit<T> {
    pub active: Vec<ActiveSet>,
    pub coefficients: Packed<T>,
}

impl<T: Real> Fit<T> {
    /// Level 0 full, nothing else, all coefficients zero.
    pub fn new(domain: &Domain<T>) -> Self {
        let active: Vec<ActiveSet> = (0..domain.levels())
            .map(|level| {
                let size = domain.functions(level);
                if level == 0 {
                    ActiveSet::full(size)
                } else {
                    ActiveSet::empty(size)
                }
            })
            .collect();
        let coefficients = active.iter().map(|a| vec![T::zero(); a.len()]).collect();
        Self { active, coefficients }
    }

    /// Active functions over all levels.
    pub fn count(&self) -> usize {
        self.active.iter().map(ActiveSet::len).sum()
    }

    /// Makes `set` the active functions of `level`, keeping the coefficients of those that stay.
    pub fn set_active(&mut self, level: usize, set: ActiveSet) {
        self.coefficients[level] = self.active[level].transport(&self.coefficients[level], &set);
        self.active[level] = set;
    }
}

/// What is to be fitted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Problem<'a, T> {
    pub domain: &'a Domain<T>,
    pub samples: Samples<'a, T>,
    /// Weight `μ` of the ridge `μ Σ c²‖B‖²` over the functions above level 0; 0 for none.
    pub ridge: f64,
}

/// Minimizes `Σ_k w_k (f(k) - d_k)² + μ Σ c²‖B‖²` over the coefficients of `fit` by at most `iterations` steps of
/// conjugate gradients, preconditioned by the diagonal of the generating system (all levels side by side).
///
/// `r` holds the residual of the start and, on return, that of the result. Progress goes from `span.0` to `span.1`.
pub(crate) fn solve_jointly<T: Real>(
    problem: &Problem<T>,
    fit: &mut Fit<T>,
    r: &mut [T],
    iterations: usize,
    control: &mut Control,
    span: (f64, f64),
) -> Result<SolverOutcome, FitError> {
    let domain = problem.domain;
    let finest = domain.finest();
    let dense = correlations(domain, r, &fit.active[finest]);
    let mut gradient: Packed<T> = dense
        .into_iter()
        .enumerate()
        .map(|(level, g)| match level == finest {
            true => g,
            false => fit.active[level].gather(&g),
        })
        .collect();
    let mut system = Generating {
        problem,
        active: &fit.active,
        norms: squared_norms(domain, &fit.active),
    };
    if problem.ridge > 0.0 {
        add_ridge(&mut gradient, &system.norms, &fit.coefficients, |l| {
            -system.ridge(l)
        });
    }
    let stop = Stop {
        // Below this the direction is rounding noise of the storage type.
        residual: T::UNIT_ROUND_OFF,
        against: None,
        limit: iterations,
    };
    let outcome = conjugate_gradients(&mut system, &mut fit.coefficients, gradient, stop, |iteration| {
        control.step(
            "solving jointly",
            span.0 + (span.1 - span.0) * iteration as f64 / iterations as f64,
        )
    })?;
    residual(domain, &problem.samples, &fit.active, &fit.coefficients, r);
    // Iterations are fixed on purpose: functions are exchanged long before the residual ends.
    Ok(SolverOutcome {
        goal: None,
        ..outcome
    })
}

/// The normal equations of the generating system, all levels side by side, with their diagonal.
struct Generating<'p, 'a, T> {
    problem: &'p Problem<'a, T>,
    active: &'p [ActiveSet],
    norms: Packed<T>,
}

impl<T: Real> Generating<'_, '_, T> {
    fn ridge(&self, level: usize) -> T {
        T::from_f64(if level == 0 { 0.0 } else { self.problem.ridge })
    }
}

impl<T: Real> System for Generating<'_, '_, T> {
    type Vector = Packed<T>;

    fn apply(&mut self, p: &Packed<T>, image: &mut Packed<T>) {
        apply_normal_matrix(self.problem.domain, self.active, p, image);
        if self.problem.ridge > 0.0 {
            add_ridge(image, &self.norms, p, |level| self.ridge(level));
        }
    }

    fn precondition(&mut self, r: &Packed<T>, z: &mut Packed<T>) -> f64 {
        let scale = |level: usize| T::one() / (T::one() + self.ridge(level));
        precondition(r, &self.norms, z, scale);
        dot(r, z)
    }

    fn dot(&self, a: &Packed<T>, b: &Packed<T>) -> f64 {
        dot(a, b)
    }

    fn add(&self, y: &mut Packed<T>, a: f64, x: &Packed<T>) {
        axpy(y, T::from_f64(a), x);
    }

    fn turn(&self, p: &mut Packed<T>, b: f64, z: &Packed<T>) {
        let b = T::from_f64(b);
        for (p, z) in p.iter_mut().zip(z) {
            p.par_iter_mut()
                .with_min_len(DOT_CHUNK)
                .zip(z)
                .for_each(|(p, &z)| *p = z + b * *p);
        }
    }
}

/// `‖B‖²` of every active function.
fn squared_norms<T: Real>(domain: &Domain<T>, active: &[ActiveSet]) -> Packed<T> {
    active
        .iter()
        .enumerate()
        .map(|(level, set)| {
            let square = |n: &f64| T::from_f64(n * n);
            let [nx, ny, nz] = domain
                .axes
                .map(|a| a.norms(level).iter().map(square).collect::<Vec<_>>());
            let mut out = Vec::with_capacity(set.len());
            for (z, &nz) in nz.iter().enumerate() {
                for (y, &ny) in ny.iter().enumerate() {
                    let row = nz * ny;
                    out.extend(set.x(set.row(y, z)).iter().map(|&x| row * nx[x as usize]));
                }
            }
            out
        })
        .collect()
}

/// `z = scale g / ‖B‖²`.
fn precondition<T: Real>(g: &Packed<T>, norms: &Packed<T>, z: &mut Packed<T>, scale: impl Fn(usize) -> T) {
    for (level, ((z, g), n)) in z.iter_mut().zip(g).zip(norms).enumerate() {
        let scale = scale(level);
        z.par_iter_mut()
            .with_min_len(DOT_CHUNK)
            .zip(g)
            .zip(n)
            .for_each(|((z, &g), &n)| *z = scale * g / n);
    }
}

/// `y += weight ‖B‖² x`.
fn add_ridge<T: Real>(y: &mut Packed<T>, norms: &Packed<T>, x: &Packed<T>, weight: impl Fn(usize) -> T) {
    for (level, ((y, x), n)) in y.iter_mut().zip(x).zip(norms).enumerate() {
        let weight = weight(level);
        y.par_iter_mut()
            .with_min_len(DOT_CHUNK)
            .zip(x)
            .zip(n)
            .for_each(|((y, &x), &n)| *y += weight * n * x);
    }
}

fn axpy<T: Real>(y: &mut Packed<T>, a: T, x: &Packed<T>) {
    for (y, x) in y.iter_mut().zip(x) {
        y.par_iter_mut()
            .with_min_len(DOT_CHUNK)
            .zip(x)
            .for_each(|(y, &x)| *y += a * x);
    }
}

/// Dot product in double precision, in a fixed order.
pub(crate) fn dot<T: Real>(a: &Packed<T>, b: &Packed<T>) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| {
            let terms: Vec<f64> = a
                .par_chunks(DOT_CHUNK)
                .zip(b.par_chunks(DOT_CHUNK))
                .map(|(a, b)| dot_chunk(a, b))
                .collect();
            terms.iter().sum::<f64>()
        })
        .sum()
}

fn dot_chunk<T: Real>(a: &[T], b: &[T]) -> f64 {
    let mut lanes = [0.0_f64; DOT_LANES];
    let (a_chunks, b_chunks) = (a.chunks_exact(DOT_LANES), b.chunks_exact(DOT_LANES));
    let tail: f64 = a_chunks
        .remainder()
        .iter()
        .zip(b_chunks.remainder())
        .map(|(&x, &y)| x.as_f64() * y.as_f64())
        .sum();
    for (a, b) in a_chunks.zip(b_chunks) {
        for l in 0..DOT_LANES {
            lanes[l] += a[l].as_f64() * b[l].as_f64();
        }
    }
    lanes.iter().sum::<f64>() + tail
}
