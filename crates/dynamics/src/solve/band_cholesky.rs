//! Cholesky factorization inside the band of a matrix.

use bspline::Real;
use pulp::Arch;

use super::pcg::Preconditioner;
use crate::springs::StepMatrix;

/// Rows and columns that are eliminated together.
const TILE: usize = 4;
const LANES: usize = 16;
const HALF: usize = LANES / 2;
const MARGIN: usize = 2 * TILE;

/// The factor `H = L Lᵀ` of a symmetric matrix of half-bandwidth `b`, stored by rows: row `i` holds columns
/// `i-b ..= i`, the diagonal as its inverse.
#[derive(Clone, Debug)]
pub struct BandCholesky<T> {
    n: usize,
    layout: Layout,
    rows: Vec<T>,
}

/// Where the elements lie. Before the first column of a row there are [`MARGIN`] zeros, so that a tile may read
/// beyond the band of its lower rows.
#[derive(Clone, Copy, Debug)]
struct Layout {
    band: usize,
    stride: usize,
}

impl Layout {
    #[inline(always)]
    fn at(self, row: usize, column: usize) -> usize {
        row * self.stride + MARGIN + column + self.band - row
    }
}

/// A pivot that is not positive: the matrix is not positive definite in the working precision.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("pivot {pivot:.3e} at row {row}: the matrix is not positive definite in this precision")]
pub struct NotPositive {
    /// Row of the pivot.
    pub row: usize,
    /// Its value.
    pub pivot: f64,
}

impl<T: Real> BandCholesky<T> {
    /// Room for a matrix of `n` rows and half-bandwidth `band`.
    pub fn new(n: usize, band: usize) -> Self {
        let stride = (MARGIN + band + 1).next_multiple_of(LANES);
        Self {
            n,
            layout: Layout { band, stride },
            rows: vec![T::zero(); n * stride],
        }
    }

    /// Number of unknowns.
    pub fn len(&self) -> usize {
        self.n
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.n == 0
    }

    /// Half-bandwidth.
    pub fn band(&self) -> usize {
        self.layout.band
    }

    /// Clears the matrix, to be filled by [`set`](Self::set) and factorized.
    pub fn clear(&mut self) {
        self.rows.fill(T::zero());
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
        let this = &mut *self;
        Arch::new().dispatch(
            #[inline(always)]
            move || this.eliminate(),
        )
    }

    /// Row by row in tiles of four by four: the columns before the tile, which both its rows and its columns have
    /// done, then the tile itself.
    #[inline(always)]
    fn eliminate(&mut self) -> Result<(), NotPositive> {
        let (n, layout) = (self.n, self.layout);
        for i in (0..n).step_by(TILE) {
            let tall = TILE.min(n - i);
            let (done, open) = self.rows.split_at_mut(i * layout.stride);
            let first = i.saturating_sub(layout.band) / TILE * TILE;
            for j in (first..i).step_by(TILE) {
                if tall == TILE {
                    tile(layout, done, open, i, j, first);
                } else {
                    for r in i..i + tall {
                        for c in j..j + TILE {
                            single(layout, done, open, i, r, c);
                        }
                    }
                }
            }
            for r in i..i + tall {
                for c in i..=r {
                    let at = |row: usize, column: usize| layout.at(row, column) - i * layout.stride;
                    let low = r.saturating_sub(layout.band).min(c);
                    let sum = lanes_dot(&open[at(r, low)..at(r, c)], &open[at(c, low)..at(c, c)]);
                    let value = open[at(r, c)] - sum;
                    open[at(r, c)] = if r > c {
                        value * open[at(c, c)]
                    } else if value > T::zero() {
                        T::one() / value.sqrt()
                    } else {
                        let pivot = value.as_f64();
                        return Err(NotPositive { row: r, pivot });
                    };
                }
            }
        }
        Ok(())
    }

