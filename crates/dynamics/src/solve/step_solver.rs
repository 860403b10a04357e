//! The methods that solve a step, behind one interface.

use std::sync::Arc;

use bspline::Real;

use super::band_cholesky::NotPositive;
use super::border::Border;
use super::fast_diagonalization::FastDiagonalization;
use super::painted::{Painted, active, fill_band};
use super::pcg::ConjugateGradients;
use super::renewal::{Renewal, Renewed};
use super::report::{Method, SolveError, SolverOptions};
use super::sample_inverse::SampleInverse;
use crate::lattice::{Lattice, SampleBox, TensorWorkspace};
use crate::sparse::{Mask, MaskedWay};
use crate::springs::StepMatrix;

/// Iterations with a factor, made for an earlier matrix, that cost as much as a V-cycle's.
const SLOW: usize = 2;
/// Slow solves in a row after which a factor is renewed: a single step of another length is not worth it.
const PATIENCE: usize = 4;

/// Solves `AᵀSA x = Aᵀg` on one lattice, by the method that its size, its sampling and the material ask for:
///
/// | lattice | constant material | painted |
/// | --- | --- | --- |
/// | as many coefficients as samples | fast diagonalization on the samples | factor (few) or multigrid on the samples, then `x = A⁻¹d` |
/// | up to `direct_limit` coefficients | fast diagonalization | banded Cholesky factor |
/// | up to `background_limit` | fast diagonalization | V-cycle, until a factor is made beside the steps |
/// | more | fast diagonalization | V-cycle |
#[derive(Clone, Debug)]
pub struct StepSolver<T> {
    pub(super) lattice: Lattice<T>,
    pub(super) options: SolverOptions,
    steps: Vec<[isize; 3]>,
    pub(super) method: Method,
    pub(super) diagonalization: FastDiagonalization<T>,
    pub(super) painted: Painted<T>,
    /// What `painted` was made for.
    pub(super) painted_for: Option<StepMatrix<T>>,
    /// Whether the solver was prepared since it began anew.
    pub(super) begun: bool,
    /// Slow solves in a row.
    pub(super) slow: usize,
    /// The factor that will take the place of the one at hand.
    pub(super) renewal: Option<Box<Renewal<T>>>,
    pub(super) inverse: Option<SampleInverse>,
    /// Which coefficients move, if not all.
    pub(super) mask: Option<Arc<Mask>>,
    pub(super) iteration: ConjugateGradients<T>,
    pub(super) border: Option<Box<Border<T>>>,
    factorizations: usize,
    pub(super) b: Vec<T>,
    pub(super) samples: [Vec<T>; 2],
    pub(super) workspace: TensorWorkspace<T>,
}

impl<T: Real> StepSolver<T> {
    /// For a lattice with springs of the given steps.
    pub fn new(lattice: Lattice<T>, steps: &[[isize; 3]], options: SolverOptions) -> Self {
        let m = lattice.sample_count();
        let square = lattice.is_square();
        let zeros = |n: usize| vec![T::zero(); n];
        Self {
            method: Method::FastDiagonalization,
            diagonalization: if square {
                FastDiagonalization::on_samples(lattice.sample_dims())
            } else {
                FastDiagonalization::new(&lattice)
            },
            painted: Painted::None,
            painted_for: None,
            begun: false,
            slow: 0,
            renewal: None,
            inverse: square.then(|| SampleInverse::new(&lattice)),
            mask: None,
            iteration: ConjugateGradients::new(lattice.coefficient_count()),
            border: None,
            factorizations: 0,
            b: zeros(lattice.coefficient_count()),
            samples: [zeros(m), zeros(m)],
            workspace: TensorWorkspace::new(),
            steps: steps.to_vec(),
            options,
            lattice,
        }
    }

    /// The lattice.
    pub fn lattice(&self) -> &Lattice<T> {
        &self.lattice
    }

    /// The limits.
    pub fn options(&self) -> SolverOptions {
        self.options
    }

    /// The method of the matrix that was prepared last.
    pub fn method(&self) -> Method {
        self.method
    }

