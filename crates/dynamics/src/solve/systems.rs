//! The systems of a step beside that on the coefficients.

use bspline::Real;

use super::band_cholesky::BandCholesky;
use super::dot::dot;
use super::pcg::{CoefficientSystem, Preconditioner, System, add_scaled};
use crate::springs::StepMatrix;

/// `S` on the samples.
pub(super) struct SampleSystem<'a, T, P> {
    pub matrix: &'a StepMatrix<T>,
    pub preconditioner: &'a mut P,
}

impl<T: Real, P: Preconditioner<T>> System<T> for SampleSystem<'_, T, P> {
    fn apply(&mut self, p: &[T], q: &mut [T]) -> f64 {
        self.matrix.apply(p, q);
        dot(p, q)
    }
    fn precondition(&mut self, r: &[T], z: &mut [T]) {
        self.preconditioner.apply(self.matrix, r, z);
    }
    fn factor(&self) -> Option<&BandCholesky<T>> {
        self.preconditioner.factor()
    }
}

/// Sums the solution on the samples from what the iteration samples anyway.
pub(super) struct Sampled<'a, 'b, T, P> {
    pub system: CoefficientSystem<'a, T, P>,
    pub dx: &'b mut [T],
}

impl<T: Real, P: Preconditioner<T>> System<T> for Sampled<'_, '_, T, P> {
    fn apply(&mut self, p: &[T], q: &mut [T]) -> f64 {
        self.system.apply(p, q)
    }
    fn precondition(&mut self, r: &[T], z: &mut [T]) {
        self.system.precondition(r, z);
    }
    fn factor(&self) -> Option<&BandCholesky<T>> {
        self.system.factor()
    }
    fn moved(&mut self, alpha: T) {
        add_scaled(self.dx, alpha, &self.system.samples[0]);
    }
}
