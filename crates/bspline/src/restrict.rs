//! The control coefficients of a uniform cubic spline on a part of its domain.
//!
//! A spline lies within the hull of its control coefficients, but the coefficients of a whole cell say little
//! about a small box inside it. Restriction writes the same function on `[a, b]` as a clamped spline with the
//! knots `a a a a, k₁ … k_m, b b b b` (`kᵢ` the integers strictly between), whose coefficients are the blossom
//! at consecutive triples of knots [Ramshaw87; Piegl97 §5.2]. Their hull exceeds the range of the
//! function by a share that falls with the square of the box, and is exact for linear functions.

mod slopes;

pub use self::slopes::{SlopeRanges, slope_ranges};

use crate::Real;
use crate::vectorized::vectorized;

/// Cells that one call covers.
pub const CELLS: usize = 8;
/// Coefficients read, and most rows given: one for each coefficient when `[a, b]` is everything.
pub const COEFFICIENTS: usize = CELLS + 3;

/// The rows of the restriction to `[a, b]` along one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RestrictedAxis<T> {
    count: usize,
    start: [u8; COEFFICIENTS],
    weights: [[T; 4]; COEFFICIENTS],
}

impl<T: Real> RestrictedAxis<T> {
    /// Rows for `0 <= a <= b <= 8`, in cells: cell `k` reads coefficients `k ..= k+3`.
    ///
    /// Every row is a convex combination of four successive coefficients (weights `>= 0`, sum 1 up to
    /// rounding). A box that is one point gives a single row: the value there.
    ///
    /// # Panics
    /// In debug builds if `a` and `b` are not in order within `[0, 8]`. Release builds clamp them.
    pub fn new(a: f64, b: f64) -> Self {
        debug_assert!(
            0.0 <= a && a <= b && b <= CELLS as f64,
            "[{a}, {b}] is not within [0, {CELLS}]"
        );
        let (mut rows, [a, b], [ka, kb]) = Self::begin(a, b);
        if a == b {
            rows.push(ka, [a, a, a]);
            return rows;
        }
        let knot = |i: usize| i as f64;
        rows.push(ka, [a, a, a]);
        match kb - ka {
            0 => {
                rows.push(ka, [a, a, b]);
                rows.push(ka, [a, b, b]);
            }
            // The third argument of `push` stands at an end of the cell wherever there is such an argument;
            // this keeps the other two where all weights are non-negative.
            1 => {
                rows.push(ka, [a, a, knot(kb)]);
                rows.push(ka, [a, b, knot(kb)]);
                rows.push(kb, [b, b, knot(kb)]);
            }
            _ => {
                rows.push(ka, [a, a, knot(ka + 1)]);
                rows.push(ka, [a, knot(ka + 2), knot(ka + 1)]);
                for k in ka + 2..kb {
                    rows.push(k, [knot(k - 1), knot(k + 1), knot(k)]);
                }
                rows.push(kb, [b, knot(kb - 1), knot(kb)]);
                rows.push(kb, [b, b, knot(kb)]);
            }
        }
        rows.push(kb, [b, b, b]);
        rows
    }

    /// Rows for the derivative on `[a, b]`, by cells: they weigh differences `d_k = c_{k+1} - c_k`, the coefficients of a
    /// quadratic spline, three at a time; the fourth weight is 0. Otherwise as [`Self::new`].
    pub fn of_slopes(a: f64, b: f64) -> Self {
        let (mut rows, [a, b], [ka, kb]) = Self::begin(a, b);
        rows.push_slope(ka, [a, a]);
        if a == b {
            return rows;
        }
        if ka >= kb {
            rows.push_slope(ka, [a, b]);
        } else {
            rows.push_slope(ka, [a, (ka + 1) as f64]);
            for k in ka + 1..kb {
                rows.push_slope(k, [k as f64, (k + 1) as f64]);
            }
            rows.push_slope(kb, [b, kb as f64]);
        }
        rows.push_slope(kb, [b, b]);
        rows
    }