    /// Makes ready for a matrix.
    ///
    /// What is there for the same matrix already serves on: a factor has the same bits whenever it is made. Of a factor
    /// that is made beside the steps the work goes on, but begins anew after [`begin_again`](Self::begin_again) and
    /// after constant material.
    ///
    /// # Errors
    /// [`SolveError`] if it is not positive definite.
    pub fn prepare(&mut self, s: &StepMatrix<T>) -> Result<(), SolveError> {
        // Springs across diagonals are no tensor product where the lattice ends.
        if s.is_uniform() && s.springs.len() == 3 && self.mask.is_none() {
            self.diagonalization.set_constant(s);
            self.method = Method::FastDiagonalization;
            self.begun = false;
            self.prepare_border(s);
            return Ok(());
        }
        if matches!(self.painted, Painted::None) {
            self.painted = Painted::new(&self.lattice, &self.steps, &self.options, self.mask.as_ref());
        }
        if self.painted_for.as_ref() != Some(s) {
            self.painted_for = None;
            self.forget_renewal();
            self.make(s)?;
            self.painted_for = Some(s.clone());
        } else if let (Painted::Background(background), false) = (&mut self.painted, self.begun) {
            background.begin_again(s)?;
        } else if let Some(cycle) = self.painted.cycle() {
            cycle.refresh(s)?;
        }
        self.begun = true;
        self.settle_method();
        self.prepare_border(s);
        Ok(())
    }

    /// Whether nothing that it was made for differs from a matrix, estimates of eigenvalues included.
    pub(crate) fn is_made_for(&mut self, s: &StepMatrix<T>) -> bool {
        let rough = self.painted.cycle().is_some_and(|c| c.is_rough());
        self.method == Method::FastDiagonalization || (self.painted_for.as_ref() == Some(s) && !rough)
    }

    /// Whether it can follow paint at the cost of the box.
    pub(crate) fn follows_paint(&self) -> bool {
        let follows = matches!(self.painted, Painted::Background(_) | Painted::VCycle(_));
        follows && self.begun && self.painted_for.is_some()
    }

    /// Follows a matrix that differs in a box of samples only from the one that it was prepared for, springs being counted
    /// where they start. A V-cycle does, at the cost of the box. A factor does not: it serves on as it is, or gives way to
    /// the V-cycle until it is made anew.
    ///
    /// # Errors
    /// [`SolveError`] if it is not positive definite.
    pub(crate) fn repaint(&mut self, s: &StepMatrix<T>, at: SampleBox) -> Result<(), SolveError> {
        if !self.follows_paint() {
            return Ok(());
        }
        let mut matrix = self.painted_for.take().expect("asked above");
        self.forget_renewal();
        match &mut self.painted {
            Painted::Background(background) => {
                let all = SampleBox::all(s.dims());
                let at = if background.is_stale() { all } else { at };
                matrix.copy_on(s, at);
                background.repaint(&matrix, at)?;
            }
            Painted::VCycle(cycle) => {
                matrix.copy_on(s, at);
                cycle.follow(&matrix, at)?;
            }
            _ => unreachable!("asked above"),
        }
        self.painted_for = Some(matrix);
        self.settle_method();
        self.renew_border();
        Ok(())
    }

    /// Makes factors and cycles for a matrix.
    fn make(&mut self, s: &StepMatrix<T>) -> Result<(), SolveError> {
        self.factorizations += 1;
        let made: Result<(), NotPositive> = match &mut self.painted {
            Painted::None => unreachable!("made before it is prepared"),
            Painted::Direct(direct) => {
                let (galerkin, factor) = &mut **direct;
                galerkin.factorize(s, factor)
            }
            Painted::Background(background) => background.prepare(s),
            Painted::VCycle(cycle) => cycle.prepare(s),
            Painted::SampleDirect(factor) => {
                fill_band(s, factor);
                factor.factorize()
            }
            Painted::SampleMultigrid(multigrid) => multigrid.prepare(s),
            Painted::Masked(masked) => return masked.prepare(s),
        };
        Ok(made?)
    }

    fn forget_renewal(&mut self) {
        self.renewal = None;
        self.slow = 0;
    }

