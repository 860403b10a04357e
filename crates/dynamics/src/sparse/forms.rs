use bspline::{Basis, Real};
use sprs::CsMat;

use crate::lattice::{Axis, Lattice};
use crate::patch::Patch;
use crate::springs::SpringWeights;

/// The collocation matrix `A` of a lattice, or those of its columns whose coefficients move.
#[derive(Clone, Debug)]
pub struct Sampling {
    a: CsMat<f64>,
    transposed: CsMat<f64>,
}

impl Sampling {
    /// Of the free coefficients with the given numbers, ascending; columns follow their order.
    ///
    /// # Panics
    /// If the numbers do not ascend or one is not that of a coefficient.
    pub fn new<T: Real>(lattice: &Lattice<T>, coefficients: &[usize]) -> Self {
        assert!(
            coefficients.windows(2).all(|c| c[0] < c[1]),
            "numbers of coefficients ascend"
        );
        let mut column = vec![usize::MAX; lattice.coefficient_count()];
        for (c, &i) in coefficients.iter().enumerate() {
            column[i] = c;
        }
        let rows: [Vec<Vec<(usize, f64)>>; 3] = lattice.axes().each_ref().map(axis_rows);
        let [_, ny, nz] = lattice.coefficient_dims();
        let (mut offsets, mut indices, mut data) = (vec![0], Vec::new(), Vec::new());
        for x in &rows[0] {
            for y in &rows[1] {
                for z in &rows[2] {
                    for (i, u) in x {
                        for (j, v) in y {
                            for (k, w) in z {
                                let c = column[(i * ny + j) * nz + k];
                                if c != usize::MAX {
                                    indices.push(c);
                                    data.push(u * v * w);
                                }
                            }
                        }
                    }
                    offsets.push(indices.len());
                }
            }
        }
        let a = CsMat::new(
            (lattice.sample_count(), coefficients.len()),
            offsets,
            indices,
            data,
        );
        let transposed = a.transpose_view().to_csr();
        Self { a, transposed }
    }

    /// Of all free coefficients.
    pub fn whole<T: Real>(lattice: &Lattice<T>) -> Self {
        Self::new(lattice, &(0..lattice.coefficient_count()).collect::<Vec<_>>())
    }

    /// `A`: a row per sample.
    pub fn matrix(&self) -> &CsMat<f64> {
        &self.a
    }

    /// `Aᵀ`: a row per coefficient.
    pub fn transposed(&self) -> &CsMat<f64> {
        &self.transposed
    }

    /// `AᵀSA` of a matrix `S` on the samples.
    pub fn galerkin(&self, s: &CsMat<f64>) -> CsMat<f64> {
        &self.transposed * &(s * &self.a)
    }
}

/// Weights of the free functions at each sample of an axis.
fn axis_rows(axis: &Axis) -> Vec<Vec<(usize, f64)>> {
    let free = axis.first_free()..axis.first_free() + axis.free_count();
    let row = |s: usize| {
        let basis: Basis<f64> = Basis::at(axis.knots(), axis.parameter(s), 0);
        let terms = basis.values().iter().enumerate();
        let terms = terms.map(|(j, w)| (basis.first() + j, *w));
        let moving = terms.filter(|(c, w)| free.contains(c) && *w != 0.0);
        moving.map(|(c, w)| (c - free.start, w)).collect()
    };
    (0..axis.sample_count()).map(row).collect()
}

/// `M̃`, `D̃` and `K̃` of a patch in its present state, on the coefficients.
///
/// `K̃` is the tangent: `σ²` times density and ground springs, of the 4-D law with `max(τ, 0)`, and the constraint springs.
/// Hard constraints are no part of it.
#[derive(Clone, Debug)]
pub struct SparseForms {
    /// `A`.
    pub sampling: Sampling,
    /// `M̃ = AᵀMA`.
    pub mass: CsMat<f64>,
    /// `D̃ = AᵀDA`.
    pub damping: CsMat<f64>,
    /// `K̃`.
    pub stiffness: CsMat<f64>,
}

