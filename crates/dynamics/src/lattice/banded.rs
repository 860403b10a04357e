use std::ops::Range;

use bspline::Real;
use nalgebra::DMatrix;

/// A matrix each of whose rows is one short stretch of weights: collocation matrices, their transposes and
/// differences of their rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Banded<T> {
    columns: usize,
    first: Vec<usize>,
    /// Row `i` has the weights `start[i] .. start[i + 1]`.
    start: Vec<usize>,
    weights: Vec<T>,
}

impl<T: Real> Banded<T> {
    /// From rows of `(column, weight)`, columns ascending; repeated ones add up, gaps become zeros.
    ///
    /// # Panics
    /// If a column is not less than `columns`.
    pub fn from_rows<R: AsRef<[(usize, T)]>>(columns: usize, rows: impl Iterator<Item = R>) -> Self {
        let mut out = Self {
            columns,
            first: Vec::new(),
            start: vec![0],
            weights: Vec::new(),
        };
        for row in rows {
            let row = row.as_ref();
            let (low, high) = match (row.first(), row.last()) {
                (Some(a), Some(b)) => (a.0, b.0 + 1),
                _ => (0, 0),
            };
            assert!(high <= columns, "column {} of {columns}", high - 1);
            let begin = out.weights.len();
            out.weights.resize(begin + high - low, T::zero());
            for &(c, w) in row {
                out.weights[begin + c - low] += w;
            }
            out.first.push(low);
            out.start.push(out.weights.len());
        }
        out
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.first.len()
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// First column and weights of row `i`; an empty row starts anywhere.
    #[inline(always)]
    pub fn row(&self, i: usize) -> (usize, &[T]) {
        (self.first[i], &self.weights[self.start[i]..self.start[i + 1]])
    }

    /// Largest number of weights in a row.
    pub fn width(&self) -> usize {
        self.start.windows(2).map(|s| s[1] - s[0]).max().unwrap_or(0)
    }

    /// The matrix with every weight converted.
    pub fn map<U: Real>(&self, f: impl Fn(T) -> U) -> Banded<U> {
        Banded {
            columns: self.columns,
            first: self.first.clone(),
            start: self.start.clone(),
            weights: self.weights.iter().map(|&w| f(w)).collect(),
        }
    }

    /// The transposed matrix.
    pub fn transposed(&self) -> Self {
        let mut rows = vec![Vec::new(); self.columns];
        for i in 0..self.rows() {
            let (first, weights) = self.row(i);
            for (j, &w) in weights.iter().enumerate() {
                rows[first + j].push((i, w));
            }
        }
        Self::from_rows(self.rows(), rows.into_iter())
    }

    /// Row `i` of the result is row `i` minus row `i + 1`, what a spring between neighbouring samples sees; the last
    /// row is empty.
    pub fn differences(&self) -> Self {
        let rows = (1..=self.rows()).map(|i| {
            let mut row: Vec<(usize, T)> = Vec::new();
            for (s, sign) in [(i - 1, T::one()), (i, -T::one())] {
                if i < self.rows() {
                    let (first, weights) = self.row(s);
                    row.extend(weights.iter().enumerate().map(|(j, &w)| (first + j, sign * w)));
                }
            }
            row.sort_by_key(|(c, _)| *c);
            row
        });
        Self::from_rows(self.columns, rows)
    }

    /// Columns that the rows `rows` have weights in.
    pub fn support(&self, rows: Range<usize>) -> Range<usize> {
        let filled = rows.filter(|&i| !self.row(i).1.is_empty());
        let ends = filled.map(|i| (self.row(i).0, self.row(i).0 + self.row(i).1.len()));
        ends.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
            .map_or(0..0, |(a, b)| a..b)
    }

    /// The least stretch of rows with all that have weights in the columns `columns`.
    pub fn reached(&self, columns: Range<usize>) -> Range<usize> {
        let meets = |i: &usize| {
            let (first, weights) = self.row(*i);
            first < columns.end && columns.start < first + weights.len()
        };
        let first = (0..self.rows()).find(meets);
        let last = (0..self.rows()).rfind(meets);
        first.zip(last).map_or(0..0, |(a, b)| a..b + 1)
    }

    /// All elements.
    pub fn to_dense(&self) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.rows(), self.columns);
        for i in 0..self.rows() {
            let (first, weights) = self.row(i);
            for (j, w) in weights.iter().enumerate() {
                out[(i, first + j)] = w.as_f64();
            }
        }
        out
    }

    /// `y_i = Σ_c M_ic x_c` where element `i` is a stretch of `inner` numbers: the product along the slowest axis.
    #[inline(always)]
    pub(super) fn apply_planes(&self, inner: usize, x: &[T], y: &mut [T]) {
        debug_assert_eq!(x.len(), self.columns * inner);
        debug_assert_eq!(y.len(), self.rows() * inner);
        for (i, out) in y.chunks_exact_mut(inner).enumerate() {
            let (first, weights) = self.row(i);
            let x = &x[first * inner..(first + weights.len()) * inner];
            combine(weights, x, out);
        }
    }
}

