//! A matrix on each axis, applied to the coefficients plane by plane: values at the nodes of a grid, and coefficients on
//! a smaller box.

use glam::DVec3;

use super::spline::TensorSpline;
use crate::field::values_node_by_node;
use crate::{BandedRows, Frame, Real};

/// [`crate::Field::frame_values`]. Frames that are turned against the axes fall back to single points.
pub(super) fn frame_values<T: Real>(
    spline: &TensorSpline<T>,
    frame: &Frame,
    lo: [i64; 3],
    count: [usize; 3],
    out: &mut [f64],
) {
    assert_eq!(
        out.len(),
        count.iter().product::<usize>(),
        "one output slot per node"
    );
    if out.is_empty() {
        return;
    }
    let Some((start, step)) = spline.place.alignment(frame) else {
        return values_node_by_node(spline, frame, lo, count, out);
    };
    let nodes: [Vec<f64>; 3] = std::array::from_fn(|a| {
        let node = |i| start[a] + step[a] * (lo[a] + i) as f64;
        (0..count[a] as i64).map(node).collect()
    });
    let (min, max) = (spline.place.min, spline.place.max);
    let rows: [BandedRows<T>; 3] = std::array::from_fn(|a| {
        let clamped = nodes[a].iter().map(|q| q.clamp(min[a], max[a]));
        BandedRows::collocation(&spline.knots[a], clamped, 0)
    });
    let mut slot = out.iter_mut();
    tensor_product(&spline.coefficients, spline.shape(), &rows, |c| {
        *slot.next().expect("one slot per node") = c.as_f64();
    });
    let leaves_box = (0..3).any(|a| nodes[a].iter().any(|q| *q < min[a] || *q > max[a]));
    if leaves_box {
        let off = |a: usize, i: usize| nodes[a][i] - nodes[a][i].clamp(min[a], max[a]);
        let map = spline.place.world_from_local.matrix3;
        let mut slot = out.iter_mut();
        for i in 0..count[0] {
            for j in 0..count[1] {
                for k in 0..count[2] {
                    let beyond = map * DVec3::new(off(0, i), off(1, j), off(2, k));
                    *slot.next().expect("one slot per node") -= spline.place.slope * beyond.length();
                }
            }
        }
    }
}

/// Calls `each` with the elements of `(X ⊗ Y ⊗ Z) C` in order, last axis fastest. Each is summed over x first and then
/// over y, so that its bits depend on its own three rows alone.
pub(super) fn tensor_product<T: Real>(
    coefficients: &[T],
    shape: [usize; 3],
    [xs, ys, zs]: &[BandedRows<T>; 3],
    mut each: impl FnMut(T),
) {
    let [_, ny, nz] = shape;
    let (y_reads, z_reads) = (ys.reads(), zs.reads());
    let depth = z_reads.len();
    let mut plane = vec![T::zero(); y_reads.len() * depth];
    let mut line = vec![T::zero(); depth];
    for i in 0..xs.row_count() {
        let (x0, wx) = xs.row(i);
        for (y, target) in y_reads.clone().zip(plane.chunks_exact_mut(depth)) {
            let from = |a: usize| &coefficients[((x0 + a) * ny + y) * nz..][z_reads.clone()];
            combine(wx, from, target);
        }
        for j in 0..ys.row_count() {
            let (y0, wy) = ys.row(j);
            let from = |b: usize| &plane[(y0 + b - y_reads.start) * depth..][..depth];
            combine(wy, from, &mut line);
            for k in 0..zs.row_count() {
                let (z0, wz) = zs.row(k);
                each(dot(wz, &line[z0 - z_reads.start..][..wz.len()]));
            }
        }
    }
}

/// `Σ w c`; of cubic splines without a loop.
#[inline(always)]
fn dot<T: Real>(weights: &[T], values: &[T]) -> T {
    if let ([a, b, c, d], [p, q, r, s]) = (weights, values) {
        return T::zero() + *a * *p + *b * *q + *c * *r + *d * *s;
    }
    weights
        .iter()
        .zip(values)
        .fold(T::zero(), |sum, (w, c)| sum + *w * *c)
}

/// `target = Σ_a w_a from(a)`; of cubic splines in one pass.
#[inline(always)]
fn combine<'a, T: Real>(weights: &[T], from: impl Fn(usize) -> &'a [T], target: &mut [T]) {
    if let [a, b, c, d] = *weights {
        let n = target.len();
        let (p, q, r, s) = (&from(0)[..n], &from(1)[..n], &from(2)[..n], &from(3)[..n]);
        for i in 0..n {
            target[i] = T::zero() + a * p[i] + b * q[i] + c * r[i] + d * s[i];
        }
        return;
    }
    target.fill(T::zero());
    for (a, w) in weights.iter().enumerate() {
        for (t, c) in target.iter_mut().zip(from(a)) {
            *t += *w * *c;
        }
    }
}
