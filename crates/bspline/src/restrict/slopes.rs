//! Ranges of the derivatives of a brick's spline on a small box.

use super::{COEFFICIENTS, RestrictedAxis};
use crate::Real;
use crate::vectorized::vectorized;

/// Most coefficients that a box of up to four cells reads on an axis, and most rows of its restriction.
const NEAR: usize = 8;

impl<T: Real> RestrictedAxis<T> {
    /// The weights of the rows by the coefficient that they weigh, from the first one read; a lane for each row, those
    /// beyond the last as that.
    #[inline(always)]
    fn by_coefficient(&self) -> [[T; NEAR]; NEAR] {
        let mut found = [[T::zero(); NEAR]; NEAR];
        for lane in 0..NEAR {
            let (start, weights) = self.row(lane.min(self.count - 1));
            for (d, weight) in weights.iter().enumerate() {
                if let Some(lanes) = found.get_mut(start - self.start[0] as usize + d) {
                    lanes[lane] = *weight;
                }
            }
        }
        found
    }
}

/// Ranges of the derivatives by cells along each axis, of a brick's spline on a box of up to four cells, before widening.
#[derive(Clone, Copy, Debug)]
pub struct SlopeRanges<T> {
    /// Smallest and largest control coefficient of each derivative.
    pub ranges: [(T, T); 3],
    /// Largest coefficient in magnitude next to the box, no smaller than any that it reads.
    pub largest: T,
}

/// The ranges of the derivatives on a box, `[a, b]` in cells on each axis, `b - a <= 4`.
///
/// Differences first, convex combinations of them after: no box is too tiny for that. Along the other axes the
/// coefficients are restricted before, which all derivatives share. Widen each range by `7·axis_error()·largest`: three
/// axes of coefficients or differences of up to `2·largest`, and the rounding of the differences.
///
/// # Panics
/// If the box is larger.
pub fn slope_ranges<T: Real>(
    coefficients: &[T; COEFFICIENTS * COEFFICIENTS * COEFFICIENTS],
    within: &[[f64; 2]; 3],
) -> SlopeRanges<T> {
    let values = within.map(|[a, b]| RestrictedAxis::new(a, b));
    let slopes = within.map(|[a, b]| RestrictedAxis::of_slopes(a, b));
    /// Read by a box of up to a cell.
    const CELL: usize = 5;
    let is_cell = values.iter().all(|axis| axis.reads().len() <= CELL);
    vectorized(
        #[inline(always)]
        || match is_cell {
            true => slopes_of_rows::<T, CELL>(coefficients, &values, &slopes),
            false => slopes_of_rows::<T, NEAR>(coefficients, &values, &slopes),
        },
    )
}

