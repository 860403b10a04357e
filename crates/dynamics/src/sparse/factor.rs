use nalgebra::DMatrixViewMut;
use nalgebra_sparse::factorization::{CscCholesky, CscSymbolicCholesky};
use nalgebra_sparse::pattern::SparsityPattern;
use sprs::CsMat;

/// First share, in units of rounding, that a diagonal is raised by where a pivot is lost to rounding, and the ratio of one
/// try to the next.
const RAISED: f64 = 16.0;
/// Share up to which it is raised.
const MOST_RAISED: f64 = 1e-2;

/// A matrix that no small shift of its diagonal makes positive definite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the matrix is not positive definite; take less contrast of stiffness and mass")]
pub struct NotDefinite;

/// The factor `PHPᵀ = LLᵀ` of a symmetric sparse matrix in an order of elimination.
#[derive(Clone, Debug)]
pub struct SparseCholesky {
    /// Number of the unknown at each place of the order.
    order: Vec<usize>,
    /// Where the elements of the reordered matrix stand in the given one.
    origin: Vec<usize>,
    /// Places of the diagonal in the reordered matrix.
    diagonal: Vec<usize>,
    symbolic: CscSymbolicCholesky,
    factor: Option<CscCholesky<f64>>,
    x: Vec<f64>,
}

impl SparseCholesky {
    /// Plans factors of symmetric matrices with the elements of `matrix`, in the order that
    /// [`nested_dissection`](super::nested_dissection) or another method gives.
    ///
    /// # Panics
    /// If `order` is no permutation of the unknowns.
    pub fn plan(matrix: &CsMat<f64>, order: Vec<usize>) -> Self {
        let n = matrix.rows();
        let mut place = vec![usize::MAX; n];
        for (p, &i) in order.iter().enumerate() {
            place[i] = p;
        }
        assert!(
            order.len() == n && !place.contains(&usize::MAX),
            "an order of all unknowns"
        );
        let starts = matrix.indptr();
        let (mut offsets, mut rows, mut origin, mut diagonal) = (vec![0], Vec::new(), Vec::new(), Vec::new());
        let mut column = Vec::new();
        for (c, &i) in order.iter().enumerate() {
            let elements = starts.outer_inds_sz(i);
            column.clear();
            column.extend(elements.map(|e| (place[matrix.indices()[e]], e)));
            column.sort_unstable();
            for (r, e) in &column {
                if *r == c {
                    diagonal.push(rows.len());
                }
                rows.push(*r);
                origin.push(*e);
            }
            offsets.push(rows.len());
        }
        let pattern = SparsityPattern::try_from_offsets_and_indices(n, n, offsets, rows)
            .expect("columns are sorted, each element once");
        Self {
            order,
            origin,
            diagonal,
            symbolic: CscSymbolicCholesky::factor(pattern),
            factor: None,
            x: vec![0.0; n],
        }
    }

    /// Elements of `L`.
    pub fn fill(&self) -> usize {
        self.symbolic.l_pattern().nnz()
    }

    /// Multiplications that a factor takes, about: `Σ` of the squared lengths of the columns of `L`.
    pub fn work(&self) -> f64 {
        let columns = self.symbolic.l_pattern().major_offsets().windows(2);
        columns.map(|w| ((w[1] - w[0]) as f64).powi(2)).sum()
    }

    /// Makes the factor of a matrix with the elements of the one it was planned for. Where rounding costs a pivot its sign, the
    /// diagonal is raised by as little as helps.
    ///
    /// # Errors
    /// [`NotDefinite`].
    ///
    /// # Panics
    /// If the matrix has another number of elements.
    pub fn factorize(&mut self, matrix: &CsMat<f64>) -> Result<(), NotDefinite> {
        assert_eq!(matrix.nnz(), self.origin.len(), "elements as planned");
        let mut values: Vec<f64> = self.origin.iter().map(|&e| matrix.data()[e]).collect();
        let mut raised = 0.0;
        loop {
            // What a failed factor leaves behind is of no use.
            let made = match self.factor.take() {
                Some(mut factor) => factor.refactor(&values).map(|()| factor),
                None => CscCholesky::factor_numerical(self.symbolic.clone(), &values),
            };
            match made {
                Ok(factor) => {
                    self.factor = Some(factor);
                    return Ok(());
                }
                Err(_) if raised < MOST_RAISED => {
                    let before = raised;
                    raised = if raised == 0.0 {
                        RAISED * f64::EPSILON
                    } else {
                        RAISED * raised
                    };
                    for &d in &self.diagonal {
                        values[d] *= (1.0 + raised) / (1.0 + before);
                    }
                }
                Err(_) => return Err(NotDefinite),
            }
        }
    }

    /// Solves in place.
    ///
    /// # Panics
    /// If the length is wrong or no factor was made.
    pub fn solve(&mut self, x: &mut [f64]) {
        let factor = self.factor.as_ref().expect("a factor");
        for (to, &i) in self.x.iter_mut().zip(&self.order) {
            *to = x[i];
        }
        factor.solve_mut(DMatrixViewMut::from_slice(&mut self.x, x.len(), 1));
        for (from, &i) in self.x.iter().zip(&self.order) {
            x[i] = *from;
        }
    }
}