    /// Solves `L Lᵀ x = b` in place.
    ///
    /// # Panics
    /// If the length is wrong.
    pub fn solve(&self, x: &mut [T]) {
        assert_eq!(x.len(), self.n, "a right-hand side of the matrix' size");
        let layout = self.layout;
        Arch::new().dispatch(
            #[inline(always)]
            || {
                for i in 0..x.len() {
                    let low = i.saturating_sub(layout.band);
                    let row = &self.rows[layout.at(i, low)..=layout.at(i, i)];
                    let (row, inverse) = (&row[..i - low], row[i - low]);
                    x[i] = (x[i] - lanes_dot(row, &x[low..i])) * inverse;
                }
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

impl<T: Real> Preconditioner<T> for BandCholesky<T> {
    fn apply(&mut self, _: &StepMatrix<T>, r: &[T], z: &mut [T]) {
        z.copy_from_slice(r);
        self.solve(z);
    }
}

/// Element `(r, c)` of the rows that are open (from `i` on), `c < i`.
#[inline(always)]
fn single<T: Real>(layout: Layout, done: &[T], open: &mut [T], i: usize, r: usize, c: usize) {
    let low = r.saturating_sub(layout.band);
    if c < low {
        return;
    }
    let here = |column: usize| layout.at(r, column) - i * layout.stride;
    let there = |column: usize| layout.at(c, column);
    let sum = lanes_dot(&open[here(low)..here(c)], &done[there(low)..there(c)]);
    open[here(c)] = (open[here(c)] - sum) * done[there(c)];
}

/// Elements `(i .. i+4, j .. j+4)` with the columns from `first` on.
#[inline(always)]
fn tile<T: Real>(layout: Layout, done: &[T], open: &mut [T], i: usize, j: usize, first: usize) {
    let length = j - first;
    let here: [usize; TILE] = std::array::from_fn(|r| layout.at(i + r, first) - i * layout.stride);
    let there: [usize; TILE] = std::array::from_fn(|c| layout.at(j + c, first));
    let mut value = [[T::zero(); TILE]; TILE];
    {
        let a: [&[T]; TILE] = std::array::from_fn(|r| &open[here[r]..here[r] + length]);
        let b: [&[T]; TILE] = std::array::from_fn(|c| &done[there[c]..there[c] + length]);
        let mut sum = [[[T::zero(); HALF]; TILE]; TILE];
        let whole = length / HALF * HALF;
        for k in (0..whole).step_by(HALF) {
            let eight = |v: &[T]| -> [T; HALF] { v[k..k + HALF].try_into().expect("eight lanes") };
            let (x, y) = (a.map(eight), b.map(eight));
            for r in 0..TILE {
                for c in 0..TILE {
                    for l in 0..HALF {
                        sum[r][c][l] += x[r][l] * y[c][l];
                    }
                }
            }
        }
        for r in 0..TILE {
            for c in 0..TILE {
                let mut v = tree(&sum[r][c]);
                for k in whole..length {
                    v += a[r][k] * b[c][k];
                }
                value[r][c] = v;
            }
        }
    }
    for r in 0..TILE {
        for c in 0..TILE {
            let (row, column) = (here[r] + length, there[c] + length);
            let mut v = open[row + c] - value[r][c];
            for k in 0..c {
                v -= open[row + k] * done[column + k];
            }
            open[row + c] = v * done[column + c];
        }
    }
}

#[inline(always)]
fn tree<T: Real>(s: &[T; HALF]) -> T {
    ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]))
}

#[inline(always)]
fn lanes_dot<T: Real>(a: &[T], b: &[T]) -> T {
    let mut sum = [T::zero(); LANES];
    let (a, a_rest) = a.as_chunks::<LANES>();
    let (b, b_rest) = b.as_chunks::<LANES>();
    for (a, b) in a.iter().zip(b) {
        for l in 0..LANES {
            sum[l] += a[l] * b[l];
        }
    }
    let half = std::array::from_fn(|l| sum[l] + sum[l + HALF]);
    let mut total = tree(&half);
    for (a, b) in a_rest.iter().zip(b_rest) {
        total += *a * *b;
    }
    total
}
