//! A dynamic patch: a lattice, its matter and springs, and how they move.

mod cache;
mod energy;
mod error;
mod material;
mod motion;
mod statics;
mod version;

use bspline::Real;

use crate::lattice::Lattice;
use crate::matter::Matter;
use crate::solve::{SolverOptions, StepSolver};
use crate::springs::{Law, Neighbours, Plasticity, SpringNetwork, SpringWeights, StepMatrix, Weights};
use cache::Cache;
pub(crate) use cache::Scratch;
pub use energy::Energy;
pub use error::PatchError;
use material::Material;
use motion::Motion;
pub use motion::State;
pub(crate) use motion::finite;
pub use statics::Against;
pub(crate) use statics::StaticSolver;
pub(crate) use version::{Prepared, Version};

/// A region of a field that moves.
#[derive(Clone, Debug)]
pub struct Patch<T> {
    /// Where it is, and what pushes it.
    pub(crate) motion: Motion<T>,
    /// What it is made of, and what holds it.
    pub(crate) material: Material<T>,
    /// What is made from both: it could be thrown away at any time.
    pub(crate) cache: Cache<T>,
}

impl<T: Real> Patch<T> {
    /// A patch at rest with the densities `d` at its samples.
    ///
    /// # Errors
    /// [`PatchError`] for densities, matter, scale or spacing that are refused.
    pub fn new(
        lattice: Lattice<T>,
        matter: Matter,
        law: Law,
        neighbours: Neighbours,
        d: &[T],
        options: SolverOptions,
    ) -> Result<Self, PatchError> {
        let (n, m) = (lattice.coefficient_count(), lattice.sample_count());
        finite("density", d, m)?;
        let scale = law.scale();
        if !(scale.is_finite() && scale > 0.0) {
            return Err(PatchError::Scale { scale });
        }
        let spacing = lattice.spacing();
        let cubic = spacing.iter().all(|h| (h / spacing[0] - 1.0).abs() < 1e-9);
        if neighbours != Neighbours::Six && !cubic {
            return Err(PatchError::NotCubic { spacing });
        }
        let (lumped, springs) = matter.in_units(&lattice, neighbours)?;
        let dims = lattice.sample_dims();
        let network = SpringNetwork::in_units(dims, spacing, law, &springs, d);
        let steps: Vec<_> = neighbours.directions().iter().map(|d| d.step).collect();
        let springs = network.springs().iter().map(|s| SpringWeights {
            direction: s.direction,
            weights: match law {
                Law::Linear { .. } => s.weights.clone(),
                Law::FourD { .. } => Weights::Each(vec![T::zero(); m]),
            },
        });
        let matrix = StepMatrix::new(dims, lumped.mass.weights.clone(), springs.collect());
        let motion = Motion::at(d, n);
        Ok(Self {
            cache: Cache::new(StepSolver::new(lattice, &steps, options), matrix, &motion.state),
            material: Material {
                neighbours,
                matter,
                lumped,
                network,
                own_springs: false,
                plasticity: Plasticity::Elastic,
                held: None,
                mask: None,
                changes: 0,
                paints: 0,
            },
            motion,
        })
    }

    /// The lattice.
    pub fn lattice(&self) -> &Lattice<T> {
        self.cache.solver.lattice()
    }

    /// How implicit steps are solved.
    pub fn solver_options(&self) -> SolverOptions {
        self.cache.solver.options()
    }

    /// Finishes at once a factor that is being made beside the steps: what some hundred steps would do.
    pub fn settle(&mut self) {
        self.cache.solver.settle();
    }

    /// Factors and cycles that implicit steps have made so far.
    pub fn factorizations(&self) -> usize {
        self.cache.solver.factorizations()
    }
}
