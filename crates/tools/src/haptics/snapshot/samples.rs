//! Values of a field at the nodes of a grid, where they may be near the surface.

use bspline::Aabb;

use super::grid::Grid;
use super::surface::Surface;

/// Nodes along the edge of a block that is asked for at once.
const BLOCK: i64 = 8;

/// Which side of the surface each node is on, and `f − c` where it may be near.
#[derive(Clone, Debug)]
pub struct Samples {
    /// No number where a whole block lies on one side.
    pub values: Vec<f64>,
    pub inside: Vec<bool>,
}

/// What was known before, and where the field has changed since.
pub struct Before<'a, T> {
    pub known: &'a T,
    /// The nodes of what is known.
    pub grid: &'a Grid,
    /// Boxes of the field's own world outside which it has the bits that it had.
    pub changed: &'a [Aabb],
}

/// Whether two boxes have a point in common.
pub fn meet(a: &Aabb, b: &Aabb) -> bool {
    a.min.cmple(b.max).all() && b.min.cmple(a.max).all()
}

impl<T> Before<'_, T> {
    /// Nodes of the old grid before the first of the new one, on each axis.
    pub fn shift(&self, grid: &Grid) -> [i64; 3] {
        std::array::from_fn(|a| grid.first[a] - self.grid.first[a])
    }

    /// Place in the old lists of a node of the new grid.
    pub fn slot(&self, shift: [i64; 3], at: [usize; 3]) -> Option<usize> {
        let old: [i64; 3] = std::array::from_fn(|a| at[a] as i64 + shift[a]);
        let is_there = (0..3).all(|a| old[a] >= 0 && old[a] < self.grid.count[a] as i64);
        is_there.then(|| self.grid.slot(old.map(|n| n as usize)))
    }
}

impl Samples {
    /// Asks block by block, where a block does not lie on one side as a whole. Blocks lie still in the world, so that what is found
    /// at a node depends on the field alone.
    pub fn new(surface: &Surface<'_>, grid: &Grid, before: Option<&Before<'_, Self>>) -> Self {
        let frame = surface.frame(grid);
        let mut all = Self {
            values: vec![f64::NAN; grid.len()],
            inside: vec![false; grid.len()],
        };
        let last: [i64; 3] = std::array::from_fn(|a| grid.first[a] + grid.count[a] as i64);
        let blocks: [Vec<i64>; 3] = std::array::from_fn(|a| {
            (grid.first[a].div_euclid(BLOCK)..=(last[a] - 1).div_euclid(BLOCK)).collect()
        });
        let mut values = Vec::new();
        for &x in &blocks[0] {
            for &y in &blocks[1] {
                for &z in &blocks[2] {
                    let lo = [x, y, z].map(|b| b * BLOCK);
                    let hi = lo.map(|l| l + BLOCK);
                    let from: [i64; 3] = std::array::from_fn(|a| lo[a].max(grid.first[a]));
                    let part = Part {
                        at: std::array::from_fn(|a| (from[a] - grid.first[a]) as usize),
                        count: std::array::from_fn(|a| (hi[a].min(last[a]) - from[a]) as usize),
                    };
                    let own = frame.world_box(lo, hi);
                    if let Some(before) = before
                        && !before.changed.iter().any(|b| meet(b, &own))
                        && all.copy(grid, &part, before)
                    {
                        continue;
                    }
                    let range = surface.field().frame_bounds_about(&frame, lo, hi, surface.iso());
                    let is_crossed = range.lo <= surface.iso() && range.hi > surface.iso();
                    let is_inside = range.lo > surface.iso();
                    values.clear();
                    values.resize(part.count.iter().product(), f64::NAN);
                    if is_crossed {
                        surface
                            .field()
                            .frame_values(&frame, from, part.count, &mut values);
                        values.iter_mut().for_each(|v| *v -= surface.iso());
                    }
                    for (row, values) in values.chunks_exact(part.count[2]).enumerate() {
                        let to = part.row(grid, row);
                        all.values[to.clone()].copy_from_slice(values);
                        for (inside, value) in all.inside[to].iter_mut().zip(values) {
                            *inside = if is_crossed { *value > 0.0 } else { is_inside };
                        }
                    }
                }
            }
        }
        all
    }

    /// Copies what was known of a block; false if that is not all of it.
    fn copy(&mut self, grid: &Grid, part: &Part, before: &Before<'_, Self>) -> bool {
        let shift = before.shift(grid);
        let end = std::array::from_fn(|a| part.at[a] + part.count[a] - 1);
        if before.slot(shift, part.at).is_none() || before.slot(shift, end).is_none() {
            return false;
        }
        for row in 0..part.count[0] * part.count[1] {
            let to = part.row(grid, row);
            let from = before
                .slot(shift, grid.node(to.start))
                .expect("both ends are known");
            let from = from..from + part.count[2];
            self.values[to.clone()].copy_from_slice(&before.known.values[from.clone()]);
            self.inside[to].copy_from_slice(&before.known.inside[from]);
        }
        true
    }
}

/// The part of a block that lies in a grid.
struct Part {
    at: [usize; 3],
    count: [usize; 3],
}

impl Part {
    /// Places in lists of a row along z.
    fn row(&self, grid: &Grid, row: usize) -> std::ops::Range<usize> {
        let [x, y, z] = self.at;
        let start = grid.slot([x + row / self.count[1], y + row % self.count[1], z]);
        start..start + self.count[2]
    }
}