    /// No rows, the ends within the cells, and the cells in which `a` starts and `b` ends.
    fn begin(a: f64, b: f64) -> (Self, [f64; 2], [usize; 2]) {
        let a = a.clamp(0.0, CELLS as f64);
        let b = b.clamp(a, CELLS as f64);
        let rows = Self {
            count: 0,
            start: [0; COEFFICIENTS],
            weights: [[T::zero(); 4]; COEFFICIENTS],
        };
        let cells = [
            (a.floor() as usize).min(CELLS - 1),
            (b.ceil() as usize).max(1) - 1,
        ];
        (rows, [a, b], cells)
    }

    /// Number of rows, `1 ..= 11`.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Row `r`: index of its first coefficient, `0 ..= 7`, and four weights.
    #[inline(always)]
    pub fn row(&self, r: usize) -> (usize, &[T; 4]) {
        (self.start[r] as usize, &self.weights[r])
    }

    /// First coefficient read and the end of those read.
    pub fn reads(&self) -> std::ops::Range<usize> {
        self.start[0] as usize..self.start[self.count - 1] as usize + 4
    }

    /// Appends the blossom of cell `k` at `u`, by de Boor's recurrence with one argument a step.
    fn push(&mut self, k: usize, u: [f64; 3]) {
        let k0 = k as f64;
        // Both shares of each step come from differences of their own, never as `1 - s`: each then has a small
        // *relative* error, and so has every weight, however close to zero.
        let third = |n: f64, x: f64| [(n + 3.0 - x) / 3.0, (x - n) / 3.0];
        let half = |n: f64, x: f64| [(n + 2.0 - x) / 2.0, (x - n) / 2.0];
        let s1 = [third(k0 - 2.0, u[0]), third(k0 - 1.0, u[0]), third(k0, u[0])];
        let s2 = [half(k0 - 1.0, u[1]), half(k0, u[1])];
        let s3 = [k0 + 1.0 - u[2], u[2] - k0];
        let d = [
            s3[0] * s2[0][0],
            (s3[0] * s2[0][1]) + (s3[1] * s2[1][0]),
            s3[1] * s2[1][1],
        ];
        let w = [
            d[0] * s1[0][0],
            d[0] * s1[0][1] + d[1] * s1[1][0],
            d[1] * s1[1][1] + d[2] * s1[2][0],
            d[2] * s1[2][1],
        ];
        self.push_row(k, w);
    }

    /// Appends the blossom of cell `k` of a quadratic spline at `u`.
    fn push_slope(&mut self, k: usize, u: [f64; 2]) {
        let k0 = k as f64;
        let half = |n: f64, x: f64| [(n + 2.0 - x) / 2.0, (x - n) / 2.0];
        let s1 = [half(k0 - 1.0, u[0]), half(k0, u[0])];
        let s2 = [k0 + 1.0 - u[1], u[1] - k0];
        let w = [
            s2[0] * s1[0][0],
            s2[0] * s1[0][1] + s2[1] * s1[1][0],
            s2[1] * s1[1][1],
            0.0,
        ];
        self.push_row(k, w);
    }

    fn push_row(&mut self, k: usize, w: [f64; 4]) {
        debug_assert!(w.iter().all(|w| *w >= 0.0), "negative weight {w:?} in cell {k}");
        self.start[self.count] = k as u8;
        self.weights[self.count] = w.map(T::from_f64);
        self.count += 1;
    }

    /// Bound on the error of one row times coefficients `c`, evaluated in `T` in any order, as a multiple of
    /// `max |c|`.
    ///
    /// A weight is made of three factors (a difference and a quotient each), their products and two sums, so
    /// it is right to 13 units of `f64`; rounding it to `T` and the sum of four products add 5 units of `T`.
    /// Over three axes the errors add up: widen a hull by `3·axis_error()·max |c|`, the largest of the coefficients
    /// that the box reads, not of the hull: near the zero set the coefficients of a small box are small, and the
    /// rounding is not. The rounding of `a` and `b`, and of the spline's own evaluation, is the caller's.
    pub fn axis_error() -> f64 {
        // 2 % on top for the products of errors that are left out above.
        1.02 * (5.0 * T::UNIT_ROUND_OFF + 13.0 * f64::UNIT_ROUND_OFF)
    }
}

