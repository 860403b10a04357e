//! The interpolating prefilter: cubic B-spline coefficients that pass through given samples.
//!
//! Along one line the conditions are `(c[k-1] + 4 c[k] + c[k+1]) / 6 = d[k]` [Unser99; Thevenaz00].
//! The recursion here is the exact factorization of that tridiagonal matrix; its pivots converge within a dozen
//! rows to those of the usual recursive filter with pole `√3 - 2`, so it costs the same and needs no
//! truncated start. A three-dimensional prefilter is the recursion along x, y and z in turn.

use bspline::Real;

use crate::lines::{LineSolve, rows_mut};
use crate::volume::interpolate_voxels;

/// Cubic B-spline coefficients through the voxels `values` (x fastest) of a volume of `dims`, [not-a-knot](LineEnds)
/// at the ends: coefficient `(i, j, k)`, `-1 <= i <= nx` and so on, at `(i + 1) + fx ((j + 1) + fy (k + 1))`.
///
/// Returns the coefficients and `[fx, fy, fz]`: each axis is continued by its edge value up to
/// `4 ceil((n - 1)/4) + 3` coefficients, a whole number of coarse cells. Time is linear, two passes over memory.
///
/// # Panics
/// If an axis has no voxel or the number of values is not that of the dimensions.
pub fn interpolating_coefficients<T: Real>(dims: [usize; 3], values: &[f32]) -> (Vec<T>, [usize; 3]) {
    assert!(
        !dims.contains(&0) && dims.iter().product::<usize>() == values.len(),
        "{dims:?} voxels"
    );
    interpolate_voxels(dims, values)
}

/// What happens at the two ends of a line of samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineEnds {
    /// Not-a-knot: the third derivative does not jump at the second and second last sample, so that any cubic
    /// is reproduced on the whole line, ends included (a parabola through 3 samples, a line through 2, a
    /// constant through 1). `n` samples give `n + 2` coefficients.
    NotAKnot,
    /// The coefficients beyond both ends are zero; `n` samples give `n` coefficients.
    Zero,
}

/// Prefilter of one axis.
#[derive(Clone, Debug)]
pub struct Prefilter<T> {
    samples: usize,
    ends: LineEnds,
    /// `1/β` of the tridiagonal factorization with `β₀ = 4`, `β = 4 - 1/β_previous`.
    inverse_pivots: Vec<T>,
    one: T,
    four: T,
    six: T,
}

impl<T: Real> Prefilter<T> {
    /// Factorizes the conditions of a line of `samples` samples.
    ///
    /// # Panics
    /// If `samples` is 0.
    pub fn new(samples: usize, ends: LineEnds) -> Self {
        assert!(samples > 0, "a line needs a sample");
        let mut pivot = 4.0_f64;
        let inverse_pivots = (0..samples)
            .map(|_| {
                let u = 1.0 / pivot;
                pivot = 4.0 - u;
                T::from_f64(u)
            })
            .collect();
        let t = T::from_f64;
        Self {
            samples,
            ends,
            inverse_pivots,
            one: T::one(),
            four: t(4.0),
            six: t(6.0),
        }
    }

    /// Rows that [`LineSolve::solve`] overwrites, at least.
    ///
    /// `NotAKnot` expects sample `k` in row `k + 1` and leaves coefficient `i` in row `i + 1`; rows beyond
    /// coefficient `n` are filled with the last sample. `Zero` has sample and coefficient `k` in row `k`.
    pub fn row_count(&self) -> usize {
        match self.ends {
            LineEnds::NotAKnot => self.samples + 2,
            LineEnds::Zero => self.samples,
        }
    }

    /// Solves rows `first..last`, whose row before (if any) holds a known coefficient, or is missing for zero.
    /// `known_after` says that row `last` holds a known coefficient too.
    #[inline(always)]
    fn sweep<R: AsRef<[T]> + AsMut<[T]>>(
        &self,
        rows: &mut [R],
        first: usize,
        last: usize,
        known_after: bool,
    ) {
        let six = self.six;
        for i in first..last {
            let u = self.inverse_pivots[i - first];
            if i == 0 {
                for d in rows[0].as_mut() {
                    *d = six * *d * u;
                }
            } else {
                let [before, row] = rows_mut(rows, [i - 1, i]);
                for (d, &y) in row.iter_mut().zip(&*before) {
                    *d = (six * *d - y) * u;
                }
            }
        }
        let top = if known_after { last } else { last.max(1) - 1 };
        for i in (first..top).rev() {
            let u = self.inverse_pivots[i - first];
            let [row, after] = rows_mut(rows, [i, i + 1]);
            for (y, &c) in row.iter_mut().zip(&*after) {
                *y -= u * c;
            }
        }
    }

