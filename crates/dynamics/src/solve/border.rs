//! Steps with constraint springs and hard constraints.
//!
//! `(H + RᵀER) x = b` under `Q x = g`, with rows of springs `R`, their weights `E`, and orthonormal rows `Q`. With
//! `B = [R; Q]` and a preconditioner `P` of `H`, the inverse of `P` with the same border is
//! `P⁻¹ - Y (BY + [E⁻¹, 0])⁻¹ BP⁻¹`, `Y = P⁻¹Bᵀ`. Conjugate gradients with it stay in the null space of `Q` and need as
//! many iterations as without constraints: one when `P = H`.

use bspline::Real;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::band_cholesky::BandCholesky;
use super::dot::dot;
use super::orthonormal::OrthonormalRows;
use super::pcg::{ConjugateGradients, PcgReport, System, add_scaled};

/// Share of the diagonal that is added to the small matrix of the border, from one try to the next, until it has a
/// factor: in single precision its small eigenvalues drown.
const SHIFT: f64 = 16.0;

/// Rows that border the matrix of a step.
#[derive(Clone, Debug)]
pub(crate) struct Border<T> {
    /// Unknowns.
    n: usize,
    springs: Vec<Vec<(usize, f64)>>,
    /// Whether the springs are part of the matrix, not of the right side alone.
    implicit: bool,
    /// `Q`.
    hard: OrthonormalRows,
    /// `E`, of an implicit border.
    weights: Vec<f64>,
    /// Impulse of each spring.
    pub impulses: Vec<f64>,
    /// `g`.
    pub gaps: Vec<f64>,
    /// `Y`, a row per row of the border; of a factor `L⁻¹Bᵀ`, so that `Y = L⁻ᵀ(L⁻¹Bᵀ)`.
    y: Vec<T>,
    /// Which of the two it is.
    halves: bool,
    /// `BY`, made symmetric.
    gram: DMatrix<f64>,
    factor: Option<Cholesky<f64, Dyn>>,
}

impl<T: Real> Border<T> {
    /// For `n` unknowns.
    pub fn new(n: usize, springs: Vec<Vec<(usize, f64)>>, implicit: bool, hard: OrthonormalRows) -> Self {
        let rows = hard.count() + if implicit { springs.len() } else { 0 };
        Self {
            implicit,
            weights: vec![0.0; springs.len()],
            impulses: vec![0.0; springs.len()],
            gaps: vec![0.0; hard.count()],
            y: vec![T::zero(); rows * n],
            halves: false,
            gram: DMatrix::zeros(rows, rows),
            factor: None,
            n,
            springs,
            hard,
        }
    }

    /// Rows of springs in the border.
    fn soft(&self) -> usize {
        if self.implicit { self.springs.len() } else { 0 }
    }

    fn rows(&self) -> usize {
        self.soft() + self.gaps.len()
    }

    /// Sets `E`.
    pub fn set_weights(&mut self, weights: impl Iterator<Item = f64>) {
        for (to, from) in self.weights.iter_mut().zip(weights) {
            if *to != from {
                *to = from;
                self.factor = None;
            }
        }
    }

    /// Size of the impulses and gaps.
    pub fn size(&self) -> f64 {
        let pushes = self.springs.iter().zip(&self.impulses).map(|(row, impulse)| {
            let weight = row.iter().fold(0.0_f64, |m, (_, w)| m.max(w.abs()));
            weight * impulse.abs()
        });
        pushes
            .chain(self.gaps.iter().map(|g| g.abs()))
            .fold(0.0, f64::max)
    }

    /// Multiplies impulses and gaps.
    pub fn scale(&mut self, factor: f64) {
        for v in self.impulses.iter_mut().chain(&mut self.gaps) {
            *v *= factor;
        }
    }

    /// `row·x` of a row of the border.
    fn row_times(&self, row: usize, x: &[T]) -> f64 {
        match row.checked_sub(self.soft()) {
            None => spring_value(&self.springs[row], x),
            Some(h) => self.hard.times(h, x),
        }
    }

    /// Takes the part along `Q` out.
    fn project(&self, x: &mut [T]) {
        self.hard.close(x, |_| 0.0);
    }

    /// Makes `Y` for a new `P`.
    pub fn prepare(&mut self, mut precondition: impl FnMut(&[T], &mut [T])) {
        self.halves = false;
        self.write_rows();
        let mut y = std::mem::take(&mut self.y);
        for y in y.chunks_exact_mut(self.n) {
            let r = y.to_vec();
            precondition(&r, y);
        }
        for (j, y) in y.chunks_exact(self.n).enumerate() {
            for i in 0..self.rows() {
                self.gram[(i, j)] = self.row_times(i, y);
            }
        }
        self.gram = 0.5 * (&self.gram + self.gram.transpose());
        self.y = y;
        self.factor = None;
    }

    /// The same for `P = LLᵀ`: makes `L⁻¹Bᵀ`, half the work, of which that before the first coefficient of a row is none.
    pub fn prepare_halves(&mut self, factor: &BandCholesky<T>) {
        self.halves = true;
        self.write_rows();
        let y = self.y.chunks_exact(self.n);
        let first = y.map(|y| y.iter().position(|v| *v != T::zero()).unwrap_or(self.n));
        let first: Vec<usize> = first.collect();
        factor.forward(&mut self.y, &first);
        for (i, a) in self.y.chunks_exact(self.n).enumerate() {
            for (j, b) in self.y.chunks_exact(self.n).enumerate().take(i + 1) {
                let product = dot(a, b);
                self.gram[(i, j)] = product;
                self.gram[(j, i)] = product;
            }
        }
        self.factor = None;
    }

