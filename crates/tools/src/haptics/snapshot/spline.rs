//! Cubic splines through numbers on a grid, and their value and gradient.

use bspline::{cubic, vectorized};
use glam::DVec3;

use super::grid::Grid;
use super::region::Region;

/// How numbers between nodes are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// By the cubic spline through the nodes: twice continuously differentiable, the gradient is that of the value.
    #[default]
    Cubic,
    /// Linearly along each axis: the gradient jumps from cell to cell.
    Linear,
}

/// Weights of a number and of those one and two nodes away in a coefficient.
///
/// The spline through numbers `s` has `c = (1 + δ²/6)⁻¹ s` on each axis \[Unser99\]; this is `(1 − δ²/6 + δ⁴/36) s`, its series up to the
/// second term. What is left out, `δ⁶s/216`, is of sixth order, as little against the error between nodes, of the fourth, as it is worth: and a
/// coefficient follows from five numbers a line, so that what is far away changes none.
const WEIGHTS: [f32; 3] = [1.5, -5.0 / 18.0, 1.0 / 36.0];
/// Nodes to each side that a coefficient follows from.
const SIDE: usize = 2;

/// Renews the coefficients of the cubic spline through numbers at the nodes of a grid, where numbers of a region have changed; beyond the grid it
/// is mirrored.
pub fn coefficients(grid: &Grid, numbers: &[f32], changed: Region, out: &mut [f32]) {
    let to = changed.grown(SIDE, grid);
    if to.is_empty() {
        return;
    }
    let from = to.grown(SIDE, grid);
    let ([fx, fy, fz], [tx, ty, tz]) = (from.count(), to.count());
    // Along z, y, x; each axis goes from `from` to `to`.
    let mut planes = vec![0.0f32; fx * fy * tz];
    for ((_, slots), row) in from.rows(grid).zip(planes.chunks_exact_mut(tz)) {
        let line = &numbers[slots.start - from.lo[2]..][..grid.count[2]];
        for (z, c) in row.iter_mut().enumerate() {
            *c = weighted(to.lo[2] + z, grid.count[2], |n| line[n]);
        }
    }
    debug_assert!(fz >= tz);
    let mut lines = vec![0.0f32; fx * ty * tz];
    for x in 0..fx {
        let plane = &planes[x * fy * tz..][..fy * tz];
        for y in 0..ty {
            let at = to.lo[1] + y;
            let rows = |n: usize| &plane[(n - from.lo[1]) * tz..][..tz];
            weigh(at, grid.count[1], rows, &mut lines[(x * ty + y) * tz..][..tz]);
        }
    }
    let mut row = vec![0.0f32; ty * tz];
    for x in 0..tx {
        let at = to.lo[0] + x;
        let rows = |n: usize| &lines[(n - from.lo[0]) * ty * tz..][..ty * tz];
        weigh(at, grid.count[0], rows, &mut row);
        for (y, row) in row.chunks_exact(tz).enumerate() {
            let start = grid.slot([at, to.lo[1] + y, to.lo[2]]);
            out[start..start + tz].copy_from_slice(row);
        }
    }
}

/// Place of a node on an axis of so many, mirrored about the first and the last.
fn mirrored(n: isize, count: usize) -> usize {
    let n = n.unsigned_abs();
    if n < count { n } else { 2 * (count - 1) - n }
}

fn around(n: usize, count: usize) -> [usize; 5] {
    std::array::from_fn(|k| mirrored(n as isize + k as isize - SIDE as isize, count))
}

fn weighted(n: usize, count: usize, value: impl Fn(usize) -> f32) -> f32 {
    let [a, b, c, d, e] = around(n, count).map(value);
    WEIGHTS[0] * c + WEIGHTS[1] * (b + d) + WEIGHTS[2] * (a + e)
}

fn weigh<'a>(n: usize, count: usize, row: impl Fn(usize) -> &'a [f32], out: &mut [f32]) {
    let [a, b, c, d, e] = around(n, count).map(row);
    vectorized(
        #[inline(always)]
        || {
            for (i, o) in out.iter_mut().enumerate() {
                *o = WEIGHTS[0] * c[i] + WEIGHTS[1] * (b[i] + d[i]) + WEIGHTS[2] * (a[i] + e[i]);
            }
        },
    );
}

/// Value and gradient per node at `t` in the cell behind node `cell` of the spline with these coefficients. The cell has a node before it and
/// two behind it on each axis.
#[inline]
pub fn cubic(numbers: &[f32], strides: [usize; 3], cell: [usize; 3], t: [f32; 3]) -> (f64, DVec3) {
    let [wx, wy, wz] = t.map(cubic::values::<f32>);
    let [dx, dy, dz] = t.map(cubic::first::<f32>);
    let start = (cell[0] - 1) * strides[0] + (cell[1] - 1) * strides[1] + cell[2] - 1;
    // Checked once: the last row that is read ends here.
    let part = &numbers[start..start + 3 * strides[0] + 3 * strides[1] + 4];
    let (mut plane, mut plane_dx, mut plane_dy) = ([0.0f32; 4], [0.0f32; 4], [0.0f32; 4]);
    for b in 0..4 {
        let (mut line, mut line_dx) = ([0.0f32; 4], [0.0f32; 4]);
        for a in 0..4 {
            let at = a * strides[0] + b * strides[1];
            let row: &[f32; 4] = part[at..at + 4].try_into().expect("four of a row");
            add(&mut line, wx[a], row);
            add(&mut line_dx, dx[a], row);
        }
        add(&mut plane, wy[b], &line);
        add(&mut plane_dx, wy[b], &line_dx);
        add(&mut plane_dy, dy[b], &line);
    }
    let gradient = DVec3::new(
        dot(&wz, &plane_dx).into(),
        dot(&wz, &plane_dy).into(),
        dot(&dz, &plane).into(),
    );
    (dot(&wz, &plane).into(), gradient)
}

/// The same, linear along each axis, of numbers at the nodes themselves.
#[inline]
pub fn linear(numbers: &[f32], strides: [usize; 3], cell: [usize; 3], t: [f32; 3]) -> (f64, DVec3) {
    let start = cell[0] * strides[0] + cell[1] * strides[1] + cell[2];
    let part = &numbers[start..start + strides[0] + strides[1] + 2];
    let row = |a: usize, b: usize| {
        let at = a * strides[0] + b * strides[1];
        let (v, w) = (part[at], part[at + 1]);
        (v + t[2] * (w - v), w - v)
    };
    let rows = [[row(0, 0), row(0, 1)], [row(1, 0), row(1, 1)]];
    let mix = |t: f32, a: f32, b: f32| a + t * (b - a);
    let planes = rows.map(|[a, b]| (mix(t[1], a.0, b.0), b.0 - a.0, mix(t[1], a.1, b.1)));
    let [a, b] = planes;
    let gradient = DVec3::new(
        (b.0 - a.0).into(),
        mix(t[0], a.1, b.1).into(),
        mix(t[0], a.2, b.2).into(),
    );
    (mix(t[0], a.0, b.0).into(), gradient)
}

#[inline(always)]
fn add(to: &mut [f32; 4], w: f32, row: &[f32; 4]) {
    for c in 0..4 {
        to[c] += w * row[c];
    }
}

#[inline(always)]
fn dot(w: &[f32; 4], v: &[f32; 4]) -> f32 {
    (w[0] * v[0] + w[1] * v[1]) + (w[2] * v[2] + w[3] * v[3])
}
