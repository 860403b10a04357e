//! What tests are held against.

use dynamics::lattice::{Lattice, TensorWorkspace};
use dynamics::springs::StepMatrix;
use nalgebra::{DMatrix, DVector};

/// `AᵀSA` column by column.
pub fn dense(lattice: &Lattice<f64>, s: &StepMatrix<f64>) -> DMatrix<f64> {
    let (n, m) = (lattice.coefficient_count(), lattice.sample_count());
    let mut w = TensorWorkspace::new();
    let (mut d, mut q, mut column) = (vec![0.0; m], vec![0.0; m], vec![0.0; n]);
    let mut k = DMatrix::zeros(n, n);
    for j in 0..n {
        let mut e = vec![0.0; n];
        e[j] = 1.0;
        lattice.sample(&e, &mut d, &mut w);
        s.apply(&d, &mut q);
        lattice.gather(&q, &mut column, &mut w);
        k.set_column(j, &DVector::from_column_slice(&column));
    }
    k
}
