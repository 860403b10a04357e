use bspline::hierarchical::EditError;
use bspline::tensor::TensorError;

use super::cells::{Cells, MAX_EDGE, MAX_SIZE, MIN_CELLS};
use crate::lattice::LatticeError;
use crate::patch::PatchError;

/// Why a region cannot be cut out or baked.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RegionError {
    /// The level or its coefficients are refused.
    #[error(transparent)]
    Edit(#[from] EditError),
    /// The samples do not suit the coefficients.
    #[error(transparent)]
    Lattice(#[from] LatticeError),
    /// The patch is refused.
    #[error(transparent)]
    Patch(#[from] PatchError),
    /// No function lies inside.
    #[error("axis {axis}: in a region of {count} cells nothing can move; take at least {MIN_CELLS} cells")]
    TooFewCells {
        /// Which axis.
        axis: usize,
        /// Cells asked for.
        count: u32,
    },
    /// Not in the field.
    #[error(
        "axis {axis}: the region takes {count} cells from cell {first} on, but the level ends after {cells} cells; move \
         the region or make it smaller"
    )]
    Outside {
        /// Which axis.
        axis: usize,
        /// First cell asked for.
        first: u32,
        /// Cells asked for.
        count: u32,
        /// Cells of the level.
        cells: u32,
    },
    /// Larger than memory allows for.
    #[error(
        "the region would have {count:?} {what}; at most {MAX_EDGE} on an axis and {MAX_SIZE} in all are possible: \
         use a coarser level or a smaller box"
    )]
    TooLarge {
        /// Cells or samples.
        what: &'static str,
        /// On each axis.
        count: [u64; 3],
    },
    /// A number of samples per cell that is not positive and finite.
    #[error(
        "{value} samples per cell on axis {axis}; the number has to be positive and finite (1 to 2 is usual)"
    )]
    SamplesPerCell {
        /// Which axis.
        axis: usize,
        /// Samples per cell asked for.
        value: f64,
    },
    /// Knots that do not lie on the cells.
    #[error(
        "axis {axis}: {count} cells cannot have a knot at every {stride} of them; take 1, 2, 4 or 8, and a multiple of that of {MIN_CELLS} \
         cells or more"
    )]
    Stride {
        /// Which axis.
        axis: usize,
        /// Cells from one knot to the next.
        stride: u32,
        /// Cells.
        count: u32,
    },
    /// Axes that are not perpendicular in the world.
    #[error(
        "two axes of the field are not perpendicular (the cosine of their angle is {cosine:.2e}), which springs need; \
         resample the field on a grid that is not sheared"
    )]
    Sheared {
        /// The largest cosine between two axes.
        cosine: f64,
    },
    /// Bricks of the level are missing and would reach out of the region.
    #[error(
        "the field has no functions of level {level} in cells {first:?} to {end:?}, and making them would change values \
         outside the region by rounding; take the box that `Cells::widened` gives"
    )]
    Spills {
        /// Level of the region.
        level: usize,
        /// First cell of the missing brick.
        first: [u32; 3],
        /// Behind its last cell.
        end: [u32; 3],
    },
    /// A tensor-product patch with coefficients that are not finite.
    #[error(transparent)]
    Tensor(#[from] TensorError),
    /// Baked onto a field that has another shape where the region is.
    #[error(
        "the field is not as it was where the region was cut out: perhaps this change is in it already, and baking it twice would \
         double it; bake onto the field that the region was cut from, or release the region"
    )]
    Changed,
    /// Two regions on the same cells.
    #[error(
        "cells {:?} + {:?} of level {} overlap those of region {index}, {:?} + {:?} of level {}; move one of them, or cut one region \
         that covers both", cells.first, cells.count, cells.level, with.first, with.count, with.level
    )]
    Overlaps {
        /// Asked for.
        cells: Cells,
        /// Number of the other region.
        index: usize,
        /// Its cells.
        with: Cells,
    },
    /// A number that no region has.
    #[error("there is no region {index}; the scene has {count}, numbered from 0")]
    NoRegion {
        /// The number.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// Moved to another level.
    #[error("a region of level {from} cannot go on at level {to}; release it and cut another")]
    OtherLevel {
        /// Level of the region.
        from: usize,
        /// Level asked for.
        to: usize,
    },
    /// Moved with a mask.
    #[error("a region with a mask stays where it is; release it, and cut another with a mask of its own")]
    Masked,
    /// Baked onto a field on other knots.
    #[error("the region was cut out of a field on another lattice; bake it onto a version of that field")]
    OtherLattice,
}
