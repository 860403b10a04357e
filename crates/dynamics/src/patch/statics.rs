//! Solvers of static problems, which a patch keeps.

use super::version::Version;
use crate::solve::StepSolver;
use crate::springs::StepMatrix;

/// Against which springs a static force works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Against {
    /// The matter as it is, constraints included; of the 4-D law the tangent of the present state.
    Painted,
    /// Linear springs of the same stiffness everywhere and no constraints: what a tool scales its force by, so that painted
    /// matter shows.
    Reference {
        /// Stiffness per volume.
        stiffness: f64,
        /// Ground stiffness per volume.
        ground: f64,
    },
}

/// Solver of static problems, in double precision.
#[derive(Clone, Debug)]
pub(crate) struct StaticSolver {
    pub against: Against,
    /// Of the matter it is for.
    pub version: Version,
    pub matrix: StepMatrix<f64>,
    /// Of the matrix, `σ²` included.
    pub unit: f64,
    pub solver: StepSolver<f64>,
}
