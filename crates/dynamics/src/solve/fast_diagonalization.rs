//! Fast diagonalization: the exact inverse of a constant material on a tensor-product lattice \[Lynch64\].

use bspline::Real;
use bspline::vectorized;
use nalgebra::{Cholesky, DMatrix, SymmetricEigen};

use super::pcg::Preconditioner;
use crate::lattice::{Banded, DenseAxis, Lattice, PAD, multiply, multiply_last, transposed_product};
use crate::springs::StepMatrix;

/// `z = s∘(V⊗V⊗V) [ (V⊗V⊗V)ᵀ(s∘r) / (a + b_x λ_i + b_y λ_j + b_z λ_k) ]` with, on each axis, `AᵀK₁A V = AᵀA V Λ`,
/// `VᵀAᵀAV = I` and `K₁` the path Laplacian of the samples.
#[derive(Clone, Debug)]
pub struct FastDiagonalization<T> {
    dims: [usize; 3],
    axes: [DenseAxis<T>; 3],
    eigenvalues: [Vec<f64>; 3],
    /// Inverse denominators, z padded.
    inverse: Vec<T>,
    scale: Vec<T>,
    ping: Vec<T>,
    pong: Vec<T>,
}

/// `V` and `Λ` of one axis.
fn pencil(a: &Banded<f64>) -> (DMatrix<f64>, Vec<f64>) {
    let d = a.differences().to_dense();
    let a = a.to_dense();
    let stiffness = transposed_product(&d, &d);
    let gram = transposed_product(&a, &a);
    let l = Cholesky::new(gram)
        .expect("axes are refused when their samples do not determine the coefficients")
        .unpack();
    let half = l.solve_lower_triangular(&stiffness).expect("positive diagonal");
    let whole = l
        .solve_lower_triangular(&half.transpose())
        .expect("positive diagonal");
    let eigen = SymmetricEigen::new((&whole + whole.transpose()) * 0.5);
    let v = l
        .transpose()
        .solve_upper_triangular(&eigen.eigenvectors)
        .expect("positive diagonal");
    // Rounding may leave the constant mode a hair below zero.
    (v, eigen.eigenvalues.iter().map(|&x| x.max(0.0)).collect())
}

impl<T: Real> FastDiagonalization<T> {
    /// The transforms of a lattice; [`set`](Self::set) gives the material.
    pub fn new(lattice: &Lattice<T>) -> Self {
        let pencils = std::array::from_fn(|a| pencil(&lattice.axes()[a].collocation()));
        Self::from_pencils(lattice.coefficient_dims(), pencils)
    }

    /// The same on samples without splines, `A` the identity.
    pub fn on_samples(dims: [usize; 3]) -> Self {
        let identity = |m: usize| Banded::from_rows(m, (0..m).map(|i| [(i, 1.0)]));
        Self::from_pencils(dims, dims.map(|m| pencil(&identity(m))))
    }

    fn from_pencils(dims: [usize; 3], pencils: [(DMatrix<f64>, Vec<f64>); 3]) -> Self {
        let padded = dims[0] * dims[1] * dims[2].next_multiple_of(PAD);
        let mut out = Self {
            dims,
            axes: std::array::from_fn(|a| DenseAxis::new(&pencils[a].0)),
            eigenvalues: pencils.map(|p| p.1),
            inverse: vec![T::zero(); padded],
            scale: vec![T::one(); dims.iter().product()],
            ping: vec![T::zero(); padded],
            pong: vec![T::zero(); padded],
        };
        out.set(1.0, [1.0; 3]);
        out
    }

    /// The material: `a` of each sample, `b` of each spring along x, y and z.
    pub fn set(&mut self, a: f64, b: [f64; 3]) {
        let [nx, ny, nz] = self.dims;
        let pad = nz.next_multiple_of(PAD);
        for i in 0..nx {
            for j in 0..ny {
                let plane = a + b[0] * self.eigenvalues[0][i] + b[1] * self.eigenvalues[1][j];
                let row = &mut self.inverse[(i * ny + j) * pad..][..nz];
                for (v, e) in row.iter_mut().zip(&self.eigenvalues[2]) {
                    *v = T::from_f64(1.0 / (plane + b[2] * e));
                }
            }
        }
    }

    /// The material of a matrix of constant weights.
    pub fn set_constant(&mut self, s: &StepMatrix<T>) {
        let mut along = [0.0; 3];
        for spring in &s.springs {
            for (a, step) in along.iter_mut().zip(spring.direction.step) {
                *a += spring.weights.at(0).as_f64() * (step * step) as f64;
            }
        }
        self.set(s.mass.at(0).as_f64(), along);
        self.scale.fill(T::one());
    }

    /// The scaling `s`, one number per coefficient, to be written in place.
    pub fn scale_mut(&mut self) -> &mut [T] {
        &mut self.scale
    }

    /// `z` from `r`.
    ///
    /// # Panics
    /// If a length is wrong.
    pub fn apply(&mut self, r: &[T], z: &mut [T]) {
        let [nx, ny, nz] = self.dims;
        let pad = nz.next_multiple_of(PAD);
        assert_eq!(r.len(), nx * ny * nz, "coefficients");
        assert_eq!(z.len(), r.len(), "coefficients");
        let (ping, pong) = (&mut self.ping[..], &mut self.pong[..]);
        let ([x, y, zed], inverse, scale) = (&self.axes, &self.inverse, &self.scale);
        vectorized(
            #[inline(always)]
            || {
                let rows = r.chunks_exact(nz).zip(scale.chunks_exact(nz));
                for ((r, s), p) in rows.zip(ping.chunks_exact_mut(pad)) {
                    for k in 0..nz {
                        p[k] = r[k] * s[k];
                    }
                    p[nz..].fill(T::zero());
                }
                multiply(&x.transposed, ping, pong, nx, nx, ny * pad);
                for (a, b) in pong.chunks_exact(ny * pad).zip(ping.chunks_exact_mut(ny * pad)) {
                    multiply(&y.transposed, a, b, ny, ny, pad);
                }
                // Along z a line is multiplied from the right, so the untransposed matrix gives Vᵀ.
                multiply_last(ping, pad, &zed.matrix_padded, pong, nz, pad);
                for (v, i) in pong.iter_mut().zip(inverse) {
                    *v *= *i;
                }
                multiply_last(pong, pad, &zed.transposed_padded, ping, nz, pad);
                for (a, b) in ping.chunks_exact(ny * pad).zip(pong.chunks_exact_mut(ny * pad)) {
                    multiply(&y.matrix, a, b, ny, ny, pad);
                }
                multiply(&x.matrix, pong, ping, nx, nx, ny * pad);
                let rows = z.chunks_exact_mut(nz).zip(scale.chunks_exact(nz));
                for ((z, s), p) in rows.zip(ping.chunks_exact(pad)) {
                    for k in 0..nz {
                        z[k] = p[k] * s[k];
                    }
                }
            },
        );
    }
}

impl<T: Real> Preconditioner<T> for FastDiagonalization<T> {
    fn apply(&mut self, _: &StepMatrix<T>, r: &[T], z: &mut [T]) {
        FastDiagonalization::apply(self, r, z);
    }
}
