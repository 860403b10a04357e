//! Least squares on a full level, without a matrix.
//!
//! Energy on a level of spacing `h` (unit box):
//! `Σ_k a_k [f(x_k)² + β²|∇f(x_k) + n_k|²] + μ' Σ [Σ_a (δ_aa C)² + 2 Σ_{a<b} (δ_ab C)²]`, `k` over [`Cluster`]s.

use bspline::Real;
use glam::DVec3;
use nalgebra::DMatrix;

use super::cg::{Stop, System, conjugate_gradients};
use super::full_grid::{FullGrid, add_bending, bending_diagonal, bending_entry};
use super::outcome::SolverOutcome;
use super::stencil::{Spot, gather, scatter, scatter_squares};

/// Mean of the samples of one half-cell whose normals share an octant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cluster {
    /// Mean position, unit box.
    pub position: DVec3,
    /// Mean of the unit normals, not normalized: short where they disagree.
    pub normal: DVec3,
    /// Samples merged.
    pub count: f64,
    /// `¼ · count / count of the half-cell`: every occupied half-cell weighs the same, whatever its density.
    pub weight: f64,
}

/// The normal equations of one full level.
#[derive(Debug)]
pub(crate) struct Operator<T> {
    /// Cells along the box.
    pub n: usize,
    beta: f64,
    bending: f64,
    data: Vec<(Spot<T>, T, [T; 3])>,
}

impl<T: Real> Operator<T> {
    /// For the clusters on `n` cells along the box, with their weights times `data_scale`, `β` (unit box) and `μ'`.
    pub fn new(clusters: &[Cluster], n: usize, beta: f64, data_scale: f64, bending: f64) -> Self {
        let m = n + 3;
        let data = clusters
            .iter()
            .map(|c| {
                let q = c.position * n as f64;
                let cell = q.to_array().map(|x| (x as usize).min(n - 1));
                let spot = Spot {
                    start: (cell[0] * m + cell[1]) * m + cell[2],
                    t: std::array::from_fn(|a| T::from_f64(q[a] - cell[a] as f64)),
                };
                let weight = T::from_f64(c.weight * data_scale);
                (spot, weight, c.normal.to_array().map(T::from_f64))
            })
            .collect();
        Self {
            n,
            beta,
            bending,
            data,
        }
    }

    fn strides(&self) -> [usize; 2] {
        let m = self.n + 3;
        [m * m, m]
    }

    /// `β²n²`: gradients here are by cell coordinates.
    fn gradient_weight(&self) -> T {
        T::from_f64((self.beta * self.n as f64).powi(2))
    }

    /// `A x`.
    pub fn apply(&self, x: &FullGrid<T>) -> FullGrid<T> {
        let mut out = FullGrid::zeros(self.n);
        add_bending(x, T::from_f64(self.bending), &mut out);
        let gw = self.gradient_weight();
        for (spot, a, _) in &self.data {
            let (v, g) = gather(&x.values, *spot, self.strides());
            scatter(
                &mut out.values,
                *spot,
                self.strides(),
                *a * v,
                g.map(|g| *a * gw * g),
            );
        }
        out
    }

    /// `∇f = -n` in world units is `-n/N` by cell coordinates.
    pub fn right_hand_side(&self) -> FullGrid<T> {
        let mut out = FullGrid::zeros(self.n);
        let gw = self.gradient_weight() / T::from_f64(self.n as f64);
        for (spot, a, normal) in &self.data {
            scatter(
                &mut out.values,
                *spot,
                self.strides(),
                T::zero(),
                normal.map(|n| -*a * gw * n),
            );
        }
        out
    }

    /// The inverse of each entry of the diagonal.
    pub fn inverse_diagonal(&self) -> Vec<T> {
        let m = self.n + 3;
        let mut out = FullGrid::zeros(self.n);
        let gw = self.gradient_weight();
        for (spot, a, _) in &self.data {
            scatter_squares(&mut out.values, *spot, self.strides(), *a, [*a * gw; 3]);
        }
        let mut slot = out.values.iter_mut();
        for x in 0..m {
            for y in 0..m {
                for z in 0..m {
                    let d = slot.next().expect("m³ slots");
                    *d = T::one() / (*d + T::from_f64(self.bending * bending_diagonal(m, [x, y, z])));
                }
            }
        }
        out.values
    }
}

