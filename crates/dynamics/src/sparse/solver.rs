//! The solver of patches that are no box, and which way it takes.

use std::sync::Arc;

use bspline::Real;
use serde::{Deserialize, Serialize};
use sprs::CsMat;

use super::factor::{NotDefinite, SparseCholesky};
use super::forms::{Sampling, laplacian, multiply};
use super::{Mask, nested_dissection};
use crate::lattice::Lattice;
use crate::solve::{
    BandCholesky, ConjugateGradients, Galerkin, Method, Preconditioner, SolveError, System, VCycle,
    VCycleOptions,
};
use crate::springs::{SpringWeights, StepMatrix};

/// Residual of the inner iteration of the sparse form.
const INNER: f64 = 1e-8;
/// Coefficients that move up to which they get a banded factor: its steps are faster than those of the cycle, which under a
/// contrast does not converge on a mask.
const BANDED: usize = 10_000;
/// Coefficients of the box up to which its sums along the axes, 3 kB each, are taken for that.
const SUMMED: usize = 40_000;
/// Coefficients that move up to which the sparse factor, which knows nothing of the box, is made in larger ones.
const FACTORIZED: usize = 4000;

/// Its most iterations.
const MOST_INNER: usize = 2000;

/// How a patch with a mask solves its steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum MaskedWay {
    /// The one that is expected to cost least.
    Best,
    /// The matrix assembled by sums along the axes, as that of the box is; a banded factor on the coefficients that move.
    Band,
    /// The sparse form, factorized in an order of nested dissection.
    SparseFactor,
    /// Conjugate gradients on the sparse form, scaled by its diagonal.
    SparseIteration,
    /// The V-cycle of the box, whose result is cut to the coefficients that move.
    Cycle,
}

impl MaskedWay {
    /// This one, or in place of [`Best`](Self::Best) the one that is expected to cost least, from what was measured
    /// (`docs/dynamics.md`).
    pub(crate) fn or_best<T: Real>(self, lattice: &Lattice<T>, mask: &Mask) -> Self {
        let moving = mask.moving().len();
        match self {
            Self::Best if moving <= BANDED && lattice.coefficient_count() <= SUMMED => Self::Band,
            Self::Best if moving <= FACTORIZED => Self::SparseFactor,
            Self::Best => Self::Cycle,
            other => other,
        }
    }
}

/// An approximate inverse of the matrix of a step on the coefficients that move.
#[derive(Clone, Debug)]
pub(crate) struct MaskedSolver<T> {
    mask: Arc<Mask>,
    way: Way<T>,
    /// What lies on the coefficients that move.
    x: Vec<f64>,
}

#[derive(Clone, Debug)]
enum Way<T> {
    Band(Box<(Galerkin, BandCholesky<T>)>, Vec<T>),
    Sparse(Box<Sparse>),
    Cycle(Box<VCycle<T>>),
}

/// The sparse form and what solves with it.
#[derive(Clone, Debug)]
struct Sparse {
    sampling: Sampling,
    places: Vec<[usize; 3]>,
    inverse: Inverse,
}

#[derive(Clone, Debug)]
enum Inverse {
    None,
    Factor(Box<SparseCholesky>),
    Iteration(Box<Iteration>),
}

#[derive(Clone, Debug)]
struct Iteration {
    h: CsMat<f64>,
    diagonal: Vec<f64>,
    cg: ConjugateGradients<f64>,
    b: Vec<f64>,
}

impl System<f64> for (&CsMat<f64>, &[f64]) {
    fn apply(&mut self, p: &[f64], q: &mut [f64]) -> f64 {
        multiply(self.0, p, q);
        crate::solve::dot(p, q)
    }
    fn precondition(&mut self, r: &[f64], z: &mut [f64]) {
        for ((z, r), d) in z.iter_mut().zip(r).zip(self.1) {
            *z = r / d;
        }
    }
}

fn places<T: Real>(lattice: &Lattice<T>, numbers: &[usize]) -> Vec<[usize; 3]> {
    let [_, ny, nz] = lattice.coefficient_dims();
    let place = |i: &usize| [i / nz / ny, i / nz % ny, i % nz];
    numbers.iter().map(place).collect()
}

/// Half-bandwidth of the coefficients that move, numbered in order: how many of them lie from one to the last that it
/// shares a spring with.
fn half_band(places: &[[usize; 3]], reach: [usize; 3]) -> usize {
    let key = |p: &[usize; 3]| (p[0], p[1], p[2]);
    let last = |i: usize| {
        let p = places[i];
        let end = [p[0] + reach[0], p[1] + reach[1], p[2] + reach[2]];
        let from = places.partition_point(|q| key(q) <= key(&end));
        // The last before the end that is near along all axes.
        let near = |q: &[usize; 3]| (0..3).all(|a| q[a].abs_diff(p[a]) <= reach[a]);
        (i..from).rev().find(|&j| near(&places[j])).unwrap_or(i) - i
    };
    (0..places.len()).map(last).max().unwrap_or(0)
}