/// `out = Σ_j w_j x_j`, where `x_j` are successive stretches as long as `out`. Four terms at a time, in order.
#[inline(always)]
pub(super) fn combine<T: Real>(weights: &[T], x: &[T], out: &mut [T]) {
    let n = out.len();
    let row = |j: usize| &x[j * n..(j + 1) * n];
    let whole = weights.len() / 4 * 4;
    if weights.len() < 4 {
        out.fill(T::zero());
    }
    for j in (0..whole).step_by(4) {
        let (a, b, c, d) = (row(j), row(j + 1), row(j + 2), row(j + 3));
        let (wa, wb, wc, wd) = (weights[j], weights[j + 1], weights[j + 2], weights[j + 3]);
        if j == 0 {
            for k in 0..n {
                out[k] = (wa * a[k] + wb * b[k]) + (wc * c[k] + wd * d[k]);
            }
        } else {
            for k in 0..n {
                out[k] += (wa * a[k] + wb * b[k]) + (wc * c[k] + wd * d[k]);
            }
        }
    }
    for j in whole..weights.len() {
        for (o, &a) in out.iter_mut().zip(row(j)) {
            *o += weights[j] * a;
        }
    }
}

/// Outputs computed together along the fastest axis.
const LANES: usize = 8;
/// Lines taken together along the fastest axis.
const LINES: usize = 4;

/// A [`Banded`] matrix laid out for products along the fastest axis: eight rows at a time with all columns that any
/// of them needs, so that the outputs are the lanes.
#[derive(Clone, Debug)]
pub(super) struct BandedLanes<T> {
    rows: usize,
    columns: usize,
    blocks: Vec<Block<T>>,
}

#[derive(Clone, Debug)]
struct Block<T> {
    first: usize,
    weights: Vec<[T; LANES]>,
}

impl<T: Real> BandedLanes<T> {
    pub fn new(m: &Banded<T>) -> Self {
        let blocks = (0..m.rows().div_ceil(LANES)).map(|b| {
            let rows = b * LANES..((b + 1) * LANES).min(m.rows());
            let reach = |i: usize| (m.row(i).0, m.row(i).0 + m.row(i).1.len());
            let first = rows.clone().map(|i| reach(i).0).min().unwrap_or(0);
            let end = rows.clone().map(|i| reach(i).1).max().unwrap_or(0).max(first);
            let mut weights = vec![[T::zero(); LANES]; end - first];
            for (lane, i) in rows.enumerate() {
                let (start, row) = m.row(i);
                for (j, &w) in row.iter().enumerate() {
                    weights[start + j - first][lane] = w;
                }
            }
            Block { first, weights }
        });
        Self {
            rows: m.rows(),
            columns: m.columns(),
            blocks: blocks.collect(),
        }
    }

    pub fn rows(&self) -> usize {
        self.rows
    }

    pub fn columns(&self) -> usize {
        self.columns
    }

    /// `y[line][i] = Σ_c M_ic x[line][c]`.
    #[inline(always)]
    pub fn apply_lines(&self, x: &[T], y: &mut [T]) {
        debug_assert_eq!(x.len() / self.columns, y.len() / self.rows);
        let together = x.chunks_exact(LINES * self.columns);
        let rest = together.remainder();
        let mut outputs = y.chunks_exact_mut(LINES * self.rows);
        for (x, y) in together.zip(&mut outputs) {
            self.apply_some::<LINES>(x, y);
        }
        let outputs = outputs.into_remainder();
        for (x, y) in rest
            .chunks_exact(self.columns)
            .zip(outputs.chunks_exact_mut(self.rows))
        {
            self.apply_some::<1>(x, y);
        }
    }

    #[inline(always)]
    fn apply_some<const N: usize>(&self, x: &[T], y: &mut [T]) {
        for (b, block) in self.blocks.iter().enumerate() {
            let mut sum = [[T::zero(); LANES]; N];
            let lines: [&[T]; N] = std::array::from_fn(|l| {
                let at = l * self.columns + block.first;
                &x[at..at + block.weights.len()]
            });
            for (c, w) in block.weights.iter().enumerate() {
                for l in 0..N {
                    let v = lines[l][c];
                    for k in 0..LANES {
                        sum[l][k] += v * w[k];
                    }
                }
            }
            let (from, count) = (b * LANES, LANES.min(self.rows - b * LANES));
            for l in 0..N {
                let out = &mut y[l * self.rows + from..];
                if count == LANES {
                    out[..LANES].copy_from_slice(&sum[l]);
                } else {
                    out[..count].copy_from_slice(&sum[l][..count]);
                }
            }
        }
    }
}
