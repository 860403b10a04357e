//! A patch that is no box.

use std::borrow::Cow;
use std::sync::Arc;

use bspline::Real;

use super::Mask;
use crate::lattice::Rim;
use crate::matter::{Matter, Quantity};
use crate::patch::{Patch, PatchError};
use crate::springs::{SpringWeights, Weights};

/// What matter outside a mask with a free rim weighs and bears, relative to the nearest inside: without it functions that
/// reach hardly a sample would not be determined \[Parvizian07\]. Less of it, and they swing far beyond what is inside to
/// fit it; more, and it holds what ends freely.
pub const OUTSIDE: f64 = 1e-3;

impl<T: Real> Patch<T> {
    /// The patch with only what a mask leaves of it: coefficients that do not move stay 0, and forces outside the mask are
    /// dropped. For a patch at rest.
    ///
    /// # Errors
    /// [`PatchError::Mask`] for a mask of another lattice, [`PatchError::Matter`].
    pub fn with_mask(mut self, mask: Mask) -> Result<Self, PatchError> {
        let needed = self.motion.base.len();
        if mask.inside().len() != needed {
            let found = mask.inside().len();
            return Err(super::MaskError::Length { found, needed }.into());
        }
        self.put_mask(Arc::new(mask));
        let matter = self.material.matter.clone();
        self.set_matter(matter)?;
        Ok(self)
    }

    /// The same but for the matter, which has to be set again.
    pub(crate) fn put_mask(&mut self, mask: Arc<Mask>) {
        self.cache.solver.set_mask(Some(mask.clone()));
        if let Some(solver) = &mut self.cache.mass_solver {
            solver.set_mask(Some(mask.clone()));
        }
        self.material.mask = Some(mask);
        self.material.changes += 1;
    }

    /// The mask, of a patch that is no box.
    pub fn mask(&self) -> Option<&Mask> {
        self.material.mask.as_deref()
    }

    /// How its steps are solved, of a patch with a mask.
    pub fn masked_way(&self) -> Option<super::MaskedWay> {
        self.cache.solver.masked_way()
    }

    /// The mask if matter outside it is lighter.
    fn thinned(&self) -> Option<&Mask> {
        self.material.mask.as_deref().filter(|m| m.rim() == Rim::Free)
    }

    /// What matter is under the mask: outside that of the nearest sample inside, but lighter.
    pub(crate) fn masked_matter<'a>(&self, matter: &'a Matter) -> Cow<'a, Matter> {
        let Some(mask) = self.thinned() else {
            return Cow::Borrowed(matter);
        };
        let mut matter = matter.clone();
        let all = [
            &mut matter.stiffness,
            &mut matter.mass,
            &mut matter.damping,
            &mut matter.ground,
        ];
        for quantity in all {
            // Lists of a wrong length are refused where they are checked.
            let fits = match quantity {
                Quantity::Constant(v) => *v != 0.0,
                Quantity::PerSample(list) => list.len() == mask.inside().len(),
            };
            if fits {
                mask.extend(quantity.paint(mask.inside().len()), OUTSIDE);
            }
        }
        Cow::Owned(matter)
    }

    /// The same of springs, which are outside with either of their ends.
    pub(crate) fn masked_springs(&self, springs: &[SpringWeights<f64>]) -> Vec<SpringWeights<f64>> {
        let Some(mask) = self.thinned() else {
            return springs.to_vec();
        };
        let dims = self.lattice().sample_dims();
        let one = |s: &SpringWeights<f64>| {
            let weight = |i: usize| {
                let at = [i / dims[2] / dims[1], i / dims[2] % dims[1], i % dims[2]];
                let to: [usize; 3] = std::array::from_fn(|a| at[a].wrapping_add_signed(s.direction.step[a]));
                let ends = (0..3).all(|a| to[a] < dims[a]);
                let j = if ends {
                    (to[0] * dims[1] + to[1]) * dims[2] + to[2]
                } else {
                    i
                };
                let both = mask.inside()[i] && mask.inside()[j];
                s.weights.at(i) * if both { 1.0 } else { OUTSIDE }
            };
            SpringWeights {
                direction: s.direction,
                weights: Weights::Each((0..mask.inside().len()).map(weight).collect()),
            }
        };
        springs.iter().map(one).collect()
    }
}
