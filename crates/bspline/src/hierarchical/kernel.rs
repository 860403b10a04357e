//! One cell of one brick, evaluated: no branches, no lookup.

use super::brick::{HALO, HALO_LEN};
use crate::Real;
use crate::cubic::{first, second as curvatures, values};
#[cfg(target_arch = "x86_64")]
use crate::pair::{Avx2, CubicPair, single};
#[cfg(target_arch = "x86_64")]
use crate::vectorized;

#[inline(always)]
fn row<T: Real>(totals: &[T; HALO_LEN], cell: [usize; 3], a: usize, b: usize) -> &[T; 4] {
    let start = ((cell[0] + a) * HALO + cell[1] + b) * HALO + cell[2];
    totals[start..start + 4].try_into().expect("four of a row")
}

#[inline(always)]
fn dot<T: Real>(w: &[T; 4], v: &[T; 4]) -> T {
    (w[0] * v[0] + w[1] * v[1]) + (w[2] * v[2] + w[3] * v[3])
}

#[inline(always)]
fn add<T: Real>(acc: &mut [T; 4], w: T, v: &[T; 4]) {
    for c in 0..4 {
        acc[c] += w * v[c];
    }
}

/// Value at `t` in `cell` (each `0..8`) of a brick: `Σ_c w_c Σ_b w_b Σ_a w_a C_abc`, x summed first.
#[inline]
pub(crate) fn value<T: Real>(totals: &[T; HALO_LEN], cell: [usize; 3], t: [T; 3]) -> T {
    let (wx, wy, wz) = (values(t[0]), values(t[1]), values(t[2]));
    let mut plane = [T::zero(); 4];
    for b in 0..4 {
        let mut line = [T::zero(); 4];
        for a in 0..4 {
            add(&mut line, wx[a], row(totals, cell, a, b));
        }
        add(&mut plane, wy[b], &line);
    }
    dot(&wz, &plane)
}

/// Value and gradient by cell coordinates; the value has the same bits as [`value`].
#[inline]
pub(crate) fn value_gradient<T: Real>(totals: &[T; HALO_LEN], cell: [usize; 3], t: [T; 3]) -> (T, [T; 3]) {
    let (wx, wy, wz) = (values(t[0]), values(t[1]), values(t[2]));
    let (dx, dy, dz) = (first(t[0]), first(t[1]), first(t[2]));
    let (mut plane, mut plane_dx, mut plane_dy) = ([T::zero(); 4], [T::zero(); 4], [T::zero(); 4]);
    for b in 0..4 {
        let (mut line, mut line_dx) = ([T::zero(); 4], [T::zero(); 4]);
        for a in 0..4 {
            let r = row(totals, cell, a, b);
            add(&mut line, wx[a], r);
            add(&mut line_dx, dx[a], r);
        }
        add(&mut plane, wy[b], &line);
        add(&mut plane_dx, wy[b], &line_dx);
        add(&mut plane_dy, dy[b], &line);
    }
    (
        dot(&wz, &plane),
        [dot(&wz, &plane_dx), dot(&wz, &plane_dy), dot(&dz, &plane)],
    )
}

/// A cell of a brick, and a point in it.
pub(crate) type CellPoint<'a, T> = (&'a [T; HALO_LEN], [usize; 3], [T; 3]);

/// [`value_gradient`] of two points, to the bit.
#[inline]
pub(crate) fn values_gradients_of_two<T: Real>(points: [CellPoint<'_, T>; 2]) -> [(T, [T; 3]); 2] {
    #[cfg(target_arch = "x86_64")]
    if let Some(both) = in_lanes(points) {
        return both;
    }
    points.map(|(totals, cell, t)| value_gradient(totals, cell, t))
}

/// The same in single precision, where the processor takes both at once.
#[cfg(target_arch = "x86_64")]
#[inline]
fn in_lanes<T: Real>([a, b]: [CellPoint<'_, T>; 2]) -> Option<[(T, [T; 3]); 2]> {
    fn singles<T: Real>(totals: &[T; HALO_LEN]) -> Option<&[f32; HALO_LEN]> {
        (totals as &dyn std::any::Any).downcast_ref()
    }
    let (low, high, avx2) = (singles(a.0)?, singles(b.0)?, Avx2::new()?);
    let start = |[x, y, z]: [usize; 3]| (x * HALO + y) * HALO + z;
    let wide = |x: f32| T::from_f64(f64::from(x));
    let (t, rows) = (
        [single(a.2), single(b.2)],
        [&low[start(a.1)..], &high[start(b.1)..]],
    );
    let both = vectorized(
        #[inline(always)]
        || CubicPair::new(avx2, t).gather(rows, [HALO * HALO, HALO]),
    );
    Some(both.map(|(v, g)| (wide(v), g.map(wide))))
}

/// Value, gradient and second derivatives (`xx, yy, zz, xy, xz, yz`) by cell coordinates; value and gradient have the
/// same bits as those of [`value_gradient`].
#[inline]
pub(crate) fn jet<T: Real>(totals: &[T; HALO_LEN], cell: [usize; 3], t: [T; 3]) -> (T, [T; 3], [T; 6]) {
    let [wx, wy, wz] = t.map(values);
    let [dx, dy, dz] = t.map(first);
    let [kx, ky, kz] = t.map(curvatures);
    let zero = [T::zero(); 4];
    let (mut f, mut fx, mut fy) = (zero, zero, zero);
    let (mut fxx, mut fyy, mut fxy) = (zero, zero, zero);
    for b in 0..4 {
        let (mut line, mut line_dx, mut line_dxx) = (zero, zero, zero);
        for a in 0..4 {
            let r = row(totals, cell, a, b);
            add(&mut line, wx[a], r);
            add(&mut line_dx, dx[a], r);
            add(&mut line_dxx, kx[a], r);
        }
        add(&mut f, wy[b], &line);
        add(&mut fx, wy[b], &line_dx);
        add(&mut fy, dy[b], &line);
        add(&mut fxx, wy[b], &line_dxx);
        add(&mut fyy, ky[b], &line);
        add(&mut fxy, dy[b], &line_dx);
    }
    (
        dot(&wz, &f),
        [dot(&wz, &fx), dot(&wz, &fy), dot(&dz, &f)],
        [
            dot(&wz, &fxx),
            dot(&wz, &fyy),
            dot(&kz, &f),
            dot(&wz, &fxy),
            dot(&dz, &fx),
            dot(&dz, &fy),
        ],
    )
}
