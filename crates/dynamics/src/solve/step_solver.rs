//! The methods that solve a step, behind one interface.

use std::sync::Arc;

use bspline::Real;

use super::band_cholesky::NotPositive;
use super::border::Border;
use super::fast_diagonalization::FastDiagonalization;
use super::painted::{Dynamic, Painted, active, fill_band};
use super::pcg::{CoefficientSystem, ConjugateGradients, PcgReport};
use super::renewal::{Renewal, Renewed};
use super::report::{ITERATED, Method, SolveError, SolveReport, SolverOptions};
use super::systems::{SampleSystem, Sampled};
use crate::lattice::{Lattice, SampleBox, TensorProduct, TensorWorkspace};
use crate::sparse::{Mask, MaskedWay, Projected};
use crate::springs::StepMatrix;
use crate::units::{binary_unit, largest};

/// Residual, in units of rounding of single precision, at which solves by a factor stop.
const EXACT: f64 = 64.0;

/// The same of fast diagonalization. On coefficients the residual is mostly that of combinations that hardly move a
/// sample: one iteration leaves up to 2000 units of it in single precision, and increments of the samples that are wrong
/// by a few units.
const DIAGONALIZED: f64 = 4096.0;

/// Iterations with a factor, made for an earlier matrix, that cost as much as a V-cycle's.
const SLOW: usize = 2;
/// Slow solves in a row after which a factor is renewed: a single step of another length is not worth it.
const PATIENCE: usize = 4;

/// Most iterations of a solve that is asked for more than a step needs.
const MOST_ITERATIONS: usize = 64;

/// Impulses whose squares, and those of their residuals, are far from the ends of the range of single precision.
const ORDINARY: std::ops::Range<f64> = 1e-6..1e12;

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
    lattice: Lattice<T>,
    options: SolverOptions,
    steps: Vec<[isize; 3]>,
    method: Method,
    diagonalization: FastDiagonalization<T>,
    pub(super) painted: Painted<T>,
    /// What `painted` was made for.
    pub(super) painted_for: Option<StepMatrix<T>>,
    /// Whether the solver was prepared since it began anew.
    pub(super) begun: bool,
    /// Slow solves in a row.
    pub(super) slow: usize,
    /// The factor that will take the place of the one at hand.
    pub(super) renewal: Option<Box<Renewal<T>>>,
    inverse: Option<SampleInverse>,
    /// Which coefficients move, if not all.
    mask: Option<Arc<Mask>>,
    iteration: ConjugateGradients<T>,
    pub(super) border: Option<Box<Border<T>>>,
    factorizations: usize,
    b: Vec<T>,
    samples: [Vec<T>; 2],
    workspace: TensorWorkspace<T>,
}

