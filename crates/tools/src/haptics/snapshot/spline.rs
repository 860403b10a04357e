//! Cubic splines through numbers on a grid, and their value and gradient.

use bspline::{cubic, vectorized};
use glam::DVec3;

use super::grid::Grid;

/// How numbers between nodes are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// By the cubic spline through the nodes: twice continuously differentiable, the gradient is that of the value.
    #[default]
    Cubic,
    /// Linearly along each axis: the gradient jumps from cell to cell.
    Linear,
}

/// Pole of the filter that makes coefficients of numbers \[Unser99\].
const POLE: f32 = -0.267_949_2;
/// Nodes after which what lies beyond has no more weight than rounding.
const HORIZON: usize = 14;

/// Coefficients of the cubic spline through numbers at the nodes of a grid, in place; beyond the grid it is mirrored.
pub fn coefficients(grid: &Grid, numbers: &mut [f32]) {
    let strides = grid.strides();
    let mut line = vec![0.0f32; grid.count[2]];
    for row in numbers.chunks_exact_mut(grid.count[2]) {
        line.copy_from_slice(row);
        filter_rows(&mut line, grid.count[2], 1);
        row.copy_from_slice(&line);
    }
    for plane in numbers.chunks_exact_mut(strides[0]) {
        filter_rows(plane, grid.count[1], strides[1]);
    }
    filter_rows(numbers, grid.count[0], strides[0]);
}

/// Filters along `count` rows of `width` numbers.
fn filter_rows(rows: &mut [f32], count: usize, width: usize) {
    // 1/6, 4/6, 1/6 is undone by c⁺ₖ = 6s + z c⁺ₖ₋₁ forward and cₖ = z(cₖ₊₁ − c⁺ₖ) backward.
    let mut first = vec![0.0f32; width];
    let mut power = 1.0f32;
    for k in 0..HORIZON {
        // Mirrored about the first node and, for short lines, about the last.
        let period = 2 * (count - 1).max(1);
        let k = k % period;
        let k = k.min(period - k);
        let row = &rows[k * width..][..width];
        for (sum, value) in first.iter_mut().zip(row) {
            *sum += power * value;
        }
        power *= POLE;
    }
    let axpy = |to: &mut [f32], from: &[f32]| {
        vectorized(
            #[inline(always)]
            || {
                for (t, f) in to.iter_mut().zip(from) {
                    *t += POLE * f;
                }
            },
        );
    };
    rows[..width].copy_from_slice(&first);
    for k in 1..count {
        let (before, at) = rows.split_at_mut(k * width);
        axpy(&mut at[..width], &before[(k - 1) * width..]);
    }
    let gain = -POLE / (1.0 - POLE * POLE);
    let last = count - 1;
    if last > 0 {
        let (before, at) = rows.split_at_mut(last * width);
        let before = &before[(last - 1) * width..];
        for (c, b) in at[..width].iter_mut().zip(before) {
            *c = gain * (*c + POLE * b);
        }
    } else {
        rows.iter_mut().for_each(|c| *c *= gain);
    }
    for k in (0..last).rev() {
        let (at, after) = rows.split_at_mut((k + 1) * width);
        let (at, after) = (&mut at[k * width..], &after[..width]);
        vectorized(
            #[inline(always)]
            || {
                for (c, a) in at.iter_mut().zip(after) {
                    *c = POLE * (a - *c);
                }
            },
        );
    }
    rows.iter_mut().for_each(|c| *c *= 6.0);
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
