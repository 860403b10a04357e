//! What painted matter is solved with: the factor, cycle or multigrid that the size of the lattice asks for.

use std::sync::Arc;

use bspline::Real;

use super::background::Background;
use super::band_cholesky::BandCholesky;
use super::fast_diagonalization::FastDiagonalization;
use super::galerkin::Galerkin;
use super::pcg::Preconditioner;
use super::report::{Method, SolverOptions};
use super::sample_multigrid::SampleMultigrid;
use super::v_cycle::VCycle;
use crate::lattice::Lattice;
use crate::sparse::{Mask, MaskedSolver};
use crate::springs::StepMatrix;

/// Made when the first painted matrix comes.
#[derive(Clone, Debug)]
pub(super) enum Painted<T> {
    None,
    Direct(Box<(Galerkin, BandCholesky<T>)>),
    Background(Box<Background<T>>),
    VCycle(Box<VCycle<T>>),
    SampleDirect(BandCholesky<T>),
    SampleMultigrid(Box<SampleMultigrid<T>>),
    Masked(Box<MaskedSolver<T>>),
}

impl<T: Real> Painted<T> {
    /// What the size of a lattice and the options ask for.
    pub fn new(
        lattice: &Lattice<T>,
        steps: &[[isize; 3]],
        options: &SolverOptions,
        mask: Option<&Arc<Mask>>,
    ) -> Self {
        if let Some(mask) = mask {
            let (way, cycle) = (options.masked, options.v_cycle);
            return Self::Masked(Box::new(MaskedSolver::new(
                lattice,
                mask.clone(),
                steps,
                way,
                cycle,
            )));
        }
        let [_, my, mz] = lattice.sample_dims();
        let (n, m) = (lattice.coefficient_count(), lattice.sample_count());
        match options.method(false, n, lattice.is_square()) {
            Method::SampleDirect => Self::SampleDirect(BandCholesky::new(m, ((my + 1) * mz + 1).min(m - 1))),
            Method::SampleMultigrid => {
                Self::SampleMultigrid(Box::new(SampleMultigrid::new(lattice.sample_dims())))
            }
            Method::Direct => {
                let galerkin = Galerkin::new(lattice, steps);
                let factor = BandCholesky::new(n, galerkin.band());
                Self::Direct(Box::new((galerkin, factor)))
            }
            _ if n <= options.background_limit => {
                Self::Background(Box::new(Background::new(lattice, steps, options.v_cycle)))
            }
            _ => Self::VCycle(Box::new(VCycle::new(lattice, steps, options.v_cycle))),
        }
    }

    /// The cycle that solves, if one does.
    pub fn cycle(&mut self) -> Option<&mut VCycle<T>> {
        match self {
            Self::Background(background) => background.solving_cycle(),
            Self::VCycle(cycle) => Some(cycle),
            _ => None,
        }
    }

    /// Whether the smoother of a cycle solves, alone.
    pub fn is_smoothed(&self) -> bool {
        match self {
            Self::Background(background) => background.is_smoothed(),
            Self::VCycle(cycle) => cycle.is_alone(),
            _ => false,
        }
    }

    /// Whether a factor would be begun now, were the cycle not quick.
    pub fn is_in_place_of_a_factor(&self) -> bool {
        matches!(self, Self::Background(background) if background.is_ready())
    }

    /// The factor on the coefficients, if there is one, and what assembles it.
    pub fn factor(&mut self) -> Option<(&mut Galerkin, &mut BandCholesky<T>)> {
        match self {
            Self::Direct(direct) => Some((&mut direct.0, &mut direct.1)),
            Self::Background(background) => Some(background.made()),
            _ => None,
        }
    }
}

/// What the matrix was prepared with.
pub(super) fn active<'a, T: Real>(
    method: Method,
    painted: &'a mut Painted<T>,
    diagonalization: &'a mut FastDiagonalization<T>,
) -> &'a mut dyn Preconditioner<T> {
    match (method, painted) {
        (_, Painted::Masked(masked)) => &mut **masked,
        (Method::Direct, Painted::Direct(direct)) => &mut direct.1,
        (Method::Direct | Method::VCycle, Painted::Background(background)) => &mut **background,
        (Method::VCycle, Painted::VCycle(cycle)) => &mut **cycle,
        (Method::SampleDirect, Painted::SampleDirect(factor)) => factor,
        (Method::SampleMultigrid, Painted::SampleMultigrid(multigrid)) => &mut **multigrid,
        _ => diagonalization,
    }
}

/// A preconditioner behind a pointer.
pub(super) struct Dynamic<'a, T: Real>(pub &'a mut dyn Preconditioner<T>);

impl<T: Real> Preconditioner<T> for Dynamic<'_, T> {
    fn apply(&mut self, s: &StepMatrix<T>, r: &[T], z: &mut [T]) {
        self.0.apply(s, r, z);
    }

    fn factor(&self) -> Option<&BandCholesky<T>> {
        self.0.factor()
    }
}

/// Writes `S` itself into a band.
pub(super) fn fill_band<T: Real>(s: &StepMatrix<T>, into: &mut BandCholesky<T>) {
    into.clear();
    let [mx, my, mz] = s.dims();
    let mut diagonal: Vec<f64> = (0..mx * my * mz).map(|i| s.mass.at(i).as_f64()).collect();
    s.for_each_spring(|i, j, w, _| {
        let (i, j) = (i.min(j), i.max(j));
        diagonal[i] += w.as_f64();
        diagonal[j] += w.as_f64();
        into.set(j, i, -w.as_f64());
    });
    for (i, d) in diagonal.into_iter().enumerate() {
        into.set(i, i, d);
    }
}