/// `A⁻¹` in double precision.
#[derive(Clone, Debug)]
struct SampleInverse {
    product: TensorProduct<f64>,
    d: Vec<f64>,
    p: Vec<f64>,
    workspace: TensorWorkspace<f64>,
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
            inverse: square.then(|| SampleInverse {
                product: lattice.inverse(),
                d: vec![0.0; m],
                p: vec![0.0; m],
                workspace: TensorWorkspace::new(),
            }),
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
        }
        self.begun = true;
        self.settle_method();
        self.prepare_border(s);
        Ok(())
    }

    /// Whether nothing that it was made for differs from a matrix.
    pub(crate) fn is_made_for(&self, s: &StepMatrix<T>) -> bool {
        self.method == Method::FastDiagonalization || self.painted_for.as_ref() == Some(s)
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
                cycle.fit(&matrix, at)?;
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
    fn keep_up(&mut self, s: &StepMatrix<T>, iterations: usize) {
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
    fn renew_border(&mut self) {
        if let Some(matrix) = self.painted_for.take() {
            self.prepare_border(&matrix);
            self.painted_for = Some(matrix);
        }
    }

    pub(super) fn prepare_border(&mut self, s: &StepMatrix<T>) {
        if let Some(border) = &mut self.border {
            let preconditioner = active(self.method, &mut self.painted, &mut self.diagonalization);
            let mask = self.mask.as_deref();
            border.prepare(|r, z| {
                preconditioner.apply(s, r, z);
                if let Some(mask) = mask {
                    mask.hold(z);
                }
            });
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

    /// The increment `x` of the coefficients and `dx = A x` of the densities under the impulses `g` on the samples, for
    /// the matrix prepared last or one near it.
    ///
    /// # Panics
    /// If a length is wrong.
    pub fn solve(&mut self, s: &StepMatrix<T>, g: &[T], x: &mut [T], dx: &mut [T]) -> SolveReport {
        self.solve_to(s, g, x, dx, None)
    }

    /// The same to a residual, if one is asked for; in more iterations than steps take if it is less than theirs.
    pub(crate) fn solve_to(
        &mut self,
        s: &StepMatrix<T>,
        g: &[T],
        x: &mut [T],
        dx: &mut [T],
        asked: Option<f64>,
    ) -> SolveReport {
        let usual = self.tolerance();
        let (tolerance, cap) = match asked {
            Some(asked) if asked < usual => (asked, MOST_ITERATIONS.max(self.options.iterations)),
            asked => (asked.unwrap_or(usual), self.options.iterations),
        };
        if self.inverse.is_some() {
            self.b.copy_from_slice(g);
        } else {
            self.lattice.gather(g, &mut self.b, &mut self.workspace);
            if let Some(mask) = &self.mask {
                mask.hold(&mut self.b);
            }
        }
        // Solved for an impulse of about one, whose squares no precision loses.
        let unit = self.impulse_unit();
        if unit != 1.0 {
            for b in &mut self.b {
                *b = T::from_f64(b.as_f64() / unit);
            }
            if let Some(border) = &mut self.border {
                border.scale(1.0 / unit);
            }
        }
        let solved_by = self.method;
        let iteration = if let Some(inverse) = &mut self.inverse {
            let preconditioner = active(self.method, &mut self.painted, &mut self.diagonalization);
            let mut system = SampleSystem {
                matrix: s,
                preconditioner: &mut Dynamic(preconditioner),
            };
            let report = match &mut self.border {
                Some(border) => border.solve(&mut system, &self.b, dx, cap, tolerance),
                None => self.iteration.solve(&mut system, &self.b, dx, cap, tolerance),
            };
            for (d, dx) in inverse.d.iter_mut().zip(dx.iter()) {
                *d = dx.as_f64();
            }
            inverse
                .product
                .apply(&inverse.d, &mut inverse.p, &mut inverse.workspace);
            for (x, p) in x.iter_mut().zip(&inverse.p) {
                *x = T::from_f64(*p);
            }
            report
        } else {
            let report = self.iterate(s, x, Some(dx), cap, tolerance);
            if solved_by == Method::Direct {
                self.keep_up(s, report.iterations);
            } else if let (Painted::Background(background), Method::VCycle) = (&mut self.painted, solved_by) {
                let matrix = self
                    .painted_for
                    .as_ref()
                    .expect("prepared before the first solve");
                background.advance(matrix);
                self.settle_method();
                if self.method != solved_by {
                    self.renew_border();
                }
            }
            report
        };
        if unit != 1.0 {
            if let Some(border) = &mut self.border {
                border.scale(unit);
            }
            for x in x.iter_mut().chain(dx) {
                *x = T::from_f64(x.as_f64() * unit);
            }
        }
        SolveReport {
            method: solved_by,
            iteration,
        }
    }

    /// Residual at which steps stop.
    pub(crate) fn tolerance(&self) -> f64 {
        self.options.tolerance.unwrap_or(match self.method {
            Method::VCycle | Method::SampleMultigrid => ITERATED,
            Method::Direct if matches!(self.painted, Painted::Background(_)) => ITERATED,
            // Double precision is for references: there coefficients that hardly move a sample count too.
            _ if T::UNIT_ROUND_OFF < 1e-10 => 16.0 * T::UNIT_ROUND_OFF,
            Method::FastDiagonalization => DIAGONALIZED * T::UNIT_ROUND_OFF,
            _ => EXACT * T::UNIT_ROUND_OFF,
        })
    }

    /// The power of two that the impulses are divided by; 1 where they are of ordinary size, which saves two passes and
    /// changes no bit.
    fn impulse_unit(&self) -> f64 {
        let size = largest(&self.b).max(self.border.as_ref().map_or(0.0, |b| b.size()));
        if size == 0.0 || ORDINARY.contains(&size) {
            1.0
        } else {
            binary_unit(size)
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

    /// The same without constraints for forces `b` on the coefficients, of lattices with fewer coefficients than samples.
    pub(crate) fn solve_coefficients(&mut self, s: &StepMatrix<T>, b: &[T], x: &mut [T]) {
        debug_assert!(self.inverse.is_none());
        self.b.copy_from_slice(b);
        if let Some(mask) = &self.mask {
            mask.hold(&mut self.b);
        }
        self.iterate(s, x, None, self.options.iterations, 16.0 * T::UNIT_ROUND_OFF);
    }

    /// Solves for the right-hand side in `self.b`: with constraints if the samples are asked for too.
    fn iterate(
        &mut self,
        s: &StepMatrix<T>,
        x: &mut [T],
        dx: Option<&mut [T]>,
        cap: usize,
        tolerance: f64,
    ) -> PcgReport {
        let preconditioner = active(self.method, &mut self.painted, &mut self.diagonalization);
        let mask = self.mask.as_deref();
        let system = CoefficientSystem {
            lattice: &self.lattice,
            matrix: s,
            preconditioner: &mut Dynamic(preconditioner),
            samples: &mut self.samples,
            workspace: &mut self.workspace,
        };
        match (dx, &mut self.border) {
            (None, _) => {
                let mut system = Projected { system, mask };
                self.iteration.solve(&mut system, &self.b, x, cap, tolerance)
            }
            (Some(dx), None) => {
                dx.fill(T::zero());
                let system = Sampled { system, dx };
                let mut system = Projected { system, mask };
                self.iteration.solve(&mut system, &self.b, x, cap, tolerance)
            }
            (Some(dx), Some(border)) => {
                let mut system = Projected { system, mask };
                let report = border.solve(&mut system, &self.b, x, cap, tolerance);
                self.lattice.sample(x, dx, &mut self.workspace);
                report
            }
        }
    }
}
