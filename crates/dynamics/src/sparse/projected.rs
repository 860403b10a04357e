use bspline::Real;

use super::Mask;
use crate::solve::{BandCholesky, System};

/// A system on the coefficients that a mask lets move, the others being 0.
pub(crate) struct Projected<'a, S> {
    pub system: S,
    pub mask: Option<&'a Mask>,
}

impl<T: Real, S: System<T>> System<T> for Projected<'_, S> {
    fn apply(&mut self, p: &[T], q: &mut [T]) -> f64 {
        let curvature = self.system.apply(p, q);
        if let Some(mask) = self.mask {
            mask.hold(q);
        }
        curvature
    }

    fn precondition(&mut self, r: &[T], z: &mut [T]) {
        self.system.precondition(r, z);
        if let Some(mask) = self.mask {
            mask.hold(z);
        }
    }

    fn factor(&self) -> Option<&BandCholesky<T>> {
        self.system.factor().filter(|_| self.mask.is_none())
    }

    fn moved(&mut self, alpha: T) {
        self.system.moved(alpha);
    }
}
