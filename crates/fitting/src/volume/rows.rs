//! Row kernels: what prolongation, interpolation and Gram filters do along x, and to whole rows along y and z.
//!
//! A row of the finest level is kept in two *phases*, so that every loop runs over contiguous lanes: with `m`
//! cells on the next coarser level, even functions `E[s] = t[2s]` (`s = 0 ..= m+1`) and odd ones
//! `O[s] = t[2s-1]` (`s = 1 ..= m+1`), each between zeros. Coarse function `s` is refined by
//! `O[s] = (C[s-1] + 6 C[s] + C[s+1]) / 8` and `E[s] = (C[s] + C[s+1]) / 2` (knot insertion at midpoints).

use bspline::Real;

/// Where the phases of a row lie in its buffer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Phases {
    /// Cells of the next coarser level along x.
    m: usize,
}

impl Phases {
    pub fn new(coarse_cells: usize) -> Self {
        Self { m: coarse_cells }
    }

    /// Length of one phase with its zeros; `E[s]` and `O[s]` lie at `s + 1` of theirs.
    fn half(self) -> usize {
        self.m + 5
    }

    /// Length of a row buffer; the second half holds the odd phase.
    pub fn len(self) -> usize {
        2 * self.half()
    }

    /// Place of fine function `s` in the buffer.
    #[inline(always)]
    pub fn slot(self, s: usize) -> usize {
        1 + s / 2 + (s & 1) * (self.half() + 1)
    }

    /// Sets the buffer to the refinement of the coarse row `c`.
    #[inline(always)]
    pub fn refine<T: Real>(self, c: &[T], out: &mut [T]) {
        let m = self.m;
        let (half, eighth, six) = (T::from_f64(0.5), T::from_f64(0.125), T::from_f64(6.0));
        let (even, odd) = out.split_at_mut(self.half());
        let (before, at, after) = (&c[..m + 1], &c[1..m + 2], &c[2..m + 3]);
        let odd = &mut odd[2..m + 3];
        for s in 0..m + 1 {
            odd[s] = (before[s] + after[s] + six * at[s]) * eighth;
        }
        let (at, after, even) = (&c[..m + 2], &c[1..m + 3], &mut even[1..m + 3]);
        for s in 0..m + 2 {
            even[s] = (at[s] + after[s]) * half;
        }
    }

    /// The transpose of [`Phases::refine`].
    #[inline(always)]
    pub fn restrict<T: Real>(self, row: &[T], out: &mut [T]) {
        let n = self.m + 3;
        let (half, eighth, three_quarters) = (T::from_f64(0.5), T::from_f64(0.125), T::from_f64(0.75));
        let (even, odd) = row.split_at(self.half());
        let (e_before, e) = (&even[..n], &even[1..n + 1]);
        let (o_before, o, o_after) = (&odd[..n], &odd[1..n + 1], &odd[2..n + 2]);
        let out = &mut out[..n];
        for s in 0..n {
            out[s] =
                three_quarters * o[s] + eighth * (o_before[s] + o_after[s]) + half * (e_before[s] + e[s]);
        }
    }

    /// Samples under the functions of `row`, in natural order: `f[k] = t[k] + 4 t[k+1] + t[k+2]` (times 1/6,
    /// left to the caller), `k = 0 ..= 2m`, written as even and odd samples.
    #[inline(always)]
    pub fn interpolate<T: Real>(self, row: &[T], out: &mut [T]) {
        let m = self.m;
        let four = T::from_f64(4.0);
        let (even, odd) = row.split_at(self.half());
        let (out_even, out_odd) = out.split_at_mut(self.half());
        // f[2s] = E[s] + 4 O[s+1] + E[s+1], s = 0 ..= m
        let (a, b, c, o) = (
            &even[1..m + 2],
            &odd[2..m + 3],
            &even[2..m + 3],
            &mut out_even[1..m + 2],
        );
        for s in 0..m + 1 {
            o[s] = a[s] + c[s] + four * b[s];
        }
        // f[2s-1] = O[s] + 4 E[s] + O[s+1], s = 1 ..= m
        let (a, b, c, o) = (
            &odd[2..m + 2],
            &even[2..m + 2],
            &odd[3..m + 3],
            &mut out_odd[2..m + 2],
        );
        for s in 0..m {
            o[s] = a[s] + c[s] + four * b[s];
        }
    }

