use bspline::Real;

/// Orthonormal rows on some of the unknowns.
#[derive(Clone, Debug, Default)]
pub(crate) struct OrthonormalRows {
    /// The unknowns that occur, ascending.
    pub columns: Vec<usize>,
    /// Row-major, one column per entry of `columns`.
    pub q: Vec<f64>,
}

impl OrthonormalRows {
    /// Weights of row `h`, one per entry of `columns`.
    pub fn row(&self, h: usize) -> &[f64] {
        let width = self.columns.len();
        &self.q[h * width..(h + 1) * width]
    }

    /// Number of rows.
    pub fn count(&self) -> usize {
        self.q.len() / self.columns.len().max(1)
    }

    /// `q_h·x`.
    pub fn times<T: Real>(&self, h: usize, x: &[T]) -> f64 {
        let terms = self.row(h).iter().zip(&self.columns);
        terms.map(|(q, i)| q * x[*i].as_f64()).sum()
    }

    /// The least change of `x` that makes `Qx` the wanted values; the rows are orthonormal, so one after the other is as
    /// good as all at once.
    pub fn close<T: Real>(&self, x: &mut [T], wanted: impl Fn(usize) -> f64) {
        for h in 0..self.count() {
            let missing = wanted(h) - self.times(h, x);
            for (q, i) in self.row(h).iter().zip(&self.columns) {
                x[*i] += T::from_f64(missing * q);
            }
        }
    }
}
