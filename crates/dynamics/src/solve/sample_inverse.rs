//! From increments of densities to those of coefficients, where there are as many of both.

use bspline::Real;

use crate::lattice::{Lattice, TensorProduct, TensorWorkspace};

/// `A⁻¹` in double precision.
#[derive(Clone, Debug)]
pub(super) struct SampleInverse {
    product: TensorProduct<f64>,
    d: Vec<f64>,
    p: Vec<f64>,
    workspace: TensorWorkspace<f64>,
}

impl SampleInverse {
    pub fn new<T: Real>(lattice: &Lattice<T>) -> Self {
        let m = lattice.sample_count();
        Self {
            product: lattice.inverse(),
            d: vec![0.0; m],
            p: vec![0.0; m],
            workspace: TensorWorkspace::new(),
        }
    }

    /// `x = A⁻¹ dx`.
    pub fn apply<T: Real>(&mut self, dx: &[T], x: &mut [T]) {
        for (d, dx) in self.d.iter_mut().zip(dx) {
            *d = dx.as_f64();
        }
        self.product.apply(&self.d, &mut self.p, &mut self.workspace);
        for (x, p) in x.iter_mut().zip(&self.p) {
            *x = T::from_f64(*p);
        }
    }
}
