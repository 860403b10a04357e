//! Cholesky factorization inside the band of a matrix.

use std::hint::black_box;

use bspline::Real;
use bspline::vectorized;

/// Columns that are eliminated together.
const TILE: usize = 4;
const LANES: usize = 16;
const HALF: usize = LANES / 2;
/// Rows that are eliminated together, a multiple of [`LANES`]: of a band of 1000 they stay in the second cache.
pub(super) const SLICE: usize = 32;

/// The factor `H = L Lᵀ` of a symmetric matrix of half-bandwidth `b`, stored by rows: row `i` holds columns
/// `i-b ..= i`, the diagonal as its inverse.
#[derive(Clone, Debug)]
pub struct BandCholesky<T> {
    n: usize,
    layout: Layout,
    rows: Vec<T>,
    /// The rows in work, by columns, so that rows are the lanes.
    panel: Vec<T>,
}

/// Where the elements lie.
#[derive(Clone, Copy, Debug)]
struct Layout {
    band: usize,
    stride: usize,
}

impl Layout {
    #[inline(always)]
    fn at(self, row: usize, column: usize) -> usize {
        row * self.stride + column + self.band - row
    }
}

/// A pivot that is not positive: the matrix is not positive definite in the working precision.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "the matrix of the step is not positive definite in this precision (pivot {pivot:.3e} in row {row}); take less contrast \
     of stiffness and mass, or double precision"
)]
pub struct NotPositive {
    /// Row of the pivot.
    pub row: usize,
    /// Its value.
    pub pivot: f64,
}

impl<T: Real> BandCholesky<T> {
    /// Room for a matrix of `n` rows and half-bandwidth `band`.
    pub fn new(n: usize, band: usize) -> Self {
        let stride = (band + 1).next_multiple_of(LANES);
        Self {
            n,
            layout: Layout { band, stride },
            rows: vec![T::zero(); n * stride],
            panel: vec![T::zero(); (band + SLICE) * SLICE],
        }
    }

    /// Number of unknowns.
    pub(super) fn len(&self) -> usize {
        self.n
    }

    /// Half-bandwidth.
    pub fn band(&self) -> usize {
        self.layout.band
    }

    /// Clears the matrix, to be filled by [`set`](Self::set) and factorized.
    pub fn clear(&mut self) {
        self.clear_from(0);
    }

    /// Clears its rows from `row` on.
    pub(super) fn clear_from(&mut self, row: usize) {
        self.rows[row * self.layout.stride..].fill(T::zero());
    }

    /// Sets element `(i, j)`, `i - band <= j <= i`.
    #[inline(always)]
    pub fn set(&mut self, i: usize, j: usize, value: f64) {
        let at = self.layout.at(i, j);
        self.rows[at] = T::from_f64(value);
    }

    /// Overwrites the matrix by its factor.
    ///
    /// # Errors
    /// [`NotPositive`]; the contents are then of no use.
    pub fn factorize(&mut self) -> Result<(), NotPositive> {
        self.factorize_from(0)
    }

    /// The row at which the elimination can begin again so that row `row` is made anew.
    pub(super) fn slice_of(&self, row: usize) -> usize {
        row / SLICE * SLICE
    }

    /// Overwrites the rows of the matrix from `row` on, a beginning of a slice, those before being done.
    ///
    /// # Errors
    /// [`NotPositive`]; the contents are then of no use.
    pub(super) fn factorize_from(&mut self, row: usize) -> Result<(), NotPositive> {
        (row..self.n)
            .step_by(SLICE)
            .try_for_each(|row| self.factorize_slice(row))
    }

    /// Overwrites rows `row .. row + SLICE` of the matrix by those of its factor, those before being done: for a factor
    /// that is made in parts. The bits are those of [`factorize`](Self::factorize).
    ///
    /// # Errors
    /// [`NotPositive`]; the contents are then of no use.
    pub(super) fn factorize_slice(&mut self, row: usize) -> Result<(), NotPositive> {
        let end = (row + SLICE).min(self.n);
        let first = row.saturating_sub(self.layout.band);
        let (layout, rows, panel) = (self.layout, &mut self.rows, &mut self.panel);
        let panel = &mut panel[..(row + SLICE - first) * SLICE];
        panel.fill(T::zero());
        for r in row..end {
            let low = r.saturating_sub(layout.band);
            let from = &rows[layout.at(r, low)..=layout.at(r, r)];
            for (to, v) in panel[(low - first) * SLICE..].chunks_exact_mut(SLICE).zip(from) {
                to[r - row] = *v;
            }
        }
        let done = &rows[..row * layout.stride];
        vectorized(
            #[inline(always)]
            || {
                if size_of::<T>() == 4 {
                    eliminate::<T, LANES>(layout, done, panel, [first, row, end])
                } else {
                    eliminate::<T, HALF>(layout, done, panel, [first, row, end])
                }
            },
        )?;
        for r in row..end {
            let low = r.saturating_sub(layout.band);
            let to = &mut rows[layout.at(r, low)..=layout.at(r, r)];
            for (from, v) in panel[(low - first) * SLICE..].chunks_exact(SLICE).zip(to) {
                *v = from[r - row];
            }
        }
        Ok(())
    }

