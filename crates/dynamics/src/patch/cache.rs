//! The room of the solvers: what a patch keeps from step to step that is made from its state and matter: solvers, matrices, bounds.

use bspline::Real;

use super::motion::State;
use super::statics::StaticSolver;
use super::version::{Prepared, Version};
use crate::lattice::{SampleBox, TensorWorkspace};
use crate::solve::StepSolver;
use crate::springs::StepMatrix;

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
    /// Where weights have changed by paint since the solver was made for them.
    pub painted_on: SampleBox,
    /// Bound of explicit steps with the version it is of.
    pub limit: Option<(Version, f64)>,
    /// Of static problems, painted and of reference; no bit depends on whether they are there.
    pub statics: [Option<Box<StaticSolver>>; 2],
    pub work: Scratch<T>,
    pub workspace: TensorWorkspace<T>,
}

/// Vectors of a step.
#[derive(Clone, Debug)]
pub(crate) struct Scratch<T> {
    /// Impulse on the samples.
    pub g: Vec<T>,
    /// Forces on the samples, in `force_unit`.
    pub force: Vec<T>,
    pub force_unit: f64,
    /// Work of the external forces since the step began.
    pub work: f64,
    /// What the densities moved over an adaptive step.
    pub moved: Vec<f64>,
    pub x: Vec<T>,
    pub dx: Vec<T>,
    pub first_x: Vec<T>,
    pub first_dx: Vec<T>,
    pub before: State<T>,
}

impl<T: Real> Cache<T> {
    /// Nothing made yet.
    pub fn new(solver: StepSolver<T>, matrix: StepMatrix<T>, state: &State<T>) -> Self {
        let (n, m) = (state.p.len(), state.d.len());
        let zeros = |n: usize| vec![T::zero(); n];
        Self {
            work: Scratch {
                g: zeros(m),
                force: zeros(m),
                force_unit: 1.0,
                work: 0.0,
                moved: Vec::new(),
                x: zeros(n),
                dx: zeros(m),
                first_x: zeros(n),
                first_dx: zeros(m),
                before: state.clone(),
            },
            workspace: TensorWorkspace::new(),
            solver,
            mass_solver: None,
            mass_matrix: None,
            matrix,
            filled: None,
            prepared: None,
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
