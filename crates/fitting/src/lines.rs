//! Solves along the lines of a three-dimensional array, many lines at once.
//!
//! A solve sees *rows*: row `i` holds element `i` of every line at hand, so its loops run over contiguous lanes.
//! Along y and z the rows are stretches of the array itself; along x small blocks of lines are transposed.
//! No result depends on how lines are grouped.

use bspline::Real;
use bspline::vectorized;
use rayon::prelude::*;

/// Lines transposed together when the line runs along x.
const LANES: usize = 16;
/// Lines taken together along z: 181 rows of 128 floats are 93 kB, inside a second-level cache.
const TILE: usize = 128;

/// A linear solve along lines, in place.
pub trait LineSolve<T>: Sync {
    /// Overwrites the right-hand sides in `rows` by the solutions; all rows have the same length.
    fn solve<R: AsRef<[T]> + AsMut<[T]>>(&self, rows: &mut [R]);
}

/// Distinct rows as slices.
///
/// # Panics
/// If two indices are equal or one is out of range.
#[inline(always)]
pub(crate) fn rows_mut<T, R: AsMut<[T]>, const N: usize>(rows: &mut [R], at: [usize; N]) -> [&mut [T]; N] {
    rows.get_disjoint_mut(at)
        .expect("distinct rows within the line")
        .map(|r| r.as_mut())
}

/// Solves along x, y and z of an array of `size` (x fastest).
///
/// `order` is free: the three solves commute; x and y are done plane by plane, then z.
///
/// # Panics
/// If `data` is not `size[0]·size[1]·size[2]` long.
pub(crate) fn solve_all_axes<T: Real>(axes: [&impl LineSolve<T>; 3], data: &mut [T], size: [usize; 3]) {
    assert_eq!(data.len(), size.iter().product::<usize>(), "array of {size:?}");
    data.par_chunks_mut(size[0] * size[1]).for_each(|plane| {
        vectorized(
            #[inline(always)]
            || {
                solve_along_x(axes[0], plane, size[0]);
                solve_along_y(axes[1], plane, size[0]);
            },
        );
    });
    solve_along_z(axes[2], data, size[0] * size[1]);
}

/// Solves along each contiguous row of `plane`, rows of `nx`.
#[inline(always)]
pub(crate) fn solve_along_x<T: Real>(op: &impl LineSolve<T>, plane: &mut [T], nx: usize) {
    let mut block = vec![[T::zero(); LANES]; nx];
    for lines in plane.chunks_mut(LANES * nx) {
        transpose_in(lines, nx, &mut block);
        op.solve(&mut block);
        transpose_out(&block, nx, lines);
    }
}

/// `block[i][lane] = lines[lane][i]`; missing lanes are zero.
#[inline(always)]
pub(crate) fn transpose_in<T: Real>(lines: &[T], nx: usize, block: &mut [[T; LANES]]) {
    if lines.len() == LANES * nx {
        let rows: [&[T]; LANES] = std::array::from_fn(|l| &lines[l * nx..(l + 1) * nx]);
        for (i, b) in block[..nx].iter_mut().enumerate() {
            for l in 0..LANES {
                b[l] = rows[l][i];
            }
        }
    } else {
        block.fill([T::zero(); LANES]);
        for (l, line) in lines.chunks_exact(nx).enumerate() {
            for (b, &v) in block.iter_mut().zip(line) {
                b[l] = v;
            }
        }
    }
}

/// The inverse of [`transpose_in`].
#[inline(always)]
pub(crate) fn transpose_out<T: Real>(block: &[[T; LANES]], nx: usize, lines: &mut [T]) {
    for (l, line) in lines.chunks_exact_mut(nx).enumerate() {
        for (v, b) in line.iter_mut().zip(block) {
            *v = b[l];
        }
    }
}

/// Solves along y within one plane of rows of `nx`.
#[inline(always)]
pub(crate) fn solve_along_y<T: Real>(op: &impl LineSolve<T>, plane: &mut [T], nx: usize) {
    let mut rows: Vec<&mut [T]> = plane.chunks_mut(nx).collect();
    op.solve(&mut rows);
}

/// Solves along z of an array of planes of `plane_len`, in parallel over tiles of lines.
pub(crate) fn solve_along_z<T: Real>(op: &impl LineSolve<T>, data: &mut [T], plane_len: usize) {
    let mut tiles: Vec<Vec<&mut [T]>> = (0..plane_len.div_ceil(TILE)).map(|_| Vec::new()).collect();
    for plane in data.chunks_mut(plane_len) {
        for (tile, piece) in tiles.iter_mut().zip(plane.chunks_mut(TILE)) {
            tile.push(piece);
        }
    }
    tiles.par_iter_mut().for_each(|rows| {
        vectorized(
            #[inline(always)]
            || op.solve(rows),
        )
    });
}
