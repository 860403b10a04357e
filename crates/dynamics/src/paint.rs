//! Matter painted on a box of samples, also while the patch moves.

use bspline::Real;

use crate::lattice::OnBox;
use crate::matter::{MatterError, Quantity, check_each};
use crate::patch::{Patch, PatchError};

/// What can be painted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Substance {
    /// κ.
    Stiffness,
    /// μ.
    Mass,
    /// γ.
    Damping,
    /// Stiffness of the ground springs.
    Ground,
}

impl Substance {
    fn name(self) -> &'static str {
        match self {
            Self::Stiffness => "stiffness",
            Self::Mass => "mass",
            Self::Damping => "damping",
            Self::Ground => "ground stiffness",
        }
    }
}

impl<T: Real> Patch<T> {
    /// Gives the samples of a box other matter, per volume; all is then as after [`set_matter`](Self::set_matter) with the
    /// same, to the bit. Stiffness costs the box, all else a list.
    ///
    /// A V-cycle follows at the cost of the box and takes over from a factor beside the steps, which is begun again when some
    /// steps have gone by without paint. A small factor serves on as long as it solves a step to 10⁻³ of the impulse within the
    /// usual iterations; if that takes more than two of them several times in a row, one of the matter as it is by then is made
    /// beside the steps and takes its place.
    ///
    /// # Errors
    /// [`PatchError::Box`], [`PatchError::Matter`]; the old matter then stays.
    pub fn paint(&mut self, substance: Substance, paint: OnBox<f64>) -> Result<(), PatchError> {
        let dims = self.lattice().sample_dims();
        if !paint.at.fits(dims) {
            return Err(PatchError::Box { at: paint.at, dims });
        }
        let may_vanish = substance != Substance::Mass;
        check_each(substance.name(), paint.values, paint.at.len(), may_vanish)?;
        let samples = self.motion.base.len();
        let quantity = match substance {
            Substance::Stiffness => &mut self.material.matter.stiffness,
            Substance::Mass => &mut self.material.matter.mass,
            Substance::Damping => &mut self.material.matter.damping,
            Substance::Ground => &mut self.material.matter.ground,
        };
        let was_constant = matches!(quantity, Quantity::Constant(_));
        let list = quantity.paint(samples);
        let before = paint.at.crop(list, dims);
        paint.at.paste(list, dims, paint.values);
        // Under a mask samples outside follow those inside.
        let local = !self.material.own_springs && self.material.mask.is_none();
        let done = if substance == Substance::Stiffness && !was_constant && local {
            self.stiffen(paint)
        } else {
            self.lump_again()
        };
        if let Err(e) = done {
            let undone = match substance {
                Substance::Stiffness => &mut self.material.matter.stiffness,
                Substance::Mass => &mut self.material.matter.mass,
                Substance::Damping => &mut self.material.matter.damping,
                Substance::Ground => &mut self.material.matter.ground,
            };
            paint.at.paste(undone.paint(samples), dims, &before);
            return Err(e.into());
        }
        self.material.paints += 1;
        // A spring counts where it starts, which may be a sample before the box.
        self.cache.painted_on = self.cache.painted_on.joined(paint.at.grown(1, dims));
        Ok(())
    }

    /// Of all matter.
    fn lump_again(&mut self) -> Result<(), MatterError> {
        let (lumped, springs) = self
            .masked_matter(&self.material.matter)
            .in_units(self.cache.solver.lattice(), self.material.neighbours)?;
        self.material.lumped = lumped;
        self.material.network.paint(&springs);
        self.material.own_springs = false;
        Ok(())
    }

    /// The springs that begin or end in a box.
    fn stiffen(&mut self, paint: OnBox<f64>) -> Result<(), MatterError> {
        let lattice = self.cache.solver.lattice();
        let dims = lattice.sample_dims();
        let near = paint.at.grown(1, dims);
        let changed: Vec<Vec<f64>> = self
            .material
            .neighbours
            .directions()
            .into_iter()
            .enumerate()
            .map(|(n, direction)| {
                let weight = self.material.matter.spring_weight(lattice, n, direction);
                let mut list = Vec::with_capacity(near.len());
                near.places(dims).for_each(|(i, at)| list.push(weight(i, at)));
                list
            })
            .collect();
        let all = changed.iter().flatten();
        let most = all.clone().fold(0.0_f64, |h, k| h.max(*k));
        if !most.is_finite() {
            return Err(MatterError::Range {
                what: "stiffness",
                least: all.fold(f64::INFINITY, |l, k| l.min(*k)),
                largest: most,
                precision: match T::NAME {
                    "f32" => "single precision",
                    _ => "double precision",
                },
            });
        }
        self.material.network.paint_on(near, &changed, most);
        Ok(())
    }
}
