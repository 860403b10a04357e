//! Joint least squares over the active functions of all levels by preconditioned conjugate gradients.

use bspline::Real;
use rayon::prelude::*;

use super::active::{ActiveSet, Packed};
use super::domain::{Domain, Samples};
use super::gram::apply_normal_matrix;
use super::residual::{correlations, residual};
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
                if level == 0 { ActiveSet::full(size) } else { ActiveSet::empty(size) }
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

/// Minimizes `Σ_k w_k (f(k) - d_k)²` over the coefficients of `fit` by `iterations` steps of conjugate gradients,
/// preconditioned by the diagonal `‖B‖²` of the generating system (all levels side by side).
///
/// Functions that several levels can express make the system singular but consistent; conjugate gradients do
/// not mind. The residual norm at the samples falls in every step. `r` holds the residual of the start and, on
/// return, that of the result.
pub(crate) fn solve_jointly<T: Real>(
    domain: &Domain<T>,
    samples: &Samples<T>,
    fit: &mut Fit<T>,
    r: &mut [T],
    iterations: usize,
    control: &mut Control,
    stage: (&'static str, f64, f64),
) -> Result<(), FitError> {
    let inverse_diagonal = inverse_diagonal(domain, &fit.active);
    let finest = domain.finest();
    let dense = correlations(domain, r, &fit.active[finest]);
    let mut gradient: Packed<T> = dense
        .into_iter()
        .enumerate()
        .map(|(level, g)| if level == finest { g } else { fit.active[level].gather(&g) })
        .collect();
    let mut z: Packed<T> = gradient.clone();
    precondition(&gradient, &inverse_diagonal, &mut z);
    let mut p = z.clone();
    let mut q = z.clone();
    let mut rho = dot(&gradient, &z);
    let start = rho;
    for iteration in 0..iterations {
        let (name, from, to) = stage;
        control.step(name, from + (to - from) * iteration as f64 / iterations as f64)?;
        // Below this the direction is rounding noise of the storage type.
        if rho <= start * T::UNIT_ROUND_OFF * T::UNIT_ROUND_OFF || rho == 0.0 {
            break;
        }
        apply_normal_matrix(domain, &fit.active, &p, &mut q);
        let curvature = dot(&p, &q);
        if curvature <= 0.0 {
            break;
        }
        let alpha = T::from_f64(rho / curvature);
        axpy(&mut fit.coefficients, alpha, &p);
        axpy(&mut gradient, -alpha, &q);
        precondition(&gradient, &inverse_diagonal, &mut z);
        let next = dot(&gradient, &z);
        let beta = T::from_f64(next / rho);
        rho = next;
        for (p, z) in p.iter_mut().zip(&z) {
            p.par_iter_mut().with_min_len(DOT_CHUNK).zip(z).for_each(|(p, &z)| *p = z + beta * *p);
        }
    }
    residual(domain, samples, &fit.active, &fit.coefficients, r);
    Ok(())
}

/// `1/‖B‖²` of every active function.
fn inverse_diagonal<T: Real>(domain: &Domain<T>, active: &[ActiveSet]) -> Packed<T> {
    active
        .iter()
        .enumerate()
        .map(|(level, set)| {
            let [nx, ny, nz] =
                domain.axes.map(|a| a.norms(level).iter().map(|n| T::from_f64(1.0 / (n * n))).collect::<Vec<_>>());
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

fn precondition<T: Real>(g: &Packed<T>, inverse_diagonal: &Packed<T>, z: &mut Packed<T>) {
    for ((z, g), d) in z.iter_mut().zip(g).zip(inverse_diagonal) {
        z.par_iter_mut().with_min_len(DOT_CHUNK).zip(g).zip(d).for_each(|((z, &g), &d)| *z = g * d);
    }
}

fn axpy<T: Real>(y: &mut Packed<T>, a: T, x: &Packed<T>) {
    for (y, x) in y.iter_mut().zip(x) {
        y.par_iter_mut().with_min_len(DOT_CHUNK).zip(x).for_each(|(y, &x)| *y += a * x);
    }
}

/// Dot product in double precision, in a fixed order.
pub(crate) fn dot<T: Real>(a: &Packed<T>, b: &Packed<T>) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| {
            let terms: Vec<f64> =
                a.par_chunks(DOT_CHUNK).zip(b.par_chunks(DOT_CHUNK)).map(|(a, b)| dot_chunk(a, b)).collect();
            terms.iter().sum::<f64>()
        })
        .sum()
}

fn dot_chunk<T: Real>(a: &[T], b: &[T]) -> f64 {
    let mut lanes = [0.0_f64; DOT_LANES];
    let (a_chunks, b_chunks) = (a.chunks_exact(DOT_LANES), b.chunks_exact(DOT_LANES));
    let tail: f64 =
        a_chunks.remainder().iter().zip(b_chunks.remainder()).map(|(&x, &y)| x.to_f64() * y.to_f64()).sum();
    for (a, b) in a_chunks.zip(b_chunks) {
        for l in 0..DOT_LANES {
            lanes[l] += a[l].to_f64() * b[l].to_f64();
        }
    }
    lanes.iter().sum::<f64>() + tail
}
