//! Where a field may have changed.

use glam::DVec3;

use super::grid::{Cells, Grids, octant_place};
use crate::Aabb;
use crate::polygonize::blocks::{BlockKey, CELLS};

/// Boxes in which a field may have changed, in the coordinates of the finest cells.
pub(super) struct Changed {
    boxes: Vec<[DVec3; 2]>,
    depth: usize,
}

/// Share of a finest cell by which a box is widened: the rounding of positions stays far below.
const MARGIN: f64 = 1e-6;

/// Cells by which an octant is widened to find what its cells are judged by.
const JUDGED_BY: f64 = 1.0;

impl Changed {
    /// `None` if a box has no bounds.
    pub fn new(grids: &Grids, boxes: &[Aabb]) -> Option<Self> {
        let depth = grids.depth();
        let grid_from_world = grids.frames[depth].world_from_grid.inverse();
        let boxes = boxes.iter().map(|b| {
            let b = b.transformed(&grid_from_world);
            let is_known = b.min.is_finite() && b.max.is_finite();
            is_known.then_some([b.min - MARGIN, b.max + MARGIN])
        });
        let boxes = boxes.collect::<Option<_>>()?;
        Some(Self { boxes, depth })
    }

    pub fn everywhere(depth: usize) -> Self {
        let boxes = vec![[DVec3::NEG_INFINITY, DVec3::INFINITY]];
        Self { boxes, depth }
    }

    /// Numbers of all boxes.
    pub fn all(&self) -> Vec<u32> {
        (0..self.boxes.len() as u32).collect()
    }

    fn scale(&self, level: usize) -> f64 {
        ((self.depth - level) as f64).exp2()
    }

    /// Those of some boxes that meet a block of `level`, ends included, within `reach` cells.
    pub fn meeting(&self, level: usize, key: BlockKey, reach: f64, among: &[u32]) -> Vec<u32> {
        let lo = key.map(|b| f64::from(b) * CELLS as f64);
        let among = among.iter().copied();
        among
            .filter(|b| self.meets(level, lo, CELLS as f64, reach, *b))
            .collect()
    }

    /// Cells of a block that some of the boxes meet within `reach` cells, ends included.
    pub fn cells(&self, level: usize, key: BlockKey, reach: f64, among: &[u32]) -> Cells {
        let scale = self.scale(level);
        let mut found = [0; CELLS];
        for &b in among {
            let [min, max] = self.boxes[b as usize];
            // Cells from the first to the last on each axis; too far ones saturate.
            let range = |a: usize| {
                let start = f64::from(key[a]) * CELLS as f64;
                let first = (min[a] / scale - reach - start - 1.0).ceil().max(0.0) as usize;
                let end = (max[a] / scale + reach - start).floor().max(-1.0) + 1.0;
                first..(end as usize).min(CELLS)
            };
            let [x, y, z] = [range(0), range(1), range(2)];
            let plane = y.fold(0u64, |word, j| {
                z.clone().fold(word, |word, k| word | 1 << (CELLS * j + k))
            });
            x.for_each(|i| found[i] |= plane);
        }
        found
    }

    /// Whether box `b` meets `size` cells of `level` from the place `lo`, ends included, within `reach` cells.
    pub fn meets(&self, level: usize, lo: [f64; 3], size: f64, reach: f64, b: u32) -> bool {
        let scale = self.scale(level);
        let [min, max] = self.boxes[b as usize];
        let low = (DVec3::from_array(lo) - reach) * scale;
        let high = (DVec3::from_array(lo) + (size + reach)) * scale;
        low.cmple(max).all() && high.cmpge(min).all()
    }

    /// First and last node of a block in the frame that some of the boxes may hold, and the octants whose cells are
    /// judged by what lies in them.
    pub fn within(
        &self,
        grids: &Grids,
        level: usize,
        key: BlockKey,
        among: &[u32],
    ) -> (([i64; 3], [i64; 3]), u8) {
        let scale = self.scale(level);
        let (lo, hi) = grids.clipped(level, key.map(|b| b * CELLS as i32), CELLS as i32);
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let mut stale = 0;
        for &b in among {
            let [low, high] = self.boxes[b as usize];
            (min, max) = (min.min(low / scale), max.max(high / scale));
            for octant in 0..8 {
                let at = octant_place(octant);
                let first = std::array::from_fn(|a| f64::from(key[a]) * CELLS as f64 + at[a] as f64);
                let is_met = self.meets(level, first, 0.5 * CELLS as f64, JUDGED_BY, b);
                stale |= u8::from(is_met) << octant;
            }
        }
        // Saturates beyond the numbers there are.
        let first = std::array::from_fn(|a| lo[a].max(min[a].ceil() as i64));
        let last = std::array::from_fn(|a| hi[a].min(max[a].floor() as i64));
        ((first, last), stale)
    }
}