    /// The transpose of [`Phases::interpolate`]: samples in phases to functions in phases.
    #[inline(always)]
    pub fn correlate<T: Real>(self, f: &[T], out: &mut [T]) {
        let m = self.m;
        let four = T::from_f64(4.0);
        let (f_even, f_odd) = f.split_at(self.half());
        let (even, odd) = out.split_at_mut(self.half());
        // t[s] collects f[s-2] + 4 f[s-1] + f[s]; t[2s] = fe[s-1] + 4 fo[s] + fe[s] with f[2s-1] at fo[s].
        let (a, b, c, o) = (
            &f_even[..m + 2],
            &f_odd[1..m + 3],
            &f_even[1..m + 3],
            &mut even[1..m + 3],
        );
        for s in 0..m + 2 {
            o[s] = a[s] + c[s] + four * b[s];
        }
        // t[2s-1] = fo[s-1] + 4 fe[s-1] + fo[s]
        let (a, b, c, o) = (
            &f_odd[1..m + 2],
            &f_even[1..m + 2],
            &f_odd[2..m + 3],
            &mut odd[2..m + 3],
        );
        for s in 0..m + 1 {
            o[s] = a[s] + c[s] + four * b[s];
        }
    }

    /// Splits samples `k = 0 ..= 2m` into phases.
    #[inline(always)]
    pub fn split<T: Real>(self, samples: &[T], out: &mut [T]) {
        let (even, odd) = out.split_at_mut(self.half());
        let (even, odd) = (&mut even[1..self.m + 2], &mut odd[2..self.m + 2]);
        for ((pair, e), o) in samples.chunks_exact(2).zip(&mut *even).zip(odd) {
            (*e, *o) = (pair[0], pair[1]);
        }
        even[self.m] = samples[2 * self.m];
    }

    /// Joins phases into samples `k = 0 ..= 2m`.
    #[inline(always)]
    pub fn join<T: Real>(self, row: &[T], samples: &mut [T]) {
        let (even, odd) = row.split_at(self.half());
        let (even, odd) = (&even[1..self.m + 2], &odd[2..self.m + 2]);
        for ((pair, &e), &o) in samples.chunks_exact_mut(2).zip(even).zip(odd) {
            (pair[0], pair[1]) = (e, o);
        }
        samples[2 * self.m] = even[self.m];
    }

    /// Joins phases into functions `s = 0 ..= 2m+2`.
    #[inline(always)]
    pub fn join_functions<T: Real>(self, row: &[T], functions: &mut [T]) {
        let (even, odd) = row.split_at(self.half());
        functions[0] = even[1];
        let (even, odd) = (&even[2..self.m + 3], &odd[2..self.m + 3]);
        for ((pair, &e), &o) in functions[1..].chunks_exact_mut(2).zip(even).zip(odd) {
            (pair[0], pair[1]) = (o, e);
        }
    }

    /// Splits functions `s = 0 ..= 2m+2` into phases.
    #[inline(always)]
    pub fn split_functions<T: Real>(self, functions: &[T], row: &mut [T]) {
        let (even, odd) = row.split_at_mut(self.half());
        even[1] = functions[0];
        let (even, odd) = (&mut even[2..self.m + 3], &mut odd[2..self.m + 3]);
        for ((pair, e), o) in functions[1..].chunks_exact(2).zip(even).zip(odd) {
            (*o, *e) = (pair[0], pair[1]);
        }
    }

    /// Applies the five-point Gram filter along x. `taps` holds a row per fine function, the rows in `inner`
    /// being all alike.
    #[inline(always)]
    pub fn gram<T: Real>(self, row: &[T], taps: &FiveTaps<T>, out: &mut [T]) {
        let m = self.m;
        let [_, _, c0, c1, c2] = taps.inner;
        let (even, odd) = row.split_at(self.half());
        let (out_even, out_odd) = out.split_at_mut(self.half());
        let n = m + 2;
        let (eb, e, ea) = (&even[..n], &even[1..n + 1], &even[2..n + 2]);
        let (o, oa, dst) = (&odd[1..n + 1], &odd[2..n + 2], &mut out_even[1..n + 1]);
        for s in 0..n {
            dst[s] = c0 * e[s] + c1 * (o[s] + oa[s]) + c2 * (eb[s] + ea[s]);
        }
        let n = m + 1;
        let (ob, o, oa) = (&odd[1..n + 1], &odd[2..n + 2], &odd[3..n + 3]);
        let (eb, e, dst) = (&even[1..n + 1], &even[2..n + 2], &mut out_odd[2..n + 2]);
        for s in 0..n {
            dst[s] = c0 * o[s] + c1 * (eb[s] + e[s]) + c2 * (ob[s] + oa[s]);
        }
        for (s, t) in &taps.outer {
            let mut sum = T::zero();
            for (j, &weight) in t.iter().enumerate() {
                // Columns outside the row have weight 0.
                if weight != T::zero() {
                    sum += weight * row[self.slot(s + j - 2)];
                }
            }
            out[self.slot(*s)] = sum;
        }
    }
}