impl<T: Real> MaskedSolver<T> {
    /// For a lattice with springs of the given steps.
    pub fn new(
        lattice: &Lattice<T>,
        mask: Arc<Mask>,
        steps: &[[isize; 3]],
        way: MaskedWay,
        v_cycle: VCycleOptions,
    ) -> Self {
        let places = places(lattice, mask.moving());
        let way = way.or_best(lattice, &mask);
        let count = places.len();
        let way = match way {
            MaskedWay::Band | MaskedWay::Best => {
                let galerkin = Galerkin::new(lattice, steps);
                let band = half_band(&places, galerkin.reach());
                let factor = BandCholesky::new(count, band);
                Way::Band(Box::new((galerkin, factor)), vec![T::zero(); count])
            }
            MaskedWay::Cycle => Way::Cycle(Box::new(VCycle::new(lattice, steps, v_cycle))),
            MaskedWay::SparseFactor | MaskedWay::SparseIteration => Way::Sparse(Box::new(Sparse {
                sampling: Sampling::new(lattice, mask.moving()),
                places,
                inverse: match way {
                    MaskedWay::SparseFactor => Inverse::None,
                    _ => Inverse::Iteration(Box::new(Iteration {
                        h: CsMat::zero((count, count)),
                        diagonal: Vec::new(),
                        cg: ConjugateGradients::new(count),
                        b: vec![0.0; count],
                    })),
                },
            })),
        };
        Self {
            mask,
            way,
            x: vec![0.0; count],
        }
    }

    /// How it solves.
    pub fn method(&self) -> Method {
        match &self.way {
            Way::Band(..) => Method::Direct,
            Way::Cycle(_) => Method::VCycle,
            Way::Sparse(sparse) => match sparse.inverse {
                Inverse::Iteration(_) => Method::SparseIteration,
                _ => Method::SparseDirect,
            },
        }
    }

    /// Makes ready for a matrix.
    ///
    /// # Errors
    /// [`SolveError`] if it is not positive definite.
    pub fn prepare(&mut self, s: &StepMatrix<T>) -> Result<(), SolveError> {
        match &mut self.way {
            Way::Band(made, _) => {
                let (galerkin, factor) = &mut **made;
                Ok(galerkin.factorize_part(s, self.mask.moving(), factor)?)
            }
            Way::Cycle(cycle) => Ok(cycle.prepare(s)?),
            Way::Sparse(sparse) => Ok(sparse.prepare(s)?),
        }
    }
}

impl Sparse {
    fn prepare<T: Real>(&mut self, s: &StepMatrix<T>) -> Result<(), NotDefinite> {
        let springs: Vec<_> = s.springs.iter().map(SpringWeights::convert).collect();
        let count = s.dims().iter().product();
        let mass = super::forms::diagonal(count, |i| s.mass.at(i).as_f64());
        let h = self.sampling.galerkin(&(&laplacian(s.dims(), &springs) + &mass));
        match &mut self.inverse {
            Inverse::Iteration(iteration) => {
                iteration.diagonal = (0..h.rows())
                    .map(|i| h.get(i, i).copied().unwrap_or(1.0))
                    .collect();
                iteration.h = h;
                Ok(())
            }
            Inverse::Factor(factor) => factor.factorize(&h),
            Inverse::None => {
                let mut factor = SparseCholesky::plan(&h, nested_dissection(&h, &self.places));
                factor.factorize(&h)?;
                self.inverse = Inverse::Factor(Box::new(factor));
                Ok(())
            }
        }
    }

    fn solve(&mut self, x: &mut [f64]) {
        match &mut self.inverse {
            Inverse::None => unreachable!("prepared before the first solve"),
            Inverse::Factor(factor) => factor.solve(x),
            Inverse::Iteration(iteration) => {
                let Iteration { h, diagonal, cg, b } = &mut **iteration;
                b.copy_from_slice(x);
                cg.solve(&mut (&*h, &diagonal[..]), b, x, MOST_INNER, INNER);
            }
        }
    }
}

impl<T: Real> Preconditioner<T> for MaskedSolver<T> {
    fn apply(&mut self, s: &StepMatrix<T>, r: &[T], z: &mut [T]) {
        let moving = self.mask.moving();
        match &mut self.way {
            Way::Cycle(cycle) => {
                cycle.apply(s, r, z);
                self.mask.hold(z);
            }
            Way::Band(made, x) => {
                for (x, &c) in x.iter_mut().zip(moving) {
                    *x = r[c];
                }
                made.1.solve(x);
                z.fill(T::zero());
                for (x, &c) in x.iter().zip(moving) {
                    z[c] = *x;
                }
            }
            Way::Sparse(sparse) => {
                for (x, &c) in self.x.iter_mut().zip(moving) {
                    *x = r[c].as_f64();
                }
                sparse.solve(&mut self.x);
                z.fill(T::zero());
                for (x, &c) in self.x.iter().zip(moving) {
                    z[c] = T::from_f64(*x);
                }
            }
        }
    }
}
