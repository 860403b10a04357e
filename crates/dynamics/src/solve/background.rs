//! A factor that is made beside the steps: a V-cycle solves them until it is done.

use bspline::Real;

use super::band_cholesky::{BandCholesky, NotPositive, SLICE};
use super::estimates::Estimates;
use super::galerkin::Galerkin;
use super::pcg::Preconditioner;
use super::v_cycle::{VCycle, VCycleOptions};
use crate::lattice::{Lattice, SampleBox};
use crate::springs::StepMatrix;

/// A V-cycle without blocks, and the factor that takes its place. The work on the factor is a fixed part per solve, so
/// that no step stalls and the same steps give the same bits.
///
/// How far it is for the steps, and how far the factor in memory is, are two things: a solver that begins anew with the
/// same matrix walks the same way through the same bits, but finds the rows there.
#[derive(Clone, Debug)]
pub(super) struct Background<T> {
    cycle: VCycle<T>,
    galerkin: Galerkin,
    factor: BandCholesky<T>,
    work: Work,
    made: Work,
    /// Row at which there is no factor.
    failed: Option<usize>,
    /// Whether the V-cycle is still of the matrix before.
    stale: bool,
}

/// Solves after a dab of paint before a factor is begun: another dab would make it useless.
const WAIT: usize = 12;

/// What comes next, in the order of time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
pub(super) enum Work {
    /// Nothing, so many solves after paint; nothing either in the solve for which the V-cycle was prepared.
    Wait(usize),
    /// One of the parts of the matrix, the last being to write it.
    Assembly(usize),
    /// Rows from here on.
    Rows(usize),
    Done,
    /// The matrix has no factor in this precision.
    Impossible,
}

impl<T: Real> Background<T> {
    pub fn new(lattice: &Lattice<T>, steps: &[[isize; 3]], options: VCycleOptions) -> Self {
        let galerkin = Galerkin::new(lattice, steps);
        Self {
            cycle: VCycle::new(lattice, steps, VCycleOptions { blocks: 0, ..options }),
            factor: BandCholesky::new(lattice.coefficient_count(), galerkin.band()),
            galerkin,
            work: Work::Wait(WAIT),
            made: Work::Wait(WAIT),
            failed: None,
            stale: false,
        }
    }

    /// Begins a new factor.
    ///
    /// # Errors
    /// [`NotPositive`] if the V-cycle cannot be prepared.
    pub fn prepare(&mut self, s: &StepMatrix<T>) -> Result<(), NotPositive> {
        self.cycle.prepare(s)?;
        self.made = Work::Wait(WAIT);
        self.failed = None;
        self.stale = false;
        self.work = Work::Wait(WAIT);
        Ok(())
    }

    /// The same where the matrix has changed in a box only, and may soon change again.
    ///
    /// # Errors
    /// [`NotPositive`] as [`prepare`](Self::prepare).
    pub fn repaint(&mut self, s: &StepMatrix<T>, at: SampleBox) -> Result<(), NotPositive> {
        self.cycle.follow(s, at)?;
        self.made = Work::Wait(WAIT);
        self.failed = None;
        self.stale = false;
        self.work = Work::Wait(0);
        Ok(())
    }

    /// Begins anew with the matrix that its factor is of.
    ///
    /// # Errors
    /// [`NotPositive`] if the V-cycle cannot be prepared.
    pub fn begin_again(&mut self, matrix: &StepMatrix<T>) -> Result<(), NotPositive> {
        self.work = Work::Wait(WAIT);
        if self.stale {
            self.cycle.prepare(matrix)?;
            self.stale = false;
        }
        self.cycle.refresh(matrix)
    }

    /// The cycle, while it solves.
    pub fn solving_cycle(&mut self) -> Option<&mut VCycle<T>> {
        (!self.is_done()).then_some(&mut self.cycle)
    }

    /// The factor, and what assembles it.
    pub fn made(&mut self) -> (&mut Galerkin, &mut BandCholesky<T>) {
        (&mut self.galerkin, &mut self.factor)
    }

    /// Whether the V-cycle is of another matrix than the factor.
    pub fn is_stale(&self) -> bool {
        self.stale
    }

    /// Told that the factor is now that of another matrix.
    pub fn exchanged(&mut self) {
        self.stale = true;
    }

    /// Whether the factor is done.
    pub fn is_done(&self) -> bool {
        self.work == Work::Done
    }

    /// How far it is.
    pub fn progress(&self) -> Work {
        self.work
    }

    /// The eigenvalues that its cycle takes.
    pub fn estimates(&self) -> Estimates {
        self.cycle.estimates()
    }

    /// Whether the smoother of the cycle solves, alone.
    pub fn is_smoothed(&self) -> bool {
        !self.is_done() && self.cycle.is_alone()
    }

    /// Whether the factor may be begun.
    pub fn is_ready(&self) -> bool {
        self.work == Work::Wait(WAIT)
    }

    /// After a solve: the next part of the work on the factor of `matrix`, which it was prepared for. None is begun where the
    /// smoother solves alone or the solve was `quick`, which takes less time than to read a factor.
    pub fn advance(&mut self, matrix: &StepMatrix<T>, quick: bool) {
        if !(self.cycle.is_alone() || quick && self.is_ready()) {
            self.work = self.next(matrix);
        }
    }

    /// What follows on the work that is next now, which is done where it is not yet.
    fn next(&mut self, matrix: &StepMatrix<T>) -> Work {
        let next = match self.work {
            Work::Wait(solves) if solves < WAIT => Work::Wait(solves + 1),
            Work::Wait(_) => Work::Assembly(0),
            Work::Assembly(part) if part < self.galerkin.parts() => Work::Assembly(part + 1),
            Work::Assembly(_) => Work::Rows(0),
            Work::Rows(row) if self.failed == Some(row) => Work::Impossible,
            Work::Rows(row) if row + SLICE >= self.factor.len() => Work::Done,
            Work::Rows(row) => Work::Rows(row + SLICE),
            Work::Done | Work::Impossible => self.work,
        };
        if self.made >= next {
            return next;
        }
        self.made = next;
        match self.work {
            Work::Assembly(part) => self.galerkin.assemble_part(matrix, part, &mut self.factor),
            Work::Rows(row) if self.factor.factorize_slice(row).is_err() => {
                self.failed = Some(row);
                self.made = Work::Impossible;
            }
            _ => (),
        }
        self.made
    }

    /// All the work at once.
    pub fn finish(&mut self, matrix: &StepMatrix<T>) {
        while !matches!(self.work, Work::Done | Work::Impossible) {
            self.work = self.next(matrix);
        }
    }

    /// Goes to where another one was.
    ///
    /// # Errors
    /// [`NotPositive`] if the V-cycle cannot be prepared.
    pub fn resume(
        &mut self,
        matrix: &StepMatrix<T>,
        work: Work,
        estimates: &Estimates,
    ) -> Result<(), NotPositive> {
        self.cycle.resume(matrix, estimates)?;
        if let Work::Wait(_) = work {
            self.work = work;
        }
        while self.work < work && !matches!(self.work, Work::Done | Work::Impossible) {
            self.work = self.next(matrix);
        }
        Ok(())
    }
}

impl<T: Real> Preconditioner<T> for Background<T> {
    fn apply(&mut self, s: &StepMatrix<T>, r: &[T], z: &mut [T]) {
        if self.is_done() {
            self.factor.apply(s, r, z);
        } else {
            self.cycle.apply(s, r, z);
        }
    }

    fn factor(&self) -> Option<&BandCholesky<T>> {
        self.is_done().then_some(&self.factor)
    }
}