/// The Gram filter of one axis on the finest level.
#[derive(Clone, Debug)]
pub(crate) struct FiveTaps<T> {
    /// Taps of every row that is not in `outer`, symmetric.
    pub inner: [T; 5],
    /// Rows near the ends, with their indices.
    pub outer: Vec<(usize, [T; 5])>,
    /// All rows.
    pub rows: Vec<[T; 5]>,
}

impl<T: Real> FiveTaps<T> {
    pub fn new(rows: &[[f64; 5]]) -> Self {
        let inner = [1.0, 8.0, 18.0, 8.0, 1.0].map(|t| t / 36.0);
        let convert = |row: &[f64; 5]| row.map(T::from_f64);
        let differs = |row: &[f64; 5]| row.iter().zip(inner).any(|(a, b)| (a - b).abs() > 1e-12);
        Self {
            inner: inner.map(T::from_f64),
            outer: rows
                .iter()
                .enumerate()
                .filter(|(_, r)| differs(r))
                .map(|(s, r)| (s, convert(r)))
                .collect(),
            rows: rows.iter().map(convert).collect(),
        }
    }

    /// `out = Σ_j taps[s][j] rows[j]` for whole rows, `rows[j]` standing for row `s + j - 2`.
    #[inline(always)]
    pub fn combine(&self, s: usize, rows: [&[T]; 5], out: &mut [T]) {
        let n = out.len();
        let [a, b, c, d, e] = rows.map(|r| &r[..n]);
        let t = self.rows[s];
        if t[0] == t[4] && t[1] == t[3] {
            for i in 0..n {
                out[i] = t[2] * c[i] + t[1] * (b[i] + d[i]) + t[0] * (a[i] + e[i]);
            }
        } else {
            for i in 0..n {
                out[i] = t[0] * a[i] + t[1] * b[i] + t[2] * c[i] + t[3] * d[i] + t[4] * e[i];
            }
        }
    }
}

/// `out = a`-weighted sum of the coarse rows that refine to fine row `s` along y or z: the weights are those
/// of [`Phases::refine`]; `row(s)` yields coarse row `s`.
#[inline(always)]
pub(crate) fn refine_rows<'a, T: Real>(s: usize, row: impl Fn(usize) -> &'a [T], out: &mut [T]) {
    let n = out.len();
    if s % 2 == 1 {
        let c = s.div_ceil(2);
        let (before, at, after) = (&row(c - 1)[..n], &row(c)[..n], &row(c + 1)[..n]);
        let (eighth, six) = (T::from_f64(0.125), T::from_f64(6.0));
        for i in 0..n {
            out[i] = (before[i] + after[i] + six * at[i]) * eighth;
        }
    } else {
        let (at, after, half) = (&row(s / 2)[..n], &row(s / 2 + 1)[..n], T::from_f64(0.5));
        for i in 0..n {
            out[i] = (at[i] + after[i]) * half;
        }
    }
}

/// The transpose of [`refine_rows`]: adds fine row `s` to the coarse rows it is refined from. Coarse row `c`
/// lies at `(c - first)·stride` of `out`.
#[inline(always)]
pub(crate) fn restrict_rows<T: Real>(s: usize, row: &[T], out: &mut [T], first: usize, stride: usize) {
    let mut add = |c: usize, weight: f64| {
        let (weight, start) = (T::from_f64(weight), (c - first) * stride);
        for (o, &r) in out[start..start + row.len()].iter_mut().zip(row) {
            *o += weight * r;
        }
    };
    if s % 2 == 1 {
        let c = s.div_ceil(2);
        add(c - 1, 0.125);
        add(c, 0.75);
        add(c + 1, 0.125);
    } else {
        add(s / 2, 0.5);
        add(s / 2 + 1, 0.5);
    }
}