/// Smallest and largest control coefficient of a brick's spline on a box, before widening.
///
/// `coefficients` are 11³ with the last axis fastest; `axes` restrict the three axes. Only the coefficients that
/// the box reads are touched: 4³ for a box within one cell. See [`RestrictedAxis::axis_error`] for the widening.
pub fn restricted_range<T: Real>(
    coefficients: &[T; COEFFICIENTS * COEFFICIENTS * COEFFICIENTS],
    axes: &[RestrictedAxis<T>; 3],
) -> (T, T) {
    vectorized(
        #[inline(always)]
        || {
            const SHORT: usize = 8;
            if axes[1..].iter().all(|a| a.reads().len() <= SHORT) {
                range_of_rows::<T, SHORT>(coefficients, axes)
            } else {
                range_of_rows::<T, COEFFICIENTS>(coefficients, axes)
            }
        },
    )
}

/// `LANES` is at least the number of coefficients read along y and z.
#[inline(always)]
fn range_of_rows<T: Real, const LANES: usize>(
    coefficients: &[T; COEFFICIENTS * COEFFICIENTS * COEFFICIENTS],
    axes: &[RestrictedAxis<T>; 3],
) -> (T, T) {
    const N: usize = COEFFICIENTS;
    let [ax, ay, az] = axes;
    let (ry, rz) = (ay.reads(), az.reads());
    // First coefficient along z that stands in a lane.
    let oz = rz.start.min(N - LANES);
    // Lanes are rows of y; those beyond `ay.count` are computed with the rest and left out in the end.
    let (mut low, mut high) = ([T::infinity(); LANES], [T::neg_infinity(); LANES]);
    let mut plane = [[T::zero(); LANES]; N];
    let mut turned = [[T::zero(); LANES]; LANES];
    for i in 0..ax.count {
        let (x0, wx) = ax.row(i);
        for y in ry.clone() {
            let line = |x: usize| -> &[T; LANES] {
                coefficients[((x0 + x) * N + y) * N + oz..][..LANES]
                    .try_into()
                    .expect("a row of lanes")
            };
            let (l0, l1, l2, l3) = (line(0), line(1), line(2), line(3));
            for z in 0..LANES {
                plane[y][z] = (wx[0] * l0[z] + wx[1] * l1[z]) + (wx[2] * l2[z] + wx[3] * l3[z]);
            }
        }
        for j in 0..ay.count {
            let (y0, wy) = ay.row(j);
            let mut line = [T::zero(); LANES];
            for z in 0..LANES {
                line[z] = (wy[0] * plane[y0][z] + wy[1] * plane[y0 + 1][z])
                    + (wy[2] * plane[y0 + 2][z] + wy[3] * plane[y0 + 3][z]);
            }
            for z in rz.start - oz..rz.end - oz {
                turned[z][j] = line[z];
            }
        }
        for k in 0..az.count {
            let (z0, wz) = az.row(k);
            let z0 = z0 - oz;
            for j in 0..LANES {
                let c = (wz[0] * turned[z0][j] + wz[1] * turned[z0 + 1][j])
                    + (wz[2] * turned[z0 + 2][j] + wz[3] * turned[z0 + 3][j]);
                low[j] = if c < low[j] { c } else { low[j] };
                high[j] = if c > high[j] { c } else { high[j] };
            }
        }
    }
    let least = low[..ay.count]
        .iter()
        .fold(low[0], |m, c| if *c < m { *c } else { m });
    let most = high[..ay.count]
        .iter()
        .fold(high[0], |m, c| if *c > m { *c } else { m });
    (least, most)
}
