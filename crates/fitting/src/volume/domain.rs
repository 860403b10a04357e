//! The three axes of a volume, its samples, and how work is cut into slabs.

use bspline::Real;

use super::axis::Axis;
use super::rows::{FiveTaps, Phases};
use super::voxels::Voxels;

/// Planes of the finest level that one task works on. Fixed, so that no result depends on the thread count;
/// 48 planes cost 8 % of repeated halo work, and a volume of 181 planes gives four tasks. A multiple of
/// [`LEAF`], so that the leaves of two tasks do not share voxels.
pub(crate) const SLAB: usize = 48;
/// Voxels along a leaf, the cell that residuals are reported of.
pub(crate) const LEAF: usize = 4;

/// Grids of a volume fit: axes, filters of the finest level.
#[derive(Clone, Debug)]
pub(crate) struct Domain<T> {
    pub axes: [Axis; 3],
    pub taps: [FiveTaps<T>; 3],
}

impl<T: Real> Domain<T> {
    /// A volume of `samples` voxels, `levels >= 2` dyadic levels down to the voxel spacing.
    pub fn new(samples: [usize; 3], levels: usize) -> Self {
        let axes = samples.map(|n| Axis::new(n, levels));
        let taps = std::array::from_fn(|a| FiveTaps::new(&axes[a].five_taps()));
        Self { axes, taps }
    }

    pub fn levels(&self) -> usize {
        self.axes[0].levels
    }

    /// Number of the finest level, whose knots are the voxels.
    pub fn finest(&self) -> usize {
        self.levels() - 1
    }

    /// Functions of `level` along each axis.
    pub fn functions(&self, level: usize) -> [usize; 3] {
        [0, 1, 2].map(|a| self.axes[a].functions(level))
    }

    /// Functions of `level`.
    pub fn function_count(&self, level: usize) -> usize {
        self.functions(level).iter().product()
    }

    /// Voxels along each axis.
    pub fn samples(&self) -> [usize; 3] {
        self.axes.map(|a| a.samples)
    }

    /// Samples along each axis, padding included.
    pub fn padded(&self) -> [usize; 3] {
        self.axes.map(|a| a.padded())
    }

    /// Layout of rows of `level` along x, refined from the level before.
    pub fn phases(&self, level: usize) -> Phases {
        Phases::new(self.axes[0].cells_at(level - 1))
    }
}

/// Voxel values of the caller, scaled by a power of two and continued by the edge value into the padding.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Samples<'a, T> {
    pub values: Voxels<'a>,
    pub dims: [usize; 3],
    /// Power of two that brings the largest magnitude into `[1/2, 1)`: squares neither overflow nor vanish.
    pub scale: T,
}

impl<T: Real> Samples<'_, T> {
    /// Row `(y, z)` into `out`, which may be longer than the volume is wide.
    #[inline(always)]
    pub fn row(&self, y: usize, z: usize, out: &mut [T]) {
        let [nx, ny, nz] = self.dims;
        let (inside, beyond) = out.split_at_mut(nx);
        self.values
            .row(self.dims, y.min(ny - 1), z.min(nz - 1), self.scale, inside);
        beyond.fill(inside[nx - 1]);
    }
}