    #[inline(always)]
    fn not_a_knot<R: AsRef<[T]> + AsMut<[T]>>(&self, rows: &mut [R]) {
        let n = self.samples;
        for i in n + 2..rows.len() {
            let [last, row] = rows_mut(rows, [n, i]);
            row.copy_from_slice(last);
        }
        if n < 4 {
            return self.short_line(rows);
        }
        // Eliminating c[-1] by Δ⁴c = 0 and c[0] by the second condition leaves c[1] = d[1] - (d[0] - 2 d[1] + d[2])/6.
        let (four, six, sixth) = (self.four, self.six, self.one / self.six);
        let eight = four + four;
        if n == 4 {
            // Both ends read both middle samples, so the two explicit coefficients are formed together.
            let [a, b, c, d, e, f] = rows_mut(rows, [0, 1, 2, 3, 4, 5]);
            for l in 0..a.len() {
                let (d0, d1, d2, d3) = (b[l], c[l], d[l], e[l]);
                let (c1, c2) = ((eight * d1 - d0 - d2) * sixth, (eight * d2 - d3 - d1) * sixth);
                (a[l], b[l], c[l]) = (six * d0 - c1, six * d1 - four * c1, c1);
                (f[l], e[l], d[l]) = (six * d3 - c2, six * d2 - four * c2, c2);
            }
        } else {
            // The explicit coefficient takes the place of the sample it was made from, after both were read.
            let explicit = |rows: &mut [R], at: [usize; 4]| {
                let [outer, second, third, inner] = rows_mut(rows, at);
                for (((o, s), t), &d2) in outer.iter_mut().zip(second).zip(third).zip(&*inner) {
                    let (d0, d1) = (*s, *t);
                    let c1 = (eight * d1 - d0 - d2) * sixth;
                    *o = six * d0 - c1;
                    *s = six * d1 - four * c1;
                    *t = c1;
                }
            };
            explicit(rows, [0, 1, 2, 3]);
            explicit(rows, [n + 1, n, n - 1, n - 2]);
            self.sweep(rows, 3, n - 1, true);
        }
        let finish = |rows: &mut [R], at: [usize; 3]| {
            let [outer, second, inner] = rows_mut(rows, at);
            for ((o, s), &c2) in outer.iter_mut().zip(second).zip(&*inner) {
                *s -= c2;
                *o -= four * *s;
            }
        };
        finish(rows, [0, 1, 3]);
        finish(rows, [n + 1, n, n - 2]);
    }

    /// One, two or three samples: the polynomial through them.
    #[inline(always)]
    fn short_line<R: AsRef<[T]> + AsMut<[T]>>(&self, rows: &mut [R]) {
        let (two, three, sixth) = (self.one + self.one, self.four - self.one, self.one / self.six);
        match self.samples {
            1 => {
                let [a, b, c] = rows_mut(rows, [0, 1, 2]);
                a.copy_from_slice(b);
                c.copy_from_slice(b);
            }
            2 => {
                let [a, b, c, d] = rows_mut(rows, [0, 1, 2, 3]);
                for l in 0..a.len() {
                    (a[l], d[l]) = (two * b[l] - c[l], two * c[l] - b[l]);
                }
            }
            _ => {
                let [a, b, c, d, e] = rows_mut(rows, [0, 1, 2, 3, 4]);
                for l in 0..a.len() {
                    let (d0, d1, d2) = (b[l], c[l], d[l]);
                    let bend = (d0 - two * d1 + d2) * sixth;
                    a[l] = three * (d0 - d1) + d2 - bend;
                    (b[l], c[l], d[l]) = (d0 - bend, d1 - bend, d2 - bend);
                    e[l] = three * (d2 - d1) + d0 - bend;
                }
            }
        }
    }
}

impl<T: Real> LineSolve<T> for Prefilter<T> {
    #[inline(always)]
    fn solve<R: AsRef<[T]> + AsMut<[T]>>(&self, rows: &mut [R]) {
        debug_assert!(rows.len() >= self.row_count());
        match self.ends {
            LineEnds::Zero => self.sweep(rows, 0, self.samples, false),
            LineEnds::NotAKnot => self.not_a_knot(rows),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(samples: usize, ends: LineEnds, data: impl Fn(usize) -> f64) -> Vec<f64> {
        let filter = Prefilter::<f64>::new(samples, ends);
        let first = usize::from(ends == LineEnds::NotAKnot);
        let mut rows = vec![[0.0]; filter.row_count() + 2 * first];
        for k in 0..samples {
            rows[k + first] = [data(k)];
        }
        filter.solve(&mut rows);
        rows.into_iter().map(|r| r[0]).collect()
    }

    #[test]
    fn coefficients_interpolate() {
        let data = |k: usize| ((k * k * 37 + 11) % 101) as f64;
        for n in 1..40 {
            let c = line(n, LineEnds::NotAKnot, data);
            for k in 0..n {
                let f = (c[k] + 4.0 * c[k + 1] + c[k + 2]) / 6.0;
                assert!((f - data(k)).abs() < 1e-11, "not a knot, {n} samples, {k}: {f}");
            }
            assert_eq!(c[n + 2..], [data(n - 1); 2], "continued by the last sample");
            let c = line(n, LineEnds::Zero, data);
            for k in 0..n {
                let at = |i: Option<usize>| i.and_then(|i| c.get(i)).copied().unwrap_or(0.0);
                let f = (at(k.checked_sub(1)) + 4.0 * c[k] + at(Some(k + 1))) / 6.0;
                assert!((f - data(k)).abs() < 1e-11, "zero, {n} samples, {k}: {f}");
            }
        }
    }

    #[test]
    fn third_derivative_does_not_jump_at_the_second_sample() {
        for n in 4..20 {
            let c = line(n, LineEnds::NotAKnot, |k| ((k * k * 37 + 11) % 101) as f64);
            let fourth_difference =
                |s: usize| c[s] - 4.0 * c[s + 1] + 6.0 * c[s + 2] - 4.0 * c[s + 3] + c[s + 4];
            assert!(
                fourth_difference(0).abs() < 1e-10 && fourth_difference(n - 3).abs() < 1e-10,
                "{n} samples"
            );
        }
    }
}
