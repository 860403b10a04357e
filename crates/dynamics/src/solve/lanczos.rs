//! Extreme eigenvalues of a preconditioned operator, from the coefficients of conjugate gradients.

use bspline::Real;

use super::dot::dot;
use super::pcg::{System, add_scaled};

/// Vectors of the recurrence.
#[derive(Clone, Debug)]
pub(crate) struct Lanczos<T> {
    r: Vec<T>,
    z: Vec<T>,
    p: Vec<T>,
    q: Vec<T>,
}

impl<T: Real> Lanczos<T> {
    pub fn new(n: usize) -> Self {
        let zeros = || vec![T::zero(); n];
        Self {
            r: zeros(),
            z: zeros(),
            p: zeros(),
            q: zeros(),
        }
    }

    /// Estimates of the least and the largest eigenvalue of `B H`, where `precondition` applies `B`, from within. The start
    /// is rough and always the same: a smooth one would hide the largest eigenvalues.
    pub fn ends(&mut self, system: &mut impl System<T>, steps: usize) -> [f64; 2] {
        let Self { r, z, p, q } = self;
        let mut seed = 0x9E37_79B9_7F4A_7C15_u64;
        for v in r.iter_mut() {
            seed = seed
                .wrapping_mul(0xD129_42F0_5A3B_4B79)
                .wrapping_add(0x1405_7B7E_F767_814F);
            *v = T::from_f64((seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5);
        }
        let (mut diagonal, mut off) = (Vec::new(), Vec::new());
        let (mut before, mut last_alpha) = (0.0, 1.0);
        for step in 0..steps {
            system.precondition(r, z);
            let rz = dot(r, z);
            if rz.is_nan() || rz <= 0.0 {
                break;
            }
            let beta = if step == 0 { 0.0 } else { rz / before };
            let keep = T::from_f64(beta);
            for (p, z) in p.iter_mut().zip(z.iter()) {
                *p = if step == 0 { *z } else { *z + keep * *p };
            }
            let alpha = rz / system.apply(p, q);
            if !(alpha > 0.0 && alpha.is_finite()) {
                break;
            }
            diagonal.push(1.0 / alpha + if step > 0 { beta / last_alpha } else { 0.0 });
            if step > 0 {
                off.push(beta.sqrt() / last_alpha);
            }
            add_scaled(r, T::from_f64(-alpha), q);
            (before, last_alpha) = (rz, alpha);
        }
        let negated: Vec<f64> = diagonal.iter().map(|d| -d).collect();
        let least = -largest_of_tridiagonal(&negated, &off);
        [least, largest_of_tridiagonal(&diagonal, &off)]
    }
}

/// Largest eigenvalue of a symmetric tridiagonal matrix, by bisection on Sturm sequences; 0 of an empty one.
fn largest_of_tridiagonal(diagonal: &[f64], off: &[f64]) -> f64 {
    if diagonal.is_empty() {
        return 0.0;
    }
    let around = |i: usize| {
        let left = if i > 0 { off[i - 1].abs() } else { 0.0 };
        left + off.get(i).map_or(0.0, |o| o.abs())
    };
    let mut low = diagonal.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let rows = (0..diagonal.len()).map(|i| diagonal[i] + around(i));
    let mut high = rows.fold(low, f64::max);
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
            if pivot == 0.0 {
                // An eigenvalue of the leading part: either side may be taken, but not its inverse.
                pivot = -f64::MIN_POSITIVE;
            }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn largest_eigenvalue_of_the_path_laplacian() {
        let n = 9;
        let off = vec![-1.0; n - 1];
        let found = largest_of_tridiagonal(&vec![2.0; n], &off);
        let exact = 2.0 + 2.0 * (std::f64::consts::PI / (n as f64 + 1.0)).cos();
        assert!((found - exact).abs() < 1e-12, "{found} {exact}");
    }
}