impl SparseForms {
    /// `M̃ + aD̃ + bK̃`, the matrix of a step.
    pub fn step(&self, a: f64, b: f64) -> CsMat<f64> {
        let scaled = |m: &CsMat<f64>, factor: f64| m.map(|v| factor * v);
        &(&self.mass + &scaled(&self.damping, a)) + &scaled(&self.stiffness, b)
    }
}

impl<T: Real> Patch<T> {
    /// The forms of this patch, assembled.
    pub fn sparse_forms(&self) -> SparseForms {
        let lattice = self.lattice();
        let sampling = match self.mask() {
            Some(mask) => Sampling::new(lattice, mask.moving()),
            None => Sampling::whole(lattice),
        };
        let count = lattice.sample_count();
        let sigma2 = self.springs().law().scale().powi(2);
        let on_samples = |value: &dyn Fn(usize) -> f64| sampling.galerkin(&diagonal(count, value));
        let ground = self.exact_ground();
        let springs = laplacian(lattice.sample_dims(), &self.present_springs());
        let springs = &springs + &diagonal(count, |i| ground.at(i));
        let mut stiffness = sampling.galerkin(&springs.map(|v| sigma2 * v));
        let rows = self.constraint_springs();
        if !rows.is_empty() {
            let columns = sampling.matrix().cols();
            let column = |c: usize| self.mask().map_or(Some(c), |m| m.moving().binary_search(&c).ok());
            let mut pulled = sprs::TriMat::new((rows.len(), columns));
            for (r, (terms, weight)) in rows.iter().enumerate() {
                for (c, w) in *terms {
                    if let Some(c) = column(*c) {
                        pulled.add_triplet(r, c, weight.sqrt() * w);
                    }
                }
            }
            let pulled: CsMat<f64> = pulled.to_csr();
            let pulled = &pulled.transpose_view().to_csr() * &pulled;
            stiffness = &stiffness + &pulled;
        }
        SparseForms {
            mass: on_samples(&|i| self.material.lumped.mass.value(i)),
            damping: on_samples(&|i| self.material.lumped.damping.value(i)),
            stiffness,
            sampling,
        }
    }
}

/// `y = Mx` of a matrix of compressed rows.
///
/// # Panics
/// If a length is wrong.
pub fn multiply(m: &CsMat<f64>, x: &[f64], y: &mut [f64]) {
    y.fill(0.0);
    sprs::prod::mul_acc_mat_vec_csr(m.view(), x, y);
}

/// A diagonal matrix.
pub(super) fn diagonal(count: usize, value: impl Fn(usize) -> f64) -> CsMat<f64> {
    let data = (0..count).map(value).collect();
    CsMat::new((count, count), (0..=count).collect(), (0..count).collect(), data)
}

/// `Bᵀ diag(k) B` with the incidence `B`, a row per spring.
pub(super) fn laplacian(dims: [usize; 3], springs: &[SpringWeights<f64>]) -> CsMat<f64> {
    let count: usize = dims.iter().product();
    let number = |at: [usize; 3]| (at[0] * dims[1] + at[1]) * dims[2] + at[2];
    let (mut offsets, mut indices) = (vec![0], Vec::new());
    let (mut incidence, mut weighted) = (Vec::new(), Vec::new());
    for s in springs {
        for i in 0..count {
            let at = [i / dims[2] / dims[1], i / dims[2] % dims[1], i % dims[2]];
            let to: [usize; 3] = std::array::from_fn(|a| at[a].wrapping_add_signed(s.direction.step[a]));
            if (0..3).any(|a| to[a] >= dims[a]) {
                continue;
            }
            let j = number(to);
            let ends = if i < j {
                [(i, 1.0), (j, -1.0)]
            } else {
                [(j, -1.0), (i, 1.0)]
            };
            for (end, sign) in ends {
                indices.push(end);
                incidence.push(sign);
                weighted.push(sign * s.weights.at(i));
            }
            offsets.push(indices.len());
        }
    }
    let shape = (offsets.len() - 1, count);
    let b = CsMat::new(shape, offsets.clone(), indices.clone(), incidence);
    let kb = CsMat::new(shape, offsets, indices, weighted);
    &b.transpose_view().to_csr() * &kb
}
