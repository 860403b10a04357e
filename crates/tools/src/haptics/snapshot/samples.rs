//! Values of a field at the nodes of a grid, where they may be near the surface.

use bspline::{Aabb, Frame};

use super::grid::Grid;
use super::region::Region;
use super::surface::Surface;

/// Nodes along the edge of a block that is asked for at once. Blocks lie still in the world, so that what is found at a node depends on the
/// field alone.
pub const BLOCK: i64 = 8;

/// Which side of the surface each node is on, and `f − c` where it may be near.
#[derive(Clone, Debug)]
pub struct Samples {
    /// No number where a whole block lies on one side.
    pub values: Vec<f32>,
    pub inside: Vec<bool>,
}

/// Whether two boxes have a point in common.
fn meet(a: &Aabb, b: &Aabb) -> bool {
    a.min.cmple(b.max).all() && b.min.cmple(a.max).all()
}

/// The blocks that meet a grid, by number.
pub fn blocks(grid: &Grid) -> impl Iterator<Item = [i64; 3]> + use<> {
    let range = |a: usize| {
        let last = grid.first[a] + grid.count[a] as i64 - 1;
        grid.first[a].div_euclid(BLOCK)..=last.div_euclid(BLOCK)
    };
    let [x, y, z] = [range(0), range(1), range(2)];
    x.flat_map(move |x| {
        let (y, z) = (y.clone(), z.clone());
        y.flat_map(move |y| z.clone().map(move |z| [x, y, z]))
    })
}

/// The nodes of a block that are in a grid.
pub fn nodes_of(block: [i64; 3], grid: &Grid) -> Region {
    let end = |n: i64, a: usize| (n * BLOCK - grid.first[a]).clamp(0, grid.count[a] as i64) as usize;
    Region {
        lo: std::array::from_fn(|a| end(block[a], a)),
        end: std::array::from_fn(|a| end(block[a] + 1, a)),
    }
}

impl Samples {
    /// Nothing asked yet.
    fn empty(grid: &Grid) -> Self {
        Self {
            values: vec![0.0; grid.len()],
            inside: vec![false; grid.len()],
        }
    }

    /// At all nodes of a grid.
    pub fn new(surface: &Surface<'_>, grid: &Grid) -> Self {
        let mut all = Self::empty(grid);
        let frame = surface.frame(grid);
        let mut values = Vec::new();
        blocks(grid).for_each(|block| {
            all.ask(surface, grid, &frame, block, &mut values);
        });
        all
    }

    /// The same on another grid; only where nothing is known or the field has `changed` it is asked.
    pub fn moved(&self, surface: &Surface<'_>, old: &Grid, grid: &Grid, changed: &[Aabb]) -> Self {
        let mut all = Self::empty(grid);
        let frame = surface.frame(grid);
        let mut values = Vec::new();
        for block in blocks(grid) {
            if has_changed(&frame, block, changed) || !all.copy(self, old, grid, block) {
                all.ask(surface, grid, &frame, block, &mut values);
            }
        }
        all
    }

    /// Asks where the field has `changed`. Returns where anything is other than it was.
    pub fn renew(&mut self, surface: &Surface<'_>, grid: &Grid, changed: &[Aabb]) -> Region {
        let frame = surface.frame(grid);
        let (mut values, mut found) = (Vec::new(), Region::NONE);
        for block in blocks(grid).filter(|block| has_changed(&frame, *block, changed)) {
            found = found.hull(self.ask(surface, grid, &frame, block, &mut values));
        }
        found
    }

    fn ask(
        &mut self,
        surface: &Surface<'_>,
        grid: &Grid,
        frame: &Frame,
        block: [i64; 3],
        values: &mut Vec<f64>,
    ) -> Region {
        let (lo, part) = (block.map(|b| b * BLOCK), nodes_of(block, grid));
        let iso = surface.iso();
        let range = surface
            .field()
            .frame_bounds_about(frame, lo, lo.map(|l| l + BLOCK), iso);
        let is_crossed = range.lo <= iso && range.hi > iso;
        let is_inside = range.lo > iso;
        values.clear();
        values.resize(part.len(), f64::NAN);
        if is_crossed {
            let from: [i64; 3] = std::array::from_fn(|a| grid.first[a] + part.lo[a] as i64);
            surface.field().frame_values(frame, from, part.count(), values);
        }
        let mut found = Region::NONE;
        let rows = part.rows(grid).zip(values.chunks_exact(part.count()[2]));
        for ((at, slots), values) in rows {
            let known = self.values[slots.clone()].iter_mut().zip(&mut self.inside[slots]);
            for (z, ((old, inside), value)) in known.zip(values).enumerate() {
                let value = value - iso;
                let now = (value as f32, if is_crossed { value > 0.0 } else { is_inside });
                if (old.to_bits(), *inside) != (now.0.to_bits(), now.1) {
                    found.add([at[0], at[1], at[2] + z]);
                }
                (*old, *inside) = now;
            }
        }
        found
    }

    /// Copies what was known of a block; false if that is not all of it.
    fn copy(&mut self, from: &Self, old: &Grid, grid: &Grid, block: [i64; 3]) -> bool {
        let part = nodes_of(block, grid);
        let last = part.end.map(|n| n - 1);
        let [Some(first), Some(_)] = [part.lo, last].map(|at| old.find(grid.number(at))) else {
            return false;
        };
        for (at, slots) in part.rows(grid) {
            let start = old.slot(std::array::from_fn(|a| first[a] + at[a] - part.lo[a]));
            let there = start..start + slots.len();
            self.values[slots.clone()].copy_from_slice(&from.values[there.clone()]);
            self.inside[slots].copy_from_slice(&from.inside[there]);
        }
        true
    }
}

/// Whether a block meets a box of the field's own world.
fn has_changed(frame: &Frame, block: [i64; 3], changed: &[Aabb]) -> bool {
    let lo = block.map(|b| b * BLOCK);
    let own = frame.world_box(lo, lo.map(|l| l + BLOCK));
    changed.iter().any(|b| meet(b, &own))
}
