//! The room of the matter: masses and springs, what holds them, and which of them take part.

use std::sync::Arc;

use bspline::Real;

use super::version::Version;
use super::{Patch, PatchError};
use crate::constraints::Held;
use crate::matter::{Matter, Quantity, ScaledMatter};
use crate::sparse::Mask;
use crate::springs::{Neighbours, Plasticity, SpringNetwork, SpringWeights, Weights};

/// What a patch is made of, and what holds it.
#[derive(Clone, Debug)]
pub(crate) struct Material<T> {
    pub neighbours: Neighbours,
    pub matter: Matter,
    pub lumped: ScaledMatter<T>,
    pub network: SpringNetwork<T>,
    /// Whether the springs were set beside the matter.
    pub own_springs: bool,
    pub plasticity: Plasticity<T>,
    pub held: Option<Box<Held<T>>>,
    /// Which samples and coefficients take part, if not all.
    pub mask: Option<Arc<Mask>>,
    /// Counts changes of matter and constraints.
    pub changes: u64,
    /// Counts paint, which what was made before may survive.
    pub paints: u64,
}

impl<T: Real> Material<T> {
    /// Counts all that the matrix of a step depends on.
    pub fn version(&self) -> Version {
        Version {
            changes: self.changes + self.network.changes(),
            paints: self.paints,
        }
    }
}

impl<T: Real> Patch<T> {
    /// The matter.
    pub fn matter(&self) -> &Matter {
        &self.material.matter
    }

    /// Changes the matter, also while the patch moves. Costs a new factor or V-cycle at the next implicit step.
    ///
    /// # Errors
    /// [`PatchError::Matter`]; the old matter then stays.
    pub fn set_matter(&mut self, matter: Matter) -> Result<(), PatchError> {
        let masked = self.masked_matter(&matter);
        let (lumped, springs) = masked.in_units(self.cache.solver.lattice(), self.material.neighbours)?;
        drop(masked);
        self.material.lumped = lumped;
        self.material.matter = matter;
        self.material.network.set_springs(&springs);
        self.material.own_springs = false;
        self.material.changes += 1;
        Ok(())
    }

    /// Replaces the stiffness of the springs, also while the patch moves: forces, the matrix of the steps and the bound of
    /// the explicit ones follow. It holds until the [matter](Self::set_matter) is set again.
    ///
    /// # Errors
    /// [`PatchError::Directions`] for other directions than those of the patch, [`PatchError::Matter`] for a list of
    /// another length and for numbers that are negative or not finite; the old springs then stay.
    pub fn set_springs(&mut self, springs: &[SpringWeights<f64>]) -> Result<(), PatchError> {
        self.check_springs(springs)?;
        let springs = self.masked_springs(springs);
        self.put_springs(&springs);
        Ok(())
    }

    pub(crate) fn check_springs(&self, springs: &[SpringWeights<f64>]) -> Result<(), PatchError> {
        let steps = |s: &[SpringWeights<f64>]| s.iter().map(|s| s.direction.step).collect::<Vec<_>>();
        let needed: Vec<_> = self
            .material
            .neighbours
            .directions()
            .iter()
            .map(|d| d.step)
            .collect();
        let found = steps(springs);
        if found != needed {
            return Err(PatchError::Directions { found, needed });
        }
        for s in springs {
            let values = match &s.weights {
                Weights::Constant(v) => Quantity::Constant(*v),
                Weights::Each(v) => Quantity::PerSample(v.clone()),
            };
            values.check("spring stiffness", self.motion.base.len(), true)?;
        }
        Ok(())
    }

    /// Springs that were checked, and are those of the mask.
    pub(crate) fn put_springs(&mut self, springs: &[SpringWeights<f64>]) {
        self.material.network.set_springs(springs);
        self.material.own_springs = true;
    }

    /// Counts all that the matrix of a step depends on.
    pub(crate) fn version(&self) -> Version {
        self.material.version()
    }

    /// The springs and their rest state.
    pub fn springs(&self) -> &SpringNetwork<T> {
        &self.material.network
    }

    /// The springs, to change their rest state.
    pub fn springs_mut(&mut self) -> &mut SpringNetwork<T> {
        &mut self.material.network
    }
}