/// `out = a + 4 b + c`.
#[inline(always)]
pub(crate) fn one_four_one<T: Real>(a: &[T], b: &[T], c: &[T], out: &mut [T]) {
    let n = out.len();
    let (a, b, c, four) = (&a[..n], &b[..n], &c[..n], T::from_f64(4.0));
    for i in 0..n {
        out[i] = a[i] + c[i] + four * b[i];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::axis::Axis;

    fn noise(n: usize, seed: u64) -> Vec<f64> {
        (0..n as u64)
            .map(|i| (((i * 7919 + seed * 104_729) % 1000) as f64 - 500.0) / 500.0)
            .collect()
    }

    fn to_phases(p: Phases, natural: &[f64]) -> Vec<f64> {
        let mut row = vec![0.0; p.len()];
        for (s, &v) in natural.iter().enumerate() {
            row[p.slot(s)] = v;
        }
        row
    }

    #[test]
    fn refinement_keeps_the_function() {
        for m in [1, 2, 7, 40] {
            let (p, c) = (Phases::new(m), noise(m + 3, 1));
            let mut fine = vec![0.0; p.len()];
            p.refine(&c, &mut fine);
            let natural: Vec<f64> = (0..2 * m + 3).map(|s| fine[p.slot(s)]).collect();
            for k in 0..4 * m {
                let x = k as f64 / 4.0;
                let at = |x: f64, c: &[f64]| -> f64 {
                    let w = bspline::cubic::values(x.fract());
                    (0..4).map(|j| w[j] * c[x as usize + j]).sum()
                };
                assert!((at(x, &c) - at(2.0 * x, &natural)).abs() < 1e-14, "m {m}, x {x}");
            }
        }
    }

    #[test]
    fn transposes_agree_with_their_operators() {
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        for m in [1, 2, 7, 40] {
            let p = Phases::new(m);
            let (c, y) = (noise(m + 3, 1), to_phases(p, &noise(2 * m + 3, 2)));
            let (mut pc, mut pty) = (vec![0.0; p.len()], vec![0.0; m + 3]);
            p.refine(&c, &mut pc);
            p.restrict(&y, &mut pty);
            assert!((dot(&pc, &y) - dot(&c, &pty)).abs() < 1e-12);

            let mut samples = vec![0.0; p.len()];
            p.split(&noise(2 * m + 1, 3), &mut samples);
            let (mut by, mut btf) = (vec![0.0; p.len()], vec![0.0; p.len()]);
            p.interpolate(&y, &mut by);
            p.correlate(&samples, &mut btf);
            assert!((dot(&by, &samples) - dot(&y, &btf)).abs() < 1e-12);

            let coarse = noise(5 * (m + 3), 4);
            for s in 0..2 * m + 3 {
                let row = noise(5, s as u64);
                let mut refined = vec![0.0; 5];
                refine_rows(s, |c| &coarse[5 * c..5 * c + 5], &mut refined);
                let mut restricted = vec![0.0; coarse.len()];
                restrict_rows(s, &row, &mut restricted, 0, 5);
                assert!((dot(&refined, &row) - dot(&coarse, &restricted)).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn gram_filter_is_interpolation_and_its_transpose() {
        for samples in [5, 9, 13, 16, 181] {
            let axis = Axis::new(samples, 3);
            let p = Phases::new(axis.cells_at(1));
            let taps = FiveTaps::<f64>::new(&axis.five_taps());
            let t = to_phases(p, &noise(axis.functions(2), 5));
            let mut f = vec![0.0; p.len()];
            p.interpolate(&t, &mut f);
            let mut natural = vec![0.0; axis.padded()];
            p.join(&f, &mut natural);
            for (k, v) in natural.iter_mut().enumerate() {
                *v *= axis.weight(k) / 36.0;
            }
            p.split(&natural, &mut f);
            let (mut expected, mut got) = (vec![0.0; p.len()], vec![0.0; p.len()]);
            p.correlate(&f, &mut expected);
            p.gram(&t, &taps, &mut got);
            for (a, b) in got.iter().zip(&expected) {
                assert!((a - b).abs() < 1e-14, "{samples} samples: {a} {b}");
            }
            // The same rows as whole-row combinations.
            let rows: Vec<[f64; 1]> = (0..axis.functions(2)).map(|s| [t[p.slot(s)]]).collect();
            let zero = [0.0];
            for s in 0..rows.len() {
                let at = |j: usize| {
                    (s + j)
                        .checked_sub(2)
                        .and_then(|i| rows.get(i))
                        .map_or(&zero[..], |r| &r[..])
                };
                let mut out = [0.0];
                taps.combine(s, std::array::from_fn(at), &mut out);
                assert!((out[0] - expected[p.slot(s)]).abs() < 1e-14);
            }
        }
    }
}
