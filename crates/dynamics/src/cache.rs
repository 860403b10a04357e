//! What a patch keeps from step to step that is made from its state and matter: solvers, matrices, bounds.

use bspline::Real;

use crate::lattice::SampleBox;
use crate::solve::StepSolver;
use crate::springs::StepMatrix;
use crate::statics::StaticSolver;
use crate::version::{Prepared, Version};

/// Solvers and matrices of a patch.
#[derive(Clone, Debug)]
pub(crate) struct Cache<T> {
    pub solver: StepSolver<T>,
    /// For the mass alone, made by the first explicit step.
    pub mass_solver: Option<Box<StepSolver<T>>>,
    /// `M + ΔtD` with the version and the step it was made for.
    pub mass_matrix: Option<(Version, f64, StepMatrix<T>)>,
    pub matrix: StepMatrix<T>,
    /// Version, damping, stiffness and unit that the matrix holds.
    pub filled: Option<(Version, f64, f64, f64)>,
    /// What the solver was made for.
    pub prepared: Option<Prepared>,
    /// Counts changes of matter and constraints.
    pub changes: u64,
    /// Counts paint, which what was made before may survive.
    pub paints: u64,
    /// Where weights have changed by paint since the solver was made for them.
    pub painted_on: SampleBox,
    /// Bound of explicit steps with the version it is of.
    pub limit: Option<(Version, f64)>,
    /// Of static problems, painted and of reference; no bit depends on whether they are there.
    pub statics: [Option<Box<StaticSolver>>; 2],
}

impl<T: Real> Cache<T> {
    /// Nothing made yet.
    pub fn new(solver: StepSolver<T>, matrix: StepMatrix<T>) -> Self {
        Self {
            solver,
            mass_solver: None,
            mass_matrix: None,
            matrix,
            filled: None,
            prepared: None,
            changes: 0,
            paints: 0,
            painted_on: SampleBox::default(),
            limit: None,
            statics: [None, None],
        }
    }

    /// Forgets all that later bits could depend on. What comes out the same when it is made again stays.
    pub fn begin_again(&mut self) {
        self.solver.begin_again();
        if let Some(solver) = &mut self.mass_solver {
            solver.begin_again();
        }
        self.mass_matrix = None;
        self.prepared = None;
    }
}
