//! Which knots of a level belong to the box.

use bspline::hierarchical::Lattice;
use bspline::{Aabb, Frame};
use glam::{DAffine3, DVec3};

/// The knots of one level about the box.
#[derive(Clone, Copy)]
pub(super) struct Region<'a> {
    pub lattice: &'a Lattice,
    pub level: usize,
    /// Finest level that may be used.
    pub finest: usize,
    /// The box, in lattice coordinates.
    pub within: &'a Aabb,
    /// Half an interval beside the knots: the middles of cells.
    pub is_between: bool,
    /// Whether functions whose supports lie in a world box may change.
    pub is_free: &'a (dyn Fn(&Aabb) -> bool + Sync),
}

impl Region<'_> {
    /// First and last knot on each axis that lie in the box and the lattice.
    pub fn judged(&self) -> ([i64; 3], [i64; 3]) {
        let shift = if self.is_between { -0.5 } else { 0.0 };
        let (lo, hi) = self.knots_in(0.0, 0, shift);
        let last = self.last();
        (lo.map(|k| k.max(0)), std::array::from_fn(|a| hi[a].min(last[a])))
    }

    /// First and last knot of functions whose support stays within the box and two finest cells beside it, which is one
    /// support of the finest level.
    pub fn allowed(&self) -> ([i64; 3], [i64; 3]) {
        self.knots_in(2.0 * self.spacing(self.finest), 2, 0.0)
    }

    /// Whether all functions centred on the knots `lo ..= hi` may change.
    pub fn are_free(&self, lo: [i64; 3], hi: [i64; 3]) -> bool {
        let limit = self.lattice.extent();
        let end = |knot: [i64; 3], reach: i64| {
            let knots = DVec3::from_array(knot.map(|k| (k + reach) as f64));
            (knots * self.spacing(self.level)).clamp(DVec3::ZERO, limit)
        };
        let supports = Aabb::new(end(lo, -2), end(hi, 2));
        (self.is_free)(&supports.transformed(&self.lattice.world_from_lattice))
    }

    /// First and last knot at which values are asked for: one about all of the others.
    pub fn sampled(&self) -> ([i64; 3], [i64; 3]) {
        let ((lo, hi), (first, last)) = (self.judged(), self.allowed());
        (
            std::array::from_fn(|a| lo[a].min(first[a]) - 1),
            std::array::from_fn(|a| hi[a].max(last[a]) + 1),
        )
    }

    /// Last knot of the lattice's own box on each axis; coefficients do not reach further.
    pub fn last(&self) -> [i64; 3] {
        let cells = self.lattice.cells_at(self.level).map(i64::from);
        cells.map(|n| if self.is_between { n - 1 } else { n })
    }

    /// The knots as nodes of a grid.
    pub fn frame(&self) -> Frame {
        let scale = DAffine3::from_scale(DVec3::splat(self.spacing(self.level)));
        let shift = DAffine3::from_translation(DVec3::splat(if self.is_between { 0.5 } else { 0.0 }));
        Frame {
            world_from_grid: self.lattice.world_from_lattice * scale * shift,
            cells: [1; 3],
        }
    }

    /// Width of a cell of a level, in lattice coordinates.
    pub fn spacing(&self, level: usize) -> f64 {
        1.0 / (1u64 << level) as f64
    }

    /// The same in the world, along the axis where it is widest.
    pub fn world_spacing(&self, level: usize) -> f64 {
        self.lattice.spacing(level).max_element()
    }

    /// Knots of the box widened by `reach` but for the outer `rim`; up to the lattice's last functions where the box
    /// reaches its faces. Knots lie `shift` beside where they would.
    fn knots_in(&self, reach: f64, rim: i64, shift: f64) -> ([i64; 3], [i64; 3]) {
        let spacing = self.spacing(self.level);
        let last = self.lattice.cells_at(self.level).map(|n| i64::from(n) + 1);
        let extent = self.lattice.extent();
        let lo = std::array::from_fn(|a| {
            let start = self.within.min[a];
            match start <= 0.0 {
                true => -1,
                false => ((start - reach) / spacing + shift).ceil() as i64 + rim,
            }
        });
        let hi = std::array::from_fn(|a| {
            let end = self.within.max[a];
            match end >= extent[a] {
                true => last[a],
                false => (((end + reach) / spacing + shift).floor() as i64 - rim).min(last[a]),
            }
        });
        (lo, hi)
    }
}