/// `N` is at least the number of coefficients read along each axis, and so that of rows.
#[inline(always)]
fn slopes_of_rows<T: Real, const N: usize>(
    coefficients: &[T; COEFFICIENTS * COEFFICIENTS * COEFFICIENTS],
    values: &[RestrictedAxis<T>; 3],
    slopes: &[RestrictedAxis<T>; 3],
) -> SlopeRanges<T> {
    // A lane for each row of the restriction along z.
    type Lanes<T> = [T; NEAR];
    let zero: Lanes<T> = [T::zero(); NEAR];
    let [rx, ry, rz] = values.each_ref().map(RestrictedAxis::reads);
    let (wz, sz) = (values[2].by_coefficient(), slopes[2].by_coefficient());
    let mut most = zero;
    let [mut plain, mut by_y, mut by_z] = [[[zero; N]; N]; 3];
    let (mut line, mut line_z) = ([zero; N], [zero; N]);
    for x in 0..rx.len() {
        for y in 0..ry.len() {
            let row = ((rx.start + x) * COEFFICIENTS + ry.start + y) * COEFFICIENTS;
            let row: &[T; COEFFICIENTS] = coefficients[row..][..COEFFICIENTS].try_into().expect("a row");
            for (most, c) in most.iter_mut().zip(&row[rz.start.min(COEFFICIENTS - NEAR)..]) {
                *most = if c.abs() > *most { c.abs() } else { *most };
            }
            let own = &row[rz.clone()];
            let mut sum = blend::<T>(own[0], &wz[0], None);
            let mut sum_z = zero;
            for m in 1..own.len() {
                sum = blend(own[m], &wz[m], Some(sum));
                sum_z = blend(own[m] - own[m - 1], &sz[m - 1], Some(sum_z));
            }
            (line[y], line_z[y]) = (sum, sum_z);
        }
        for j in 0..values[1].count {
            let (y0, w) = values[1].row(j);
            let y0 = y0 - ry.start;
            plain[x][j] = weighted(w, |d| line[y0 + d]);
            by_z[x][j] = weighted(w, |d| line_z[y0 + d]);
        }
        for j in 0..slopes[1].count {
            let (y0, w) = slopes[1].row(j);
            let y0 = y0 - ry.start;
            by_y[x][j] = weighted_rises(w, |d| line[y0 + d]);
        }
    }
    let mut ranges = [([T::infinity(); NEAR], [T::neg_infinity(); NEAR]); 3];
    let mut see = |axis: usize, found: Lanes<T>| {
        let (low, high) = &mut ranges[axis];
        for k in 0..NEAR {
            low[k] = if found[k] < low[k] { found[k] } else { low[k] };
            high[k] = if found[k] > high[k] { found[k] } else { high[k] };
        }
    };
    for i in 0..values[0].count {
        let (x0, w) = values[0].row(i);
        let x0 = x0 - rx.start;
        for j in 0..values[1].count {
            see(2, weighted(w, |d| by_z[x0 + d][j]));
        }
        for j in 0..slopes[1].count {
            see(1, weighted(w, |d| by_y[x0 + d][j]));
        }
    }
    for i in 0..slopes[0].count {
        let (x0, w) = slopes[0].row(i);
        let x0 = x0 - rx.start;
        for j in 0..values[1].count {
            see(0, weighted_rises(w, |d| plain[x0 + d][j]));
        }
    }
    let least = |lanes: Lanes<T>| {
        lanes
            .into_iter()
            .fold(T::infinity(), |m, c| if c < m { c } else { m })
    };
    let greatest = |lanes: Lanes<T>| {
        lanes
            .into_iter()
            .fold(T::neg_infinity(), |m, c| if c > m { c } else { m })
    };
    SlopeRanges {
        ranges: ranges.map(|(low, high)| (least(low), greatest(high))),
        largest: greatest(most),
    }
}

/// `sum + c·w` in each lane.
#[inline(always)]
fn blend<T: Real>(c: T, w: &[T; NEAR], sum: Option<[T; NEAR]>) -> [T; NEAR] {
    match sum {
        Some(sum) => std::array::from_fn(|k| sum[k] + c * w[k]),
        None => w.map(|w| c * w),
    }
}

#[inline(always)]
fn weighted<T: Real>(w: &[T; 4], at: impl Fn(usize) -> [T; NEAR]) -> [T; NEAR] {
    let [a, b, c, d] = [at(0), at(1), at(2), at(3)];
    std::array::from_fn(|k| (w[0] * a[k] + w[1] * b[k]) + (w[2] * c[k] + w[3] * d[k]))
}

/// Of the differences of what stands at `0 ..= 3`.
#[inline(always)]
fn weighted_rises<T: Real>(w: &[T; 4], at: impl Fn(usize) -> [T; NEAR]) -> [T; NEAR] {
    let [a, b, c, d] = [at(0), at(1), at(2), at(3)];
    std::array::from_fn(|k| w[0] * (b[k] - a[k]) + (w[1] * (c[k] - b[k]) + w[2] * (d[k] - c[k])))
}
