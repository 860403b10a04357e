//! Which cells of a hierarchy a region takes.

use bspline::hierarchical::{BRICK, BrickKey};
use bspline::{HierarchicalSpline, Real};
use serde::{Deserialize, Serialize};

use super::RegionError;

/// Least cells on an axis: one function lies inside four of them.
pub const MIN_CELLS: u32 = 4;
/// Most cells, and most samples, of a region: at this size a patch in single precision takes some gigabytes.
pub const MAX_SIZE: u64 = 1 << 24;
/// Most cells, and most samples, on an axis: its matrices are dense where a patch is set up.
pub const MAX_EDGE: u64 = 512;

/// A box of cells of one level of a hierarchy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Cells {
    /// Level, 0 the coarsest; may be finer than the field was so far.
    pub level: usize,
    /// First cell on each axis.
    pub first: [u32; 3],
    /// Cells on each axis, at least [`MIN_CELLS`].
    pub count: [u32; 3],
}

impl Cells {
    /// Refuses boxes that are too small, too large or not in the field.
    pub(super) fn check<T: Real>(&self, field: &HierarchicalSpline<T>) -> Result<(), RegionError> {
        // No coefficients are asked for, only whether the lattice can have the level.
        field.level_coefficients(self.level, [0; 3], [0; 3])?;
        let cells = field.lattice().cells_at(self.level);
        for (axis, &cells) in cells.iter().enumerate() {
            let (first, count) = (self.first[axis], self.count[axis]);
            if count < MIN_CELLS {
                return Err(RegionError::TooFewCells { axis, count });
            }
            if first.checked_add(count).is_none_or(|end| end > cells) {
                return Err(RegionError::Outside {
                    axis,
                    first,
                    count,
                    cells,
                });
            }
        }
        size("cells", self.count.map(u64::from))
    }

    /// The least box round this one beside which baking changes no bit of `field`.
    ///
    /// Where the field has no bricks of the level yet, baking makes them, and all levels between, and what they cover is
    /// from then on evaluated at the new level: the same but for rounding. The box takes in all such bricks.
    /// Outside the lattice, what lies behind a face of the box counts as the box.
    ///
    /// # Errors
    /// [`RegionError`] for a box that is not in the field, or becomes too large.
    pub fn widened<T: Real>(mut self, field: &HierarchicalSpline<T>) -> Result<Self, RegionError> {
        self.check(field)?;
        while let Some((first, end)) = self.spilled_brick(field) {
            for a in 0..3 {
                let stop = (self.first[a] + self.count[a]).max(end[a]);
                self.first[a] = self.first[a].min(first[a]);
                self.count[a] = stop - self.first[a];
            }
            self.check(field)?;
        }
        Ok(self)
    }

    /// The first brick, coarsest level first, that baking would make and that reaches out of the box: its first cell and
    /// the one behind its last, in cells of the region's level.
    pub(super) fn spilled_brick<T: Real>(
        &self,
        field: &HierarchicalSpline<T>,
    ) -> Option<([u32; 3], [u32; 3])> {
        let cells = field.lattice().cells_at(self.level);
        for level in 1..=self.level {
            let shift = self.level - level;
            let width = (BRICK as u64) << shift;
            let range = |a: usize| {
                let (first, last) = (self.first[a], self.first[a] + self.count[a] - 1);
                (u64::from(first) / width) as u32..=(u64::from(last) / width) as u32
            };
            for x in range(0) {
                for y in range(1) {
                    for z in range(2) {
                        let key = [x, y, z];
                        if field.brick(level, BrickKey(key)).is_some() {
                            continue;
                        }
                        let low = key.map(|k| (u64::from(k) * width) as u32);
                        let high = std::array::from_fn(|a| {
                            let end = (u64::from(key[a]) + 1) * width;
                            end.min(u64::from(cells[a])) as u32
                        });
                        let inside = (0..3)
                            .all(|a| self.first[a] <= low[a] && high[a] <= self.first[a] + self.count[a]);
                        if !inside {
                            return Some((low, high));
                        }
                    }
                }
            }
        }
        None
    }
}

/// Refuses more than [`MAX_EDGE`] and [`MAX_SIZE`].
pub(super) fn size(what: &'static str, count: [u64; 3]) -> Result<(), RegionError> {
    let product = count.iter().fold(1u64, |p, &n| p.saturating_mul(n));
    if product > MAX_SIZE || count.iter().any(|n| *n > MAX_EDGE) {
        return Err(RegionError::TooLarge { what, count });
    }
    Ok(())
}