    /// After a solve of `s` by a factor: when several in a row were slow, since it is of another matrix, one of `s` is made
    /// beside the next ones.
    pub(super) fn keep_up(&mut self, s: &StepMatrix<T>, iterations: usize) {
        let Some(mut renewal) = self.renewal.take() else {
            self.slow = if iterations > SLOW { self.slow + 1 } else { 0 };
            if let (true, Some((_, factor))) = (self.slow >= PATIENCE, self.painted.factor()) {
                self.factorizations += 1;
                self.renewal = Some(Box::new(Renewal::new(s.clone(), factor)));
            }
            return;
        };
        let Some((galerkin, factor)) = self.painted.factor() else {
            return;
        };
        match renewal.advance(galerkin) {
            Renewed::NotYet => self.renewal = Some(renewal),
            Renewed::Done => {
                self.painted_for = Some(renewal.finish(factor));
                if let Painted::Background(background) = &mut self.painted {
                    background.exchanged();
                }
                self.slow = 0;
                self.renew_border();
            }
            // The old one still solves.
            Renewed::Impossible => self.slow = 0,
        }
    }

    /// Forgets what was solved before, but for factors and cycles that would come out the same: after the next
    /// [`prepare`](Self::prepare) all bits are those of a new solver.
    pub(crate) fn begin_again(&mut self) {
        self.begun = false;
        self.border = None;
        self.forget_renewal();
    }

    /// Factors and cycles that were made so far, each of a background once.
    pub fn factorizations(&self) -> usize {
        self.factorizations
    }

    /// Fits the constraints to what solves now.
    pub(super) fn renew_border(&mut self) {
        if let Some(matrix) = self.painted_for.take() {
            self.prepare_border(&matrix);
            self.painted_for = Some(matrix);
        }
    }

    pub(super) fn prepare_border(&mut self, s: &StepMatrix<T>) {
        if let Some(border) = &mut self.border {
            let preconditioner = active(self.method, &mut self.painted, &mut self.diagonalization);
            let mask = self.mask.as_deref();
            // Under a mask a factor knows nothing of the other coefficients.
            match preconditioner.factor().filter(|_| mask.is_none()) {
                Some(factor) => border.prepare_halves(factor),
                None => border.prepare(|r, y| {
                    preconditioner.apply(s, r, y);
                    if let Some(mask) = mask {
                        mask.hold(y);
                    }
                }),
            }
        }
    }

    /// Constraints on the unknowns, which are the samples on a square lattice and the coefficients on others; in force
    /// from the next [`prepare`](Self::prepare) on.
    pub(crate) fn set_border(&mut self, border: Option<Border<T>>) {
        self.border = border.map(Box::new);
    }

    /// The constraints.
    pub(crate) fn border_mut(&mut self) -> Option<&mut Border<T>> {
        self.border.as_deref_mut()
    }

    /// Lets only the coefficients of a mask move, all others being 0; in force from the next [`prepare`](Self::prepare) on.
    pub(crate) fn set_mask(&mut self, mask: Option<Arc<Mask>>) {
        self.mask = mask;
        self.painted = Painted::None;
        self.painted_for = None;
    }

    /// How a patch with this mask is solved by these options.
    pub(crate) fn masked_way(&self) -> Option<MaskedWay> {
        let mask = self.mask.as_deref()?;
        Some(self.options.masked.or_best(&self.lattice, mask))
    }

    /// Lets what belongs to coefficients that do not move be 0.
    pub(crate) fn hold(&self, list: &mut [T]) {
        if let Some(mask) = &self.mask {
            mask.hold(list);
        }
    }

    pub(super) fn settle_method(&mut self) {
        self.method = match &self.painted {
            Painted::None => Method::FastDiagonalization,
            Painted::Direct(_) => Method::Direct,
            Painted::Background(background) if background.is_done() => Method::Direct,
            Painted::Background(_) | Painted::VCycle(_) => Method::VCycle,
            Painted::SampleDirect(_) => Method::SampleDirect,
            Painted::SampleMultigrid(_) => Method::SampleMultigrid,
            Painted::Masked(masked) => masked.method(),
        };
    }

    /// Finishes a factor that is being made beside the steps: what some hundred steps would do.
    pub fn settle(&mut self) {
        if let (Painted::Background(background), Some(matrix), Method::VCycle) =
            (&mut self.painted, &self.painted_for, self.method)
        {
            background.finish(matrix);
            self.settle_method();
            self.renew_border();
        }
    }
}
