//! Blocks of 8³ cells and the search for those that may hold surface.

use std::ops::ControlFlow;

use rayon::prelude::*;

use super::{PolygonizeError, PolygonizeOptions};
use crate::{Aabb, Field, Frame};

/// Cells along a block's edge. 8, because the crossed edges of one layer then fill one 64-bit word, and between
/// more values and more bounds: a sphere of 410 cells across, with exact bounds, takes 49 k blocks of 4³ cells and
/// 6.2 M values, 12 k of 8³ and 9.0 M, 3 k of 16³ and 15.0 M; one interval of a spline costs as much as 100 values.
pub(super) const CELLS: usize = 8;
/// Nodes along a block's edge, shared ones included.
pub(super) const NODES: usize = CELLS + 1;
/// Nodes up to which a block is sampled without asking for bounds, which cost as much: two layers, as the border of a frame leaves.
const FEW_NODES: i64 = (2 * NODES * NODES) as i64;
/// Most cells of a frame on an axis; positions keep 1e-9 of a cell in double precision.
pub(super) const MAX_CELLS: u32 = 1 << 22;

/// Place of a block: it holds the cells `8b .. 8b + 8` of the frame on each axis.
pub(super) type BlockKey = [i32; 3];

/// First node of an edge, counted from its block's first node, and its axis.
pub(super) type Edge = ([usize; 3], usize);

/// What a block adds to the report.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct BlockCounts {
    pub cells_crossed: u32,
    pub root_evaluations: u32,
    pub cap_vertices: u32,
    pub unconverged: u32,
}

/// The blocks of a frame.
///
/// A block owns the nodes `8b .. 8b + 8` and the edges that start there. Where the surface is capped, the nodes
/// beyond the frame are outside, and the layers of cells `-1` and `n` between them and the frame hold the cap;
/// block `-1` is there for the first of them.
#[derive(Clone, Copy)]
pub(super) struct BlockGrid<'a> {
    pub frame: &'a Frame,
    pub open: bool,
}

impl BlockGrid<'_> {
    fn cells(&self, axis: usize) -> i64 {
        self.frame.cells[axis] as i64
    }

    /// First block and one past the last on an axis.
    fn range(&self, axis: usize) -> [i32; 2] {
        [
            if self.open { 0 } else { -1 },
            (self.cells(axis) / CELLS as i64) as i32 + 1,
        ]
    }

    /// Whether the frame has such a block.
    pub fn contains(&self, block: BlockKey) -> bool {
        (0..3).all(|a| {
            let [lo, hi] = self.range(a);
            (lo..hi).contains(&block[a])
        })
    }

    /// First node of a block.
    pub fn origin(&self, block: BlockKey) -> [i64; 3] {
        block.map(|b| b as i64 * CELLS as i64)
    }

    /// First and last node of a block that lie in the frame.
    pub fn frame_nodes(&self, block: BlockKey) -> ([i64; 3], [i64; 3]) {
        let at = self.origin(block);
        (
            at.map(|a| a.max(0)),
            [0, 1, 2].map(|a| (at[a] + CELLS as i64).min(self.cells(a))),
        )
    }

    /// Cells of a block on each axis that are meshed, counted from its first node.
    pub fn meshed_cells(&self, block: BlockKey) -> [usize; 3] {
        if !self.open {
            return [CELLS; 3];
        }
        let at = self.origin(block);
        [0, 1, 2].map(|a| (self.cells(a) - at[a]).clamp(0, CELLS as i64) as usize)
    }

    /// Cells of a block that lie in the frame.
    pub fn frame_cells(&self, block: BlockKey) -> u64 {
        let (lo, hi) = self.frame_nodes(block);
        (0..3).map(|a| (hi[a] - lo[a]).max(0) as u64).product()
    }
}

/// A cube of `2^level` blocks on an axis whose first block is `2^level · key`, cut to the frame's blocks.
struct Octant {
    lo: [i64; 3],
    hi: [i64; 3],
    reaches_beyond: bool,
}

impl Octant {
    fn new(grid: &BlockGrid, key: BlockKey, level: u32) -> Option<Self> {
        let mut octant = Self {
            lo: [0; 3],
            hi: [0; 3],
            reaches_beyond: false,
        };
        for a in 0..3 {
            let [first, end] = grid.range(a);
            let lo = ((key[a] as i64) << level).max(first as i64);
            let hi = ((key[a] as i64 + 1) << level).min(end as i64);
            if lo >= hi {
                return None;
            }
            let (node_lo, node_hi) = (lo * CELLS as i64, hi * CELLS as i64);
            octant.reaches_beyond |= !grid.open && (node_lo < 0 || node_hi > grid.cells(a));
            octant.lo[a] = node_lo.max(0);
            octant.hi[a] = node_hi.min(grid.cells(a));
        }
        Some(octant)
    }

    fn nodes(&self) -> i64 {
        (0..3).map(|a| self.hi[a] - self.lo[a] + 1).product()
    }

    /// Whether a node of it may be inside and another outside. An unknown bound (NaN) excludes nothing.
    ///
    /// Most octants with surface show it at their corners, which cost less than bounds.
    fn may_hold_surface(&self, field: &dyn Field, frame: &Frame, iso: f64) -> bool {
        let ends = [self.lo, self.hi];
        let corner = |c: usize| [0, 1, 2].map(|a| ends[c >> a & 1][a]);
        let is_inside = |c: usize| field.value(frame.node(corner(c))) > iso;
        let first = is_inside(0);
        if (first && self.reaches_beyond) || (1..8).rev().any(|c| is_inside(c) != first) {
            return true;
        }
        let bounds = field.frame_bounds_about(frame, self.lo, self.hi, iso);
        let all_outside = bounds.hi <= iso;
        let all_inside = bounds.lo > iso && !self.reaches_beyond;
        !(all_outside || all_inside)
    }
}

