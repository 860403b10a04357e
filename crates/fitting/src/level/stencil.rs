//! One sample against the 64 coefficients round it, in any array with strides.

use bspline::{Real, cubic};

/// Where the 4³ coefficients of a sample start in an array, and its place in the cell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spot<T> {
    pub start: usize,
    pub t: [T; 3],
}

#[inline(always)]
fn axpy<T: Real>(acc: &mut [T; 4], w: T, v: &[T; 4]) {
    for c in 0..4 {
        acc[c] += w * v[c];
    }
}

#[inline(always)]
fn dot<T: Real>(a: &[T; 4], b: &[T; 4]) -> T {
    (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3])
}

/// `Σ B c` and `Σ ∂B c` (by cell coordinates). `strides` are those of x and y; z is contiguous.
#[inline(always)]
pub(crate) fn gather<T: Real>(values: &[T], spot: Spot<T>, strides: [usize; 2]) -> (T, [T; 3]) {
    let [wx, wy, wz] = spot.t.map(cubic::values);
    let [dx, dy, dz] = spot.t.map(cubic::first);
    let zero = [T::zero(); 4];
    let (mut plane, mut plane_dx, mut plane_dy) = (zero, zero, zero);
    let values = &values[spot.start..spot.start + 3 * (strides[0] + strides[1]) + 4];
    for b in 0..4 {
        let (mut line, mut line_dx) = (zero, zero);
        for a in 0..4 {
            let start = a * strides[0] + b * strides[1];
            let row: &[T; 4] = values[start..start + 4].try_into().expect("four of a row");
            axpy(&mut line, wx[a], row);
            axpy(&mut line_dx, dx[a], row);
        }
        axpy(&mut plane, wy[b], &line);
        axpy(&mut plane_dx, wy[b], &line_dx);
        axpy(&mut plane_dy, dy[b], &line);
    }
    (
        dot(&wz, &plane),
        [dot(&wz, &plane_dx), dot(&wz, &plane_dy), dot(&dz, &plane)],
    )
}

/// `Σ B c` alone, with the bits of [`gather`].
#[inline(always)]
pub(crate) fn gather_value<T: Real>(values: &[T], spot: Spot<T>, strides: [usize; 2]) -> T {
    let [wx, wy, wz] = spot.t.map(cubic::values);
    let mut plane = [T::zero(); 4];
    let values = &values[spot.start..spot.start + 3 * (strides[0] + strides[1]) + 4];
    for b in 0..4 {
        let mut line = [T::zero(); 4];
        for a in 0..4 {
            let start = a * strides[0] + b * strides[1];
            let row: &[T; 4] = values[start..start + 4].try_into().expect("four of a row");
            axpy(&mut line, wx[a], row);
        }
        axpy(&mut plane, wy[b], &line);
    }
    dot(&wz, &plane)
}

/// Transpose of [`gather`]: adds `v·B + Σ g·∂B` to the 64 coefficients.
#[inline(always)]
pub(crate) fn scatter<T: Real>(values: &mut [T], spot: Spot<T>, strides: [usize; 2], v: T, g: [T; 3]) {
    let w = spot.t.map(cubic::values);
    let d = spot.t.map(cubic::first);
    scatter_weights(values, spot.start, strides, &w, &d, v, g);
}

/// Adds the diagonal of `v·BᵀB + Σ g·∂Bᵀ∂B`, that is the same sum over squared weights.
#[inline(always)]
pub(crate) fn scatter_squares<T: Real>(
    values: &mut [T],
    spot: Spot<T>,
    strides: [usize; 2],
    v: T,
    g: [T; 3],
) {
    let w = spot.t.map(|t| cubic::values(t).map(|w| w * w));
    let d = spot.t.map(|t| cubic::first(t).map(|d| d * d));
    scatter_weights(values, spot.start, strides, &w, &d, v, g);
}

#[inline(always)]
fn scatter_weights<T: Real>(
    values: &mut [T],
    start: usize,
    strides: [usize; 2],
    [wx, wy, wz]: &[[T; 4]; 3],
    [dx, dy, dz]: &[[T; 4]; 3],
    v: T,
    g: [T; 3],
) {
    let mut along: [T; 4] = [T::zero(); 4];
    for c in 0..4 {
        along[c] = v * wz[c] + g[2] * dz[c];
    }
    let values = &mut values[start..start + 3 * (strides[0] + strides[1]) + 4];
    for b in 0..4 {
        let (mut even, mut odd) = ([T::zero(); 4], [T::zero(); 4]);
        for c in 0..4 {
            even[c] = wy[b] * along[c] + dy[b] * g[1] * wz[c];
            odd[c] = wy[b] * g[0] * wz[c];
        }
        for a in 0..4 {
            let start = a * strides[0] + b * strides[1];
            let row: &mut [T; 4] = (&mut values[start..start + 4]).try_into().expect("four of a row");
            for c in 0..4 {
                row[c] += wx[a] * even[c] + dx[a] * odd[c];
            }
        }
    }
}
