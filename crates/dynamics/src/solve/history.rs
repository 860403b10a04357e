//! What a solver has to know to go on where another one was.

use bspline::Real;
use serde::{Deserialize, Serialize};

use super::background::Work;
use super::estimates::Estimates;
use super::painted::Painted;
use super::renewal::{Renewal, Stage};
use super::report::SolveError;
use super::step_solver::StepSolver;
use crate::springs::{SpringWeights, StepMatrix, Weights};

/// All of a solver that is neither its lattice nor made from the matrix at hand: the matrix that it was prepared for, how
/// far the factor is that is made beside the steps, and that which will take its place.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct SolverHistory<T> {
    matrix: MatrixRecord<T>,
    progress: Option<(Work, Estimates)>,
    estimates: Option<Estimates>,
    slow: usize,
    renewal: Option<(MatrixRecord<T>, Stage)>,
}

/// The weights of a [`StepMatrix`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct MatrixRecord<T> {
    mass: Weights<T>,
    springs: Vec<Weights<T>>,
}

impl<T: Real> MatrixRecord<T> {
    fn of(matrix: &StepMatrix<T>) -> Self {
        Self {
            mass: matrix.mass.clone(),
            springs: matrix.springs.iter().map(|s| s.weights.clone()).collect(),
        }
    }

    /// With the springs of `like`.
    fn matrix(&self, like: &StepMatrix<T>) -> StepMatrix<T> {
        let springs = like.springs.iter().zip(&self.springs);
        let springs = springs.map(|(s, w)| SpringWeights {
            direction: s.direction,
            weights: w.clone(),
        });
        StepMatrix::new(like.dims(), self.mass.clone(), springs.collect())
    }

    fn fits(&self, like: &StepMatrix<T>) -> bool {
        let samples = like.dims().iter().product();
        let fit = |w: &Weights<T>| match w {
            Weights::Constant(_) => true,
            Weights::Each(list) => list.len() == samples,
        };
        self.springs.len() == like.springs.len() && fit(&self.mass) && self.springs.iter().all(fit)
    }
}

impl<T: Real> SolverHistory<T> {
    /// Whether its matrices have as many samples and springs as `like`.
    pub fn fits(&self, like: &StepMatrix<T>) -> bool {
        let renewal = self.renewal.as_ref().is_none_or(|(m, _)| m.fits(like));
        self.matrix.fits(like) && renewal
    }
}

impl<T: Real> StepSolver<T> {
    /// What the next solves depend on beside the matrix; nothing before the first [`prepare`](Self::prepare) and of
    /// constant material.
    pub(crate) fn history(&self) -> Option<SolverHistory<T>> {
        let matrix = self.painted_for.as_ref().filter(|_| self.begun)?;
        let renewal = self.renewal.as_ref().map(|r| r.state());
        Some(SolverHistory {
            matrix: MatrixRecord::of(matrix),
            slow: self.slow,
            renewal: renewal.map(|(matrix, stage)| (MatrixRecord::of(matrix), stage)),
            progress: match &self.painted {
                Painted::Background(background) => Some((background.progress(), background.estimates())),
                _ => None,
            },
            estimates: match &self.painted {
                Painted::VCycle(cycle) => Some(cycle.estimates()),
                _ => None,
            },
        })
    }

    /// Goes to where another solver was, of whose matrix `like` has the springs; its constraints follow with
    /// [`set_border`](Self::set_border), those of the time included.
    ///
    /// # Errors
    /// [`SolveError`] if the matrix of a damaged history is not positive definite.
    pub(crate) fn resume(
        &mut self,
        history: &SolverHistory<T>,
        like: &StepMatrix<T>,
    ) -> Result<(), SolveError> {
        let s = history.matrix.matrix(like);
        let border = self.border.take();
        self.prepare(&s)?;
        match (&mut self.painted, &history.progress, &history.estimates) {
            (Painted::Background(background), Some((work, estimates)), _) => {
                background.resume(&s, *work, estimates)?;
            }
            (Painted::VCycle(cycle), _, Some(estimates)) => cycle.resume(&s, estimates)?,
            _ => (),
        }
        self.slow = history.slow;
        if let (Some((matrix, stage)), Some((galerkin, factor))) = (&history.renewal, self.painted.factor()) {
            let mut renewal = Renewal::new(matrix.matrix(like), factor);
            self.renewal = renewal.resume(*stage, galerkin).then(|| Box::new(renewal));
        }
        self.settle_method();
        self.border = border;
        self.prepare_border(&s);
        Ok(())
    }
}