    /// Solves `L Lᵀ x = b` in place.
    ///
    /// # Panics
    /// If the length is wrong.
    pub fn solve(&self, x: &mut [T]) {
        self.forward(x, &[0]);
        self.backward(x);
    }

    /// `L⁻¹` of right-hand sides, one after the other in `all`, each 0 before a row of its own. A large factor takes longer to
    /// be read than to be multiplied by.
    ///
    /// # Panics
    /// If a length is wrong.
    pub(super) fn forward(&self, all: &mut [T], first: &[usize]) {
        assert_eq!(
            all.len(),
            self.n * first.len(),
            "right-hand sides of the matrix' size"
        );
        let (layout, start) = (self.layout, first.iter().copied().min().unwrap_or(0));
        vectorized(
            #[inline(always)]
            || {
                for i in start..self.n {
                    let low = i.saturating_sub(layout.band);
                    let row = &self.rows[layout.at(i, low)..=layout.at(i, i)];
                    let (row, inverse) = (&row[..i - low], row[i - low]);
                    for (some, first) in all.chunks_mut(TILE * self.n).zip(first.chunks(TILE)) {
                        let begun = |first: &usize| i >= *first;
                        if first.len() == TILE && first.iter().all(begun) {
                            let at = [0, 1, 2, 3].map(
                                #[inline(always)]
                                |c| c * self.n,
                            );
                            let sums = lanes_dots(
                                row,
                                at.map(
                                    #[inline(always)]
                                    |at| &some[at + low..at + i],
                                ),
                            );
                            for c in 0..TILE {
                                let x = &mut some[at[c] + i];
                                *x = (*x - sums[c]) * inverse;
                            }
                            continue;
                        }
                        for (x, first) in some.chunks_exact_mut(self.n).zip(first) {
                            if begun(first) {
                                x[i] = (x[i] - lanes_dot(row, &x[low..i])) * inverse;
                            }
                        }
                    }
                }
            },
        );
    }

    /// `L⁻ᵀx` in place.
    ///
    /// # Panics
    /// If the length is wrong.
    pub(super) fn backward(&self, x: &mut [T]) {
        assert_eq!(x.len(), self.n, "a right-hand side of the matrix' size");
        let layout = self.layout;
        vectorized(
            #[inline(always)]
            || {
                for i in (0..x.len()).rev() {
                    let low = i.saturating_sub(layout.band);
                    let row = &self.rows[layout.at(i, low)..=layout.at(i, i)];
                    let (row, inverse) = (&row[..i - low], row[i - low]);
                    let v = x[i] * inverse;
                    x[i] = v;
                    for (x, l) in x[low..i].iter_mut().zip(row) {
                        *x -= v * *l;
                    }
                }
            },
        );
    }
}

/// Rows `start .. end` in `panel`, whose first column is `first`: first the columns of the rows that are done, then their
/// own. Lanes of columns that a row does not have stay zero.
#[inline(always)]
fn eliminate<T: Real, const L: usize>(
    layout: Layout,
    done: &[T],
    panel: &mut [T],
    [first, start, end]: [usize; 3],
) -> Result<(), NotPositive> {
    for j in (first..start).step_by(TILE) {
        let count = TILE.min(start - j);
        let (before, open) = panel.split_at_mut((j - first) * SLICE);
        // A tile that is not whole repeats its last row.
        let rows = [0, 1, 2, 3].map(
            #[inline(always)]
            |c| {
                let row = j + c.min(count - 1);
                &done[layout.at(row, first)..=layout.at(row, row)]
            },
        );
        for lanes in (0..SLICE).step_by(L) {
            let sums = products::<T, L>(before, lanes, rows);
            for c in 0..count {
                let mut v = lanes_of::<T, L>(open, c, lanes);
                subtract(&mut v, &sums[c]);
                for k in 0..c {
                    let solved = lanes_of::<T, L>(open, k, lanes);
                    let l = rows[c][j - first + k];
                    for (v, s) in v.iter_mut().zip(&solved) {
                        *v -= *s * l;
                    }
                }
                let inverse = rows[c][j - first + c];
                for (to, v) in open[c * SLICE + lanes..][..L].iter_mut().zip(&v) {
                    *to = *v * inverse;
                }
            }
        }
    }
    for c in start..end {
        let (before, open) = panel.split_at_mut((c - first) * SLICE);
        let column = &mut open[..SLICE];
        let own = c - start;
        for lanes in (0..SLICE).step_by(L) {
            let mut v = lanes_of::<T, L>(column, 0, lanes);
            for line in before.chunks_exact(SLICE) {
                let l = line[own];
                let line = &line[lanes..lanes + L];
                for k in 0..L {
                    v[k] -= line[k] * l;
                }
            }
            column[lanes..lanes + L].copy_from_slice(&v);
        }
        let pivot = column[own];
        if pivot.is_nan() || pivot <= T::zero() {
            return Err(NotPositive {
                row: c,
                pivot: pivot.as_f64(),
            });
        }
        let inverse = T::one() / pivot.sqrt();
        column[..own].fill(T::zero());
        for v in &mut column[own..] {
            *v *= inverse;
        }
        column[own] = inverse;
    }
    Ok(())
}

