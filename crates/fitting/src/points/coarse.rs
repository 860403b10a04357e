//! The full coarse levels, 4³ to 32³ cells: where the sign far from the data is decided.
//!
//! Energy on a level of spacing `h` (unit box):
//! `Σ_k a_k [f(x_k)² + β²|∇f(x_k) + n_k|²] + μ' Σ [Σ_a (δ_aa C)² + 2 Σ_{a<b} (δ_ab C)²]`
//! with `a_k` from the [clusters](super::clusters), `β = max(h, β_s)`. No factor of the sample count appears,
//! so the balance is the same for a sparse and a dense scan; without that, false solids appear far away.

use bspline::Real;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::clusters::{Cluster, clusters, coarser, doubt_the_sparse};
use super::full_grid::{FullGrid, add_bending, bending_diagonal, bending_entry};
use super::samples::{BASE_DEPTH, Samples};
use super::stencil::{Spot, gather, scatter, scatter_squares};

/// Weight `μ'` of the bending energy. Far from the data only `μ'/(β/h)²` counts: 4e-4 was compared with 1e-3 and
/// 4e-3 on five draws of holes in one scan and on a thin scan; 1e-3 has the most right signs.
const BENDING: f64 = 1e-3;
/// Relative preconditioned residual at which the solves up to 16³ stop.
const TOLERANCE: f64 = 1e-3;
/// Iterations on 32³, on purpose too few to converge: they mend pockets near the data but leave the smooth
/// continuation of 16³ in holes (2 to 10 are alike, 25 lose a third of the accuracy in holes).
const BASE_ITERATIONS: usize = 5;

/// Coefficients of the 32³ level, distances in units of the box, positive inside. Under `suspicion` a half-cell that
/// holds fewer samples than most weighs less: what is left of the outliers lies in such.
pub(crate) fn solve(samples: &Samples, beta_s: f64, suspicion: bool) -> FullGrid<f64> {
    let mut by_depth = vec![clusters(samples, BASE_DEPTH)];
    for depth in (2..BASE_DEPTH).rev() {
        let finer = by_depth.last().expect("starts with one");
        by_depth.push(coarser(finer, depth));
    }
    by_depth.reverse();
    if suspicion {
        by_depth.iter_mut().for_each(|data| doubt_the_sparse(data));
    }
    let beta = |n: usize| (1.0 / n as f64).max(beta_s);
    let mut x = FullGrid::zeros(4);
    for (level, data) in by_depth.iter().enumerate().take(BASE_DEPTH - 2) {
        let n = 4usize << level;
        if level > 0 {
            x = x.refined();
        }
        let cycle = VCycle::new(&by_depth[..=level], beta(n));
        let top = Operator::<f64>::new(data, n, beta(n), 1.0, BENDING);
        conjugate_gradients(&top, &mut x, |r| cycle.apply(r), TOLERANCE, 60);
    }
    x = x.refined();
    let n = 1 << BASE_DEPTH;
    let top = Operator::<f64>::new(&by_depth[BASE_DEPTH - 2], n, beta(n), 1.0, BENDING);
    let inverse = top.inverse_diagonal();
    let jacobi = |r: &FullGrid<f64>| FullGrid {
        n: r.n,
        values: r.values.iter().zip(&inverse).map(|(r, d)| r * d).collect(),
    };
    conjugate_gradients(&top, &mut x, jacobi, 0.0, BASE_ITERATIONS);
    x
}

/// The normal equations of one full level.
struct Operator<T> {
    n: usize,
    beta: f64,
    bending: f64,
    data: Vec<(Spot<T>, T, [T; 3])>,
}

impl<T: Real> Operator<T> {
    fn new(clusters: &[Cluster], n: usize, beta: f64, data_scale: f64, bending: f64) -> Self {
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

    fn apply(&self, x: &FullGrid<T>) -> FullGrid<T> {
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
    fn right_hand_side(&self) -> FullGrid<T> {
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

    fn inverse_diagonal(&self) -> Vec<T> {
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
    fn dense(&self) -> DMatrix<f64> {
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
                    for i in 0..64 {
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

/// One symmetric multigrid cycle as preconditioner: the same energy on every coarser level, Chebyshev–Jacobi
/// smoothing, and a Cholesky factor on 4³. In single precision: what it gets wrong the iterations round it mend.
struct VCycle {
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
    fn new(clusters: &[Vec<Cluster>], beta: f64) -> Self {
        let mut dense = Self::operator::<f64>(clusters, 0, beta).dense();
        // The bending energy does not see linear functions; where data does not either, this does.
        let ridge = 1e-12 * dense.diagonal().max();
        for i in 0..dense.nrows() {
            dense[(i, i)] += ridge;
        }
        let bottom = Cholesky::new(dense).expect("normal equations with a ridge are positive definite");
        Self {
            bottom,
            levels: (1..clusters.len())
                .map(|l| Smoother::new(Self::operator(clusters, l, beta)))
                .collect(),
        }
    }

    fn operator<T: Real>(clusters: &[Vec<Cluster>], level: usize, beta: f64) -> Operator<T> {
        let ratio = (1u64 << (clusters.len() - 1 - level)) as f64;
        Operator::new(&clusters[level], 4 << level, beta, ratio * ratio, BENDING / ratio)
    }

    fn apply(&self, r: &FullGrid<f64>) -> FullGrid<f64> {
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

/// Preconditioned conjugate gradients on the normal equations, from `x`; stops when the preconditioned
/// residual is `tolerance` of the one of a zero start. Returns the iterations made.
fn conjugate_gradients(
    operator: &Operator<f64>,
    x: &mut FullGrid<f64>,
    precondition: impl Fn(&FullGrid<f64>) -> FullGrid<f64>,
    tolerance: f64,
    limit: usize,
) -> usize {
    let dot = |a: &FullGrid<f64>, b: &FullGrid<f64>| -> f64 {
        a.values.iter().zip(&b.values).map(|(a, b)| a * b).sum()
    };
    let mut r = operator.right_hand_side();
    let goal = if tolerance > 0.0 {
        tolerance * tolerance * dot(&r, &precondition(&r))
    } else {
        0.0
    };
    let image = operator.apply(x);
    for i in 0..r.values.len() {
        r.values[i] -= image.values[i];
    }
    let mut z = precondition(&r);
    let mut energy = dot(&r, &z);
    let mut p = z.clone();
    for iteration in 0..limit {
        if energy <= goal || energy == 0.0 {
            return iteration;
        }
        let image = operator.apply(&p);
        let curvature = dot(&p, &image);
        if curvature <= 0.0 {
            return iteration;
        }
        let alpha = energy / curvature;
        for i in 0..p.values.len() {
            x.values[i] += alpha * p.values[i];
            r.values[i] -= alpha * image.values[i];
        }
        z = precondition(&r);
        let next = dot(&r, &z);
        let beta = next / energy;
        energy = next;
        for i in 0..p.values.len() {
            p.values[i] = z.values[i] + beta * p.values[i];
        }
    }
    limit
}
