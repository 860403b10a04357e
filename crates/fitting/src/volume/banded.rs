//! Exact least squares along one axis: the banded Cholesky factor of its Gram matrix.

use bspline::Real;

use super::axis::Axis;
use crate::lines::{LineSolve, rows_mut};

/// `G = L Lᵀ` of half-bandwidth 3, factorized in `f64`, applied in `T`.
///
/// Three of them, one per axis, solve a level's tensor-product normal equations exactly.
#[derive(Clone, Debug)]
pub(crate) struct BandCholesky<T> {
    /// `lower[i][j] = L[i][i-j] / L[i][i]`, `j = 1..=3` (slot 0 unused).
    forward: Vec<[T; 4]>,
    /// `L[i+j][i] / L[i][i]`, `j = 1..=3`.
    backward: Vec<[T; 4]>,
    /// `1 / L[i][i]`.
    inverse_diagonal: Vec<T>,
}

impl<T: Real> BandCholesky<T> {
    /// Factor of the Gram matrix of one level of an axis.
    pub fn of_level(axis: &Axis, level: usize) -> Self {
        Self::new(&axis.gram(level))
    }

    /// Factor of the symmetric matrix whose row `s` holds columns `s ..= s+3`.
    ///
    /// # Panics
    /// If a pivot is not positive: the Gram matrix of a level above the finest is positive definite, since
    /// every function meets samples of its own.
    fn new(gram: &[[f64; 4]]) -> Self {
        let n = gram.len();
        let mut l = vec![[0.0_f64; 4]; n]; // l[i][j] = L[i][i-j]
        for i in 0..n {
            for back in (0..=3.min(i)).rev() {
                let k = i - back;
                let mut sum = gram[k][back];
                for m in 1..=3 - back {
                    if m <= k {
                        sum -= l[i][back + m] * l[k][m];
                    }
                }
                l[i][back] = if back == 0 {
                    assert!(
                        sum > 0.0,
                        "Gram matrix not positive definite at function {i}: pivot {sum}"
                    );
                    sum.sqrt()
                } else {
                    sum / l[k][0]
                };
            }
        }
        let t = T::from_f64;
        let forward = (0..n)
            .map(|i| std::array::from_fn(|j| t(l[i][j] / l[i][0])))
            .collect();
        let backward = (0..n)
            .map(|i| {
                std::array::from_fn(|j| {
                    if i + j < n {
                        t(l[i + j][j] / l[i][0])
                    } else {
                        T::zero()
                    }
                })
            })
            .collect();
        let inverse_diagonal = l.iter().map(|row| t(1.0 / row[0])).collect();
        Self {
            forward,
            backward,
            inverse_diagonal,
        }
    }

    /// `row = row/L_ii - Σ_j factor[j] others[j]`, terms in the order given.
    #[inline(always)]
    fn eliminate(row: &mut [T], inverse: T, factor: [T; 3], others: [&[T]; 3]) {
        let [a, b, c] = others;
        let n = row.len();
        let (a, b, c) = (&a[..n], &b[..n], &c[..n]);
        for i in 0..n {
            row[i] = row[i] * inverse - factor[0] * a[i] - factor[1] * b[i] - factor[2] * c[i];
        }
    }

    /// The same where fewer than three rows come before.
    #[inline(always)]
    fn eliminate_one(row: &mut [T], factor: T, other: &[T]) {
        for (r, &o) in row.iter_mut().zip(other) {
            *r -= factor * o;
        }
    }

    #[inline(always)]
    fn scale(row: &mut [T], by: T) {
        for r in row {
            *r *= by;
        }
    }
}

impl<T: Real> LineSolve<T> for BandCholesky<T> {
    #[inline(always)]
    fn solve<R: AsRef<[T]> + AsMut<[T]>>(&self, rows: &mut [R]) {
        let n = rows.len();
        assert_eq!(n, self.inverse_diagonal.len(), "rows of one line");
        for i in 0..n {
            let (inverse, f) = (self.inverse_diagonal[i], self.forward[i]);
            if i >= 3 {
                let [c, b, a, row] = rows_mut(rows, [i - 3, i - 2, i - 1, i]);
                Self::eliminate(row, inverse, [f[1], f[2], f[3]], [a, b, c]);
            } else {
                Self::scale(rows[i].as_mut(), inverse);
                for j in 1..=i {
                    let [other, row] = rows_mut(rows, [i - j, i]);
                    Self::eliminate_one(row, f[j], other);
                }
            }
        }
        for i in (0..n).rev() {
            let (inverse, f) = (self.inverse_diagonal[i], self.backward[i]);
            if i + 3 < n {
                let [row, a, b, c] = rows_mut(rows, [i, i + 1, i + 2, i + 3]);
                Self::eliminate(row, inverse, [f[1], f[2], f[3]], [a, b, c]);
            } else {
                Self::scale(rows[i].as_mut(), inverse);
                for j in 1..n - i {
                    let [row, other] = rows_mut(rows, [i, i + j]);
                    Self::eliminate_one(row, f[j], other);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solution_satisfies_the_normal_equations() {
        for samples in [1, 2, 5, 6, 7, 9, 33, 182] {
            let axis = Axis::new(samples, 3);
            for level in 0..2 {
                let g = axis.gram(level);
                let n = g.len();
                let b: Vec<f64> = (0..n).map(|i| ((i * i + 3) as f64 * 0.7).sin()).collect();
                let mut rows: Vec<[f64; 1]> = b.iter().map(|&v| [v]).collect();
                BandCholesky::of_level(&axis, level).solve(&mut rows);
                for s in 0..n {
                    let mut sum = 0.0;
                    for t in s.saturating_sub(3)..(s + 4).min(n) {
                        sum += g[s.min(t)][s.abs_diff(t)] * rows[t][0];
                    }
                    assert!(
                        (sum - b[s]).abs() < 1e-9,
                        "{samples} samples, level {level}, row {s}: {sum} {}",
                        b[s]
                    );
                }
            }
        }
    }
}