impl Operator<f64> {
    /// The operator as a dense matrix, for the coarsest level.
    pub fn dense(&self) -> DMatrix<f64> {
        let m = self.n + 3;
        let mut matrix = DMatrix::zeros(m * m * m, m * m * m);
        let gw = self.gradient_weight();
        for (spot, a, _) in &self.data {
            let w = spot.t.map(bspline::cubic::values::<f64>);
            let d = spot.t.map(bspline::cubic::first::<f64>);
            // Value and slopes of the 64 functions, and where they stand.
            let mut rows = [[0.0; 64]; 4];
            let mut at = [0; 64];
            for i in 0..64 {
                let (x, y, z) = (i / 16, i / 4 % 4, i % 4);
                at[i] = spot.start + (x * m + y) * m + z;
                rows[0][i] = w[0][x] * w[1][y] * w[2][z];
                rows[1][i] = gw.sqrt() * d[0][x] * w[1][y] * w[2][z];
                rows[2][i] = gw.sqrt() * w[0][x] * d[1][y] * w[2][z];
                rows[3][i] = gw.sqrt() * w[0][x] * w[1][y] * d[2][z];
            }
            for j in 0..64 {
                let mut column = [0.0; 64];
                for row in &rows {
                    for i in j..64 {
                        column[i] += row[i] * row[j];
                    }
                }
                for i in j..64 {
                    matrix[(at[i], at[j])] += a * column[i];
                }
            }
        }
        let place = |i: usize| [i / (m * m), i / m % m, i % m];
        for column in 0..m * m * m {
            for row in column..m * m * m {
                matrix[(row, column)] += self.bending * bending_entry(m, place(row), place(column));
            }
        }
        matrix
    }
}

/// The operator with a preconditioner.
struct Preconditioned<'a, P> {
    operator: &'a Operator<f64>,
    precondition: P,
}

impl<P: Fn(&FullGrid<f64>) -> FullGrid<f64>> System for Preconditioned<'_, P> {
    type Vector = FullGrid<f64>;

    fn apply(&mut self, p: &FullGrid<f64>, image: &mut FullGrid<f64>) {
        *image = self.operator.apply(p);
    }

    fn precondition(&mut self, r: &FullGrid<f64>, z: &mut FullGrid<f64>) -> f64 {
        *z = (self.precondition)(r);
        self.dot(r, z)
    }

    fn dot(&self, a: &FullGrid<f64>, b: &FullGrid<f64>) -> f64 {
        a.values.iter().zip(&b.values).map(|(a, b)| a * b).sum()
    }

    fn add(&self, y: &mut FullGrid<f64>, a: f64, x: &FullGrid<f64>) {
        for (y, x) in y.values.iter_mut().zip(&x.values) {
            *y += a * x;
        }
    }

    fn turn(&self, p: &mut FullGrid<f64>, b: f64, z: &FullGrid<f64>) {
        for (p, z) in p.values.iter_mut().zip(&z.values) {
            *p = z + b * *p;
        }
    }
}

impl Operator<f64> {
    /// Solves the normal equations from `x`, until the residual is `tolerance` of that of the zero field, or for `limit`
    /// iterations.
    pub fn solve(
        &self,
        x: &mut FullGrid<f64>,
        precondition: impl Fn(&FullGrid<f64>) -> FullGrid<f64>,
        tolerance: f64,
        limit: usize,
    ) -> SolverOutcome {
        let mut system = Preconditioned {
            operator: self,
            precondition,
        };
        let mut r = self.right_hand_side();
        let mut z = FullGrid::zeros(self.n);
        let against = system.precondition(&r, &mut z);
        system.add(&mut r, -1.0, &self.apply(x));
        let stop = Stop {
            residual: tolerance,
            against: Some(against),
            limit,
        };
        let outcome =
            conjugate_gradients(&mut system, x, r, stop, |_| Ok(())).expect("nothing here can be cancelled");
        SolverOutcome {
            depth: Some(self.n.ilog2() as usize),
            ..outcome
        }
    }
}
