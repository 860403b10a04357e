use crate::{Basis, KnotVector, Real};

/// A matrix with a few successive weights in each row: collocation, knot insertion, restriction to an interval.
///
/// Applied to a block of coefficients one axis at a time; the three-dimensional matrix is never formed.
#[derive(Clone, Debug, PartialEq)]
pub struct BandedRows<T> {
    column_count: usize,
    width: usize,
    first: Vec<u32>,
    weights: Vec<T>,
}

impl<T: Real> BandedRows<T> {
    /// No rows yet; each will hold `width <= column_count` weights.
    pub(crate) fn with_capacity(column_count: usize, width: usize, rows: usize) -> Self {
        debug_assert!(0 < width && width <= column_count);
        Self {
            column_count,
            width,
            first: Vec::with_capacity(rows),
            weights: Vec::with_capacity(rows * width),
        }
    }

    /// Appends the row whose weights start at column `first`, which may lie outside as long as the weights
    /// there are zero.
    pub(crate) fn push(&mut self, first: isize, weights: &[f64]) {
        debug_assert_eq!(weights.len(), self.width);
        let kept = first.clamp(0, (self.column_count - self.width) as isize);
        self.first.push(kept as u32);
        self.weights.extend((0..self.width as isize).map(|slot| {
            let at = kept + slot - first;
            let inside = (0..self.width as isize).contains(&at);
            T::from_f64(if inside { weights[at as usize] } else { 0.0 })
        }));
    }

    /// Derivatives of order `derivative <= 3` of all functions of `knots` at `positions`, in the order given: the
    /// spline with coefficients `c` takes the values `A c` there (one axis of the `A` of [Hua04 eq. 5]).
    pub fn collocation(
        knots: &KnotVector,
        positions: impl IntoIterator<Item = f64>,
        derivative: usize,
    ) -> Self {
        let positions = positions.into_iter();
        let mut rows = Self::with_capacity(knots.coefficient_count(), knots.order(), positions.size_hint().0);
        let mut last: Option<Basis<T>> = None;
        for t in positions {
            let basis = last.insert(match &last {
                Some(last) => last.moved_to(knots, t, derivative),
                None => Basis::at(knots, t, derivative),
            });
            rows.first.push(basis.first() as u32);
            rows.weights.extend(basis.derivative(derivative));
        }
        rows
    }

    /// Number of rows.
    pub fn row_count(&self) -> usize {
        self.first.len()
    }

    /// Number of columns: the coefficients that the matrix acts on.
    pub fn column_count(&self) -> usize {
        self.column_count
    }

    /// Weights in each row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Row `r`: the column of its first weight, and the weights.
    ///
    /// # Panics
    /// If there is no row `r`.
    #[inline]
    pub fn row(&self, r: usize) -> (usize, &[T]) {
        (
            self.first[r] as usize,
            &self.weights[r * self.width..(r + 1) * self.width],
        )
    }

    /// First column read and one past the last, over all rows; `0..0` without rows.
    pub fn reads(&self) -> std::ops::Range<usize> {
        let least = self.first.iter().min().copied().unwrap_or(0) as usize;
        let most = self.first.iter().max().map_or(0, |f| *f as usize + self.width);
        least..most
    }

    /// The matrix times every line of `source` along `axis`; `source` has `shape`, last axis fastest, and so has the
    /// result with `shape[axis]` replaced by [`Self::row_count`].
    ///
    /// # Panics
    /// If `source` is not as long as `shape` says, or `shape[axis]` is not the number of columns.
    pub fn apply_along(&self, axis: usize, shape: [usize; 3], source: &[T]) -> Vec<T> {
        assert_eq!(
            source.len(),
            shape.iter().product::<usize>(),
            "one value per place"
        );
        assert_eq!(shape[axis], self.column_count, "one column per coefficient");
        let inner: usize = shape[axis + 1..].iter().product();
        let outer: usize = shape[..axis].iter().product();
        let mut target = Vec::with_capacity(outer * self.row_count() * inner);
        for block in source.chunks_exact((shape[axis] * inner).max(1)).take(outer) {
            for r in 0..self.row_count() {
                let (first, weights) = self.row(r);
                let start = target.len();
                target.resize(start + inner, T::zero());
                let line = &mut target[start..];
                for (slot, w) in weights.iter().enumerate() {
                    let from = &block[(first + slot) * inner..][..inner];
                    for (t, c) in line.iter_mut().zip(from) {
                        *t += *w * *c;
                    }
                }
            }
        }
        target
    }
}
