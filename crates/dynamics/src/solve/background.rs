//! A factor that is made beside the steps: a V-cycle solves them until it is done.

use bspline::Real;

use super::band_cholesky::{BandCholesky, NotPositive, SLICE};
use super::galerkin::Galerkin;
use super::pcg::{PcgReport, Preconditioner};
use super::v_cycle::{VCycle, VCycleOptions};
use crate::lattice::Lattice;
use crate::springs::{StepMatrix, Weights};

/// Iterations with a factor, made for an earlier matrix, that cost as much as a V-cycle's.
const SLOW: usize = 2;
/// Slow solves in a row after which the factor is renewed: a single step of another length is not worth it.
const PATIENCE: usize = 4;

/// A V-cycle without blocks, and the factor that takes its place. The work on the factor is a fixed part per solve, so
/// that no step stalls and the same steps give the same bits.
#[derive(Clone, Debug)]
pub(super) struct Background<T> {
    cycle: VCycle<T>,
    galerkin: Galerkin,
    factor: BandCholesky<T>,
    /// What the factor is of.
    matrix: StepMatrix<T>,
    work: Work,
    slow: usize,
}

/// What comes next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Work {
    /// Nothing in the solve for which the V-cycle was prepared.
    Prepared,
    Assembly,
    /// Rows from here on.
    Rows(usize),
    Done,
    /// The matrix has no factor in this precision.
    Impossible,
}

impl<T: Real> Background<T> {
    pub fn new(
        lattice: &Lattice<T>,
        s: &StepMatrix<T>,
        steps: &[[isize; 3]],
        options: VCycleOptions,
    ) -> Self {
        let galerkin = Galerkin::new(lattice, steps);
        Self {
            cycle: VCycle::new(lattice, steps, VCycleOptions { blocks: 0, ..options }),
            factor: BandCholesky::new(lattice.coefficient_count(), galerkin.band()),
            galerkin,
            matrix: s.clone(),
            work: Work::Prepared,
            slow: 0,
        }
    }

    /// Begins a new factor.
    ///
    /// # Errors
    /// [`NotPositive`] if the V-cycle cannot be prepared.
    pub fn prepare(&mut self, s: &StepMatrix<T>) -> Result<(), NotPositive> {
        // A solve that left too much asks for a fresh start: of the same matrix the factor is what helps.
        if self.matrix == *s && self.work != Work::Prepared {
            return Ok(());
        }
        copy(&mut self.matrix.mass, &s.mass);
        for (to, from) in self.matrix.springs.iter_mut().zip(&s.springs) {
            copy(&mut to.weights, &from.weights);
        }
        self.matrix.refresh();
        self.work = Work::Prepared;
        self.slow = 0;
        self.cycle.prepare(s)
    }

    /// Whether the factor is done.
    pub fn is_done(&self) -> bool {
        self.work == Work::Done
    }

    /// After a solve of `s`: the next part of the work, or a new factor if this one is too old.
    pub fn advance(&mut self, s: &StepMatrix<T>, report: PcgReport) {
        match self.work {
            Work::Prepared => self.work = Work::Assembly,
            Work::Assembly => {
                self.galerkin.assemble(&self.matrix, &mut self.factor);
                self.work = Work::Rows(0);
            }
            Work::Rows(row) => {
                self.work = match self.factor.factorize_slice(row) {
                    Err(_) => Work::Impossible,
                    Ok(()) if row + SLICE >= self.factor.len() => Work::Done,
                    Ok(()) => Work::Rows(row + SLICE),
                }
            }
            Work::Done if report.iterations > SLOW => {
                self.slow += 1;
                if self.slow >= PATIENCE && self.prepare(s).is_err() {
                    self.work = Work::Done;
                }
            }
            Work::Done => self.slow = 0,
            Work::Impossible => (),
        }
    }

    /// All the work at once.
    pub fn finish(&mut self) {
        while !matches!(self.work, Work::Done | Work::Impossible) {
            let matrix = self.matrix.clone();
            self.advance(&matrix, PcgReport::default());
        }
    }
}

fn copy<T: Real>(to: &mut Weights<T>, from: &Weights<T>) {
    match (to, from) {
        (Weights::Each(to), Weights::Each(from)) => to.copy_from_slice(from),
        (to, from) => *to = from.clone(),
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
}
