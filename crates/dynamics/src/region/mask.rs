//! Regions that are no box.

use bspline::{Field, HierarchicalSpline, Real};
use glam::DVec3;

use super::{Cells, Region, RegionError, RegionOptions};
use crate::lattice::Rim;
use crate::matter::Matter;
use crate::patch::PatchError;
use crate::sparse::{Mask, MaskPart};

/// What of a box of cells takes part: places of the world.
pub struct RegionMask<'a> {
    inside: Box<dyn Fn(DVec3) -> bool + Send + Sync + 'a>,
    rim: Rim,
}

impl<'a> RegionMask<'a> {
    /// The places where `inside` is true. With [`Rim::Fixed`] the change fades, C², before the mask ends, with [`Rim::Free`]
    /// what is inside ends freely, see [`Mask::new`].
    pub fn new(inside: impl Fn(DVec3) -> bool + Send + Sync + 'a, rim: Rim) -> Self {
        Self {
            inside: Box::new(inside),
            rim,
        }
    }

    /// The inside of a field, any CSG of fields say: where it is positive.
    pub fn inside(field: &'a dyn Field, rim: Rim) -> Self {
        Self::new(|p| field.value(p) > 0.0, rim)
    }

    /// What lies within about `width` of the surface of a field, on both sides: `|f| ≤ width·|∇f|`.
    pub fn shell(field: &'a dyn Field, width: f64, rim: Rim) -> Self {
        let near = move |p| {
            let (value, gradient) = field.value_gradient(p);
            value.abs() <= width * gradient.length()
        };
        Self::new(near, rim)
    }
}

impl<T: Real> Region<T> {
    /// Cuts a region out of `field` of which only a mask takes part, at rest and asleep. All else is as with a box: it is
    /// stepped, painted, held, written down and baked alike; parts of it do not sleep, and it does not move along.
    ///
    /// # Errors
    /// As [`new`](Self::new), and [`PatchError::Mask`] for a mask that no sample lies in or no coefficient moves for.
    pub fn masked(
        field: &HierarchicalSpline<T>,
        cells: Cells,
        mask: &RegionMask,
        matter: Matter,
        options: &RegionOptions,
    ) -> Result<Self, RegionError> {
        let mut region = Self::new(field, cells, matter, options)?;
        let dims = region.patch.lattice().sample_dims();
        let place = |i: usize| [i / dims[2] / dims[1], i / dims[2] % dims[1], i % dims[2]];
        let inside = |i: usize| (mask.inside)(region.sample_position(place(i)));
        let inside = (0..dims.iter().product()).map(inside).collect();
        let lattice = region.patch.lattice();
        let mask = Mask::new(lattice, inside, mask.rim, options.neighbours).map_err(PatchError::from)?;
        region.patch = region.patch.with_mask(mask)?;
        Ok(region)
    }

    /// The parts of the mask that springs join; none of a box. Each moves on its own.
    pub fn mask_parts(&self) -> &[MaskPart] {
        self.patch.mask().map_or(&[], Mask::parts)
    }
}