/// Lanes from `lanes` on of column `c`.
#[inline(always)]
fn lanes_of<T: Real, const L: usize>(columns: &[T], c: usize, lanes: usize) -> [T; L] {
    let mut out = [T::zero(); L];
    out.copy_from_slice(&columns[c * SLICE + lanes..][..L]);
    out
}

#[inline(always)]
fn subtract<T: Real, const L: usize>(v: &mut [T; L], sum: &[T; L]) {
    for l in 0..L {
        v[l] -= sum[l];
    }
}

/// `Σ_k row_k·panel_k` over all columns of `panel`, for `L` of its lanes and each of the rows.
#[inline(always)]
fn products<T: Real, const L: usize>(panel: &[T], lanes: usize, rows: [&[T]; TILE]) -> [[T; L]; TILE] {
    let mut sum = [[T::zero(); L]; TILE];
    let columns = panel.len() / SLICE;
    let [r0, r1, r2, r3] = rows;
    let rows = [&r0[..columns], &r1[..columns], &r2[..columns], &r3[..columns]];
    for (k, line) in panel.chunks_exact(SLICE).enumerate() {
        let line = &line[lanes..lanes + L];
        for r in 0..TILE {
            let v = rows[r][k];
            for l in 0..L {
                sum[r][l] += v * line[l];
            }
        }
    }
    sum
}

#[inline(always)]
fn tree<T: Real>(s: &[T; HALF]) -> T {
    ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]))
}

/// [`lanes_dot`] of one list with each of several.
#[inline(always)]
fn lanes_dots<T: Real>(a: &[T], b: [&[T]; TILE]) -> [T; TILE] {
    let (a, a_rest) = a.as_chunks::<LANES>();
    let [(b0, r0), (b1, r1), (b2, r2), (b3, r3)] = b.map(
        #[inline(always)]
        |b| b.as_chunks::<LANES>(),
    );
    let [mut s0, mut s1, mut s2, mut s3] = [[T::zero(); LANES]; TILE];
    for ((((a, b0), b1), b2), b3) in a.iter().zip(b0).zip(b1).zip(b2).zip(b3) {
        add_products(&mut s0, a, b0);
        add_products(&mut s1, a, b1);
        add_products(&mut s2, a, b2);
        add_products(&mut s3, a, b3);
    }
    [
        total_of(s0, a_rest, r0),
        total_of(s1, a_rest, r1),
        total_of(s2, a_rest, r2),
        total_of(s3, a_rest, r3),
    ]
}

#[inline(always)]
fn lanes_dot<T: Real>(a: &[T], b: &[T]) -> T {
    let (a, a_rest) = a.as_chunks::<LANES>();
    let (b, b_rest) = b.as_chunks::<LANES>();
    let mut sum = [T::zero(); LANES];
    for (a, b) in a.iter().zip(b) {
        add_products(&mut sum, a, b);
    }
    total_of(sum, a_rest, b_rest)
}

#[inline(always)]
fn add_products<T: Real>(sum: &mut [T; LANES], a: &[T; LANES], b: &[T; LANES]) {
    for l in 0..LANES {
        sum[l] += a[l] * b[l];
    }
}

/// What lanes add up to, with the products of what they left.
#[inline(always)]
fn total_of<T: Real>(sum: [T; LANES], a_rest: &[T], b_rest: &[T]) -> T {
    // Otherwise the compiler fits the lanes of the loop before to the pairs that are added here.
    let sum = black_box(sum);
    let half = std::array::from_fn(|l| sum[l] + sum[l + HALF]);
    let mut total = tree(&half);
    for (a, b) in a_rest.iter().zip(b_rest) {
        total += *a * *b;
    }
    total
}