    /// Writes `B` where `Y` will be.
    fn write_rows(&mut self) {
        self.y.fill(T::zero());
        let soft = self.soft();
        for (row, y) in self.y.chunks_exact_mut(self.n).enumerate() {
            match row.checked_sub(soft) {
                None => {
                    for (i, w) in &self.springs[row] {
                        y[*i] = T::from_f64(*w);
                    }
                }
                Some(h) => {
                    for (q, i) in self.hard.row(h).iter().zip(&self.hard.columns) {
                        y[*i] = T::from_f64(*q);
                    }
                }
            }
        }
    }

    /// Factor of `BY + [E⁻¹, 0]`.
    fn factorize(&mut self) {
        if self.factor.is_some() || self.rows() == 0 {
            return;
        }
        let mut shift = 0.0;
        loop {
            let mut matrix = self.gram.clone();
            for i in 0..self.rows() {
                if i < self.soft() {
                    matrix[(i, i)] += 1.0 / self.weights[i];
                }
                matrix[(i, i)] += shift * self.gram[(i, i)].abs();
            }
            self.factor = Cholesky::new(matrix);
            // A border of numbers that are not finite has no factor at any shift.
            if self.factor.is_some() || shift > 1.0 {
                return;
            }
            shift = if shift == 0.0 {
                SHIFT * T::UNIT_ROUND_OFF
            } else {
                shift * SHIFT
            };
        }
    }

    /// `z += sign Y (BY + [E⁻¹, 0])⁻¹ a`, of halves `L⁻¹Y` in place of `Y`.
    fn add_border(&self, z: &mut [T], mut a: DVector<f64>, sign: f64) {
        if let Some(factor) = &self.factor {
            factor.solve_mut(&mut a);
            for (a, y) in a.iter().zip(self.y.chunks_exact(z.len())) {
                add_scaled(z, T::from_f64(sign * a), y);
            }
        }
    }

    /// Solves from `x` that fulfils the hard constraints; the residual is that within their null space.
    pub fn solve(
        &mut self,
        iteration: &mut ConjugateGradients<T>,
        system: &mut impl System<T>,
        b: &[T],
        x: &mut [T],
        cap: usize,
        tolerance: f64,
    ) -> PcgReport {
        self.factorize();
        let ConjugateGradients { r, q, .. } = iteration;
        r.copy_from_slice(b);
        for (row, impulse) in self.springs.iter().zip(&self.impulses) {
            for (i, w) in row {
                r[*i] += T::from_f64(w * impulse);
            }
        }
        x.fill(T::zero());
        let mut size = dot(r, r).sqrt();
        if self.gaps.iter().any(|g| *g != 0.0) {
            let soft = self.soft();
            let wanted = DVector::from_fn(
                self.rows(),
                |i, _| if i < soft { 0.0 } else { self.gaps[i - soft] },
            );
            self.add_border(x, wanted, 1.0);
            if let (true, Some(factor)) = (self.halves, system.factor()) {
                factor.backward(x);
            }
            self.hard.close(x, |h| self.gaps[h]);
            self.apply(system, x, q);
            add_scaled(r, -T::one(), q);
            size += dot(q, q).sqrt();
        }
        self.project(r);
        let impulse = dot(r, r).sqrt();
        // What is left then is the rounding of forces that the constraints bear.
        if impulse <= 16.0 * T::UNIT_ROUND_OFF * size {
            return PcgReport::default();
        }
        let mut bordered = Bordered { border: self, system };
        let report = iteration.go_on(&mut bordered, x, [impulse, 1.0], cap, tolerance);
        self.hard.close(x, |h| self.gaps[h]);
        report
    }

    /// `q = (H + RᵀER) p`; returns `pᵀq`.
    fn apply(&self, system: &mut impl System<T>, p: &[T], q: &mut [T]) -> f64 {
        let mut curvature = system.apply(p, q);
        if self.implicit {
            for (row, weight) in self.springs.iter().zip(&self.weights) {
                curvature += add_spring(row, *weight, p, q);
            }
        }
        curvature
    }
}

/// A system with its border, in the null space of `Q`.
struct Bordered<'a, T, S> {
    border: &'a Border<T>,
    system: &'a mut S,
}

impl<T: Real, S: System<T>> System<T> for Bordered<'_, T, S> {
    fn apply(&mut self, p: &[T], q: &mut [T]) -> f64 {
        self.border.apply(self.system, p, q)
    }

    fn precondition(&mut self, r: &[T], z: &mut [T]) {
        let border = self.border;
        if let (true, Some(factor)) = (border.halves, self.system.factor()) {
            z.copy_from_slice(r);
            factor.forward(z, &[0]);
            let rows = border.y.chunks_exact(border.n);
            let along = DVector::from_iterator(border.rows(), rows.map(|y| dot(y, z)));
            border.add_border(z, along, -1.0);
            factor.backward(z);
            border.project(z);
            return;
        }
        self.system.precondition(r, z);
        let along = DVector::from_fn(border.rows(), |i, _| border.row_times(i, z));
        border.add_border(z, along, -1.0);
        border.project(z);
    }

    fn project(&self, r: &mut [T]) {
        self.border.project(r);
    }

    fn is_flexible(&self) -> bool {
        true
    }
}

/// `row·x`.
pub(crate) fn spring_value<T: Real>(row: &[(usize, f64)], x: &[T]) -> f64 {
    row.iter().map(|(i, w)| w * x[*i].as_f64()).sum()
}

/// `q += weight row (row·p)`; returns what that adds to `pᵀq`.
pub(crate) fn add_spring<T: Real>(row: &[(usize, f64)], weight: f64, p: &[T], q: &mut [T]) -> f64 {
    let along = spring_value(row, p);
    for (i, w) in row {
        q[*i] += T::from_f64(weight * along * w);
    }
    weight * along * along
}
