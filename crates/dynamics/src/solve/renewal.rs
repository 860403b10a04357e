//! A factor that takes the place of one that has become too old, made beside the solves that still use the old one.

use bspline::Real;
use serde::{Deserialize, Serialize};

use super::band_cholesky::{BandCholesky, SLICE};
use super::galerkin::Galerkin;
use crate::springs::StepMatrix;

/// What comes next.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Stage {
    /// One of the parts of the matrix.
    Assembly(usize),
    /// Rows from here on.
    Rows(usize),
}

/// The factor in the making.
#[derive(Clone, Debug)]
pub(super) struct Renewal<T> {
    matrix: StepMatrix<T>,
    factor: BandCholesky<T>,
    stage: Stage,
}

/// What a part of the work led to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Renewed {
    NotYet,
    Done,
    /// The matrix has no factor in this precision.
    Impossible,
}

impl<T: Real> Renewal<T> {
    /// Of `matrix`, of the size of `old`.
    pub fn new(matrix: StepMatrix<T>, old: &BandCholesky<T>) -> Self {
        Self {
            matrix,
            factor: BandCholesky::new(old.len(), old.band()),
            stage: Stage::Assembly(0),
        }
    }

    /// The matrix, and what comes next.
    pub fn state(&self) -> (&StepMatrix<T>, Stage) {
        (&self.matrix, self.stage)
    }

    /// The next part of the work: the same after every solve, so that no step stalls and the same steps give the same bits.
    pub fn advance(&mut self, galerkin: &mut Galerkin) -> Renewed {
        match self.stage {
            Stage::Assembly(part) => {
                galerkin.assemble_part(&self.matrix, part, &mut self.factor);
                self.stage = if part < galerkin.parts() {
                    Stage::Assembly(part + 1)
                } else {
                    Stage::Rows(0)
                };
                Renewed::NotYet
            }
            Stage::Rows(row) => {
                if self.factor.factorize_slice(row).is_err() {
                    return Renewed::Impossible;
                }
                self.stage = Stage::Rows(row + SLICE);
                if row + SLICE >= self.factor.len() {
                    Renewed::Done
                } else {
                    Renewed::NotYet
                }
            }
        }
    }

    /// Goes on to where another was; says whether that can be.
    pub fn resume(&mut self, stage: Stage, galerkin: &mut Galerkin) -> bool {
        while self.stage != stage {
            if self.advance(galerkin) != Renewed::NotYet {
                return false;
            }
        }
        true
    }

    /// Hands the factor over, in exchange for the old one.
    pub fn finish(mut self, factor: &mut BandCholesky<T>) -> StepMatrix<T> {
        std::mem::swap(factor, &mut self.factor);
        self.matrix
    }
}
