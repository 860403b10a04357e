//! A multigrid cycle for full levels.

use nalgebra::{Cholesky, DVector, Dyn};

use super::full_grid::FullGrid;
use super::full_operator::{Cluster, Operator};
use bspline::Real;

/// One symmetric multigrid cycle as preconditioner: the same energy on every coarser level, Chebyshev–Jacobi
/// smoothing, and a Cholesky factor on 4³. In single precision: what it gets wrong the iterations round it mend.
pub(crate) struct VCycle {
    bottom: Cholesky<f64, Dyn>,
    levels: Vec<Smoother>,
}

struct Smoother {
    operator: Operator<f32>,
    inverse_diagonal: Vec<f32>,
    /// Estimate of the largest eigenvalue of `D⁻¹A`.
    lambda: f64,
}

impl VCycle {
    /// Levels `4 .. 4·2^(count-1)` with their own clusters, and the gradient weight of the finest. Coarser
    /// data weigh `(h_j/h)²` each, since there are fewer half-cells, and the bending term `h/h_j`, so that
    /// both energies keep their size.
    pub fn new(clusters: &[Vec<Cluster>], beta: f64, bending: f64) -> Self {
        let mut dense = Self::operator::<f64>(clusters, 0, beta, bending).dense();
        // The bending energy does not see linear functions; where data does not either, this does.
        let ridge = 1e-12 * dense.diagonal().max();
        for i in 0..dense.nrows() {
            dense[(i, i)] += ridge;
        }
        let bottom = Cholesky::new(dense).expect("normal equations with a ridge are positive definite");
        Self {
            bottom,
            levels: (1..clusters.len())
                .map(|l| Smoother::new(Self::operator(clusters, l, beta, bending)))
                .collect(),
        }
    }

    fn operator<T: Real>(clusters: &[Vec<Cluster>], level: usize, beta: f64, bending: f64) -> Operator<T> {
        let ratio = (1u64 << (clusters.len() - 1 - level)) as f64;
        Operator::new(&clusters[level], 4 << level, beta, ratio * ratio, bending / ratio)
    }

    /// One cycle from zero.
    pub fn apply(&self, r: &FullGrid<f64>) -> FullGrid<f64> {
        if self.levels.is_empty() {
            return self.bottom(r);
        }
        self.descend(self.levels.len(), &r.converted()).converted()
    }

    fn bottom(&self, r: &FullGrid<f64>) -> FullGrid<f64> {
        let solved = self.bottom.solve(&DVector::from_column_slice(&r.values));
        FullGrid {
            n: r.n,
            values: solved.as_slice().to_vec(),
        }
    }

    fn descend(&self, level: usize, r: &FullGrid<f32>) -> FullGrid<f32> {
        if level == 0 {
            return self.bottom(&r.converted()).converted();
        }
        let smoother = &self.levels[level - 1];
        let mut x = FullGrid::zeros(r.n);
        let mut rest = r.clone();
        smoother.smooth(&mut x, &mut rest, true);
        let correction = self.descend(level - 1, &rest.restricted()).refined();
        let change = smoother.operator.apply(&correction);
        for i in 0..x.values.len() {
            x.values[i] += correction.values[i];
            rest.values[i] -= change.values[i];
        }
        smoother.smooth(&mut x, &mut rest, false);
        x
    }
}

impl Smoother {
    fn new(operator: Operator<f32>) -> Self {
        let inverse_diagonal = operator.inverse_diagonal();
        // Power iteration from a fixed rough vector; 1.1 twice covers what five steps leave out.
        let mut v = FullGrid::zeros(operator.n);
        for (i, x) in v.values.iter_mut().enumerate() {
            *x = (i.wrapping_mul(2654435761) >> 7 & 1023) as f32 - 511.5;
        }
        let mut lambda = 1.0;
        for _ in 0..5 {
            let mut next = operator.apply(&v);
            for (x, d) in next.values.iter_mut().zip(&inverse_diagonal) {
                *x *= d;
            }
            let norm = |g: &FullGrid<f32>| g.values.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt();
            lambda = norm(&next) / norm(&v);
            v = next;
        }
        Self {
            operator,
            inverse_diagonal,
            lambda: 1.1 * 1.1 * lambda,
        }
    }

    /// Two steps of Chebyshev iteration on `[λ/8, λ]`, from `r` the residual of `x`; `goes_on` if it is to be that of the new
    /// `x` afterwards.
    fn smooth(&self, x: &mut FullGrid<f32>, r: &mut FullGrid<f32>, goes_on: bool) {
        let (low, high) = (self.lambda / 8.0, self.lambda);
        let (theta, delta) = (0.5 * (high + low), 0.5 * (high - low));
        let sigma = theta / delta;
        let mut rho = 1.0 / sigma;
        let mut step = FullGrid::zeros(r.n);
        for i in 0..step.values.len() {
            step.values[i] = self.inverse_diagonal[i] * r.values[i] / theta as f32;
        }
        for last in [false, true] {
            for i in 0..x.values.len() {
                x.values[i] += step.values[i];
            }
            if last && !goes_on {
                break;
            }
            let change = self.operator.apply(&step);
            for i in 0..r.values.len() {
                r.values[i] -= change.values[i];
            }
            if last {
                break;
            }
            let next = 1.0 / (2.0 * sigma - rho);
            let (keep, add) = ((next * rho) as f32, (2.0 * next / delta) as f32);
            for i in 0..step.values.len() {
                step.values[i] = keep * step.values[i] + add * self.inverse_diagonal[i] * r.values[i];
            }
            rho = next;
        }
    }
}