/// Blocks in which a field may have changed, and the octants above them: sorted keys for each level, finest first.
pub(super) struct Dirty(Vec<Vec<BlockKey>>);

/// Most blocks that are told apart; with more of them all are taken to be dirty.
const MAX_DIRTY: u64 = 1 << 21;

/// Share of a cell by which a changed box is widened: the rounding of positions stays far below.
const MARGIN: f64 = 1e-6;

impl Dirty {
    /// The blocks whose closed boxes meet one of `boxes` (world coordinates). `None`: all blocks.
    pub fn new(grid: &BlockGrid, boxes: &[Aabb]) -> Option<Self> {
        let grid_from_world = grid.frame.world_from_grid.inverse();
        let mut keys: Vec<BlockKey> = Vec::new();
        let mut ranges: Vec<[[i32; 2]; 3]> = Vec::with_capacity(boxes.len());
        let mut count = 0;
        for b in boxes {
            let b = b.transformed(&grid_from_world);
            if !(b.min.is_finite() && b.max.is_finite()) {
                return None;
            }
            let range: [[i32; 2]; 3] = std::array::from_fn(|a| {
                let [first, end] = grid.range(a);
                let blocks = [b.min[a] - MARGIN, b.max[a] + MARGIN].map(|x| x / CELLS as f64);
                // A block holds the nodes at both of its ends.
                let lo = (blocks[0].ceil() - 1.0).max(first as f64) as i32;
                let hi = (blocks[1].floor() + 1.0).min(end as f64) as i32;
                [lo, hi.max(lo)]
            });
            count += range.iter().map(|[lo, hi]| (hi - lo) as u64).product::<u64>();
            if count > MAX_DIRTY {
                return None;
            }
            ranges.push(range);
        }
        // Neighbouring bricks share most of their blocks.
        ranges.sort_unstable();
        ranges.dedup();
        for [x, y, z] in ranges {
            keys.extend(
                (x[0]..x[1])
                    .flat_map(|i| (y[0]..y[1]).flat_map(move |j| (z[0]..z[1]).map(move |k| [i, j, k]))),
            );
        }
        let mut levels = Vec::new();
        loop {
            keys.sort_unstable();
            keys.dedup();
            let parents = keys.iter().map(|k| k.map(|b| b >> 1)).collect();
            let done = keys.iter().all(|k| k.iter().all(|b| (-1..=0).contains(b)));
            levels.push(std::mem::replace(&mut keys, parents));
            if done {
                return Some(Self(levels));
            }
        }
    }

    /// The blocks, in order.
    pub fn blocks(&self) -> &[BlockKey] {
        &self.0[0]
    }

    /// Whether a block of the octant `key` of `level` may have changed.
    pub fn contains(&self, level: u32, key: BlockKey) -> bool {
        // Above the last level the octants are the eight about the origin, as on it.
        let keys = &self.0[(level as usize).min(self.0.len() - 1)];
        keys.binary_search(&key).is_ok()
    }
}

/// Octants tested between two looks at the caller's wish to stop.
const STRIDE: usize = 1 << 14;

/// Blocks, only `dirty` ones if given, whose closed box the field's bounds cannot exclude, sorted; and how many bounds
/// were asked.
///
/// Descends the octree of blocks level by level, so that the list stays proportional to the surface.
pub(super) fn find_blocks(
    field: &dyn Field,
    grid: &BlockGrid,
    options: &PolygonizeOptions,
    dirty: Option<&Dirty>,
    mut go_on: impl FnMut(f64) -> ControlFlow<()>,
) -> Result<(Vec<BlockKey>, u64), PolygonizeError> {
    let blocks = (0..3).map(|a| grid.range(a)[1] as u32).max().expect("three axes");
    let top = u32::BITS - (blocks - 1).leading_zeros();
    // The parents of level `top`: one for the blocks from 0 on, and -1 for the layer before them.
    let mut octants = vec![[-1, -1, -1], [-1, -1, 0], [-1, 0, -1], [-1, 0, 0]];
    octants.extend([[0, -1, -1], [0, -1, 0], [0, 0, -1], [0, 0, 0]]);
    let mut queries = 0;
    for level in (0..=top).rev() {
        let mut kept: Vec<BlockKey> = Vec::new();
        for part in octants.chunks(STRIDE) {
            let tested: Vec<(BlockKey, bool)> = part
                .par_iter()
                .with_min_len(16)
                .filter(|key| dirty.is_none_or(|d| d.contains(level, **key)))
                .filter_map(|&key| Some((key, Octant::new(grid, key, level)?)))
                .map(|(key, octant)| {
                    let is_unasked = level == 0 && octant.nodes() <= FEW_NODES;
                    let keep = is_unasked || octant.may_hold_surface(field, grid.frame, options.iso);
                    (key, keep)
                })
                .collect();
            queries += tested.len() as u64;
            kept.extend(tested.into_iter().filter_map(|(key, keep)| keep.then_some(key)));
            if kept.len() > options.max_blocks {
                return Err(PolygonizeError::TooManyBlocks {
                    limit: options.max_blocks,
                });
            }
            if go_on((top - level) as f64 / (top + 1) as f64).is_break() {
                return Err(PolygonizeError::Cancelled);
            }
        }
        octants = if level == 0 {
            kept
        } else {
            let child =
                |k: BlockKey, o: i32| [2 * k[0] + (o >> 2), 2 * k[1] + (o >> 1 & 1), 2 * k[2] + (o & 1)];
            kept.iter()
                .flat_map(|&k| (0..8).map(move |o| child(k, o)))
                .collect()
        };
    }
    octants.sort_unstable();
    Ok((octants, queries))
}
