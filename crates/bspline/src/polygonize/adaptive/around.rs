//! A block with the cells about it, and the finer nodes on the faces of its own.

use super::grid::{Cells, NONE};
use super::tree::{Block, Tree};
use crate::polygonize::blocks::{CELLS, NODES};

/// Rows of cells, own and those next to them, on an axis.
const ROWS: usize = CELLS + 2;

/// Which cells about a block exist on its level, and which of them are split.
///
/// Row `(x, y)` is for `x, y` in `-1 ..= 8`; bit `z + 1` of it for `z` in the same range.
pub(super) struct Around<'a> {
    pub tree: &'a Tree,
    pub level: usize,
    pub block: &'a Block,
    exists: [u16; ROWS * ROWS],
    split: [u16; ROWS * ROWS],
}

/// State of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    /// Part of a leaf of the level before.
    Coarse,
    /// A leaf.
    Leaf,
    /// Divided.
    Split,
}

#[inline(always)]
fn row_of(x: i32, y: i32) -> usize {
    (x + 1) as usize * ROWS + (y + 1) as usize
}

/// Number of the neighbour in which a cell beside the block lies.
#[inline(always)]
pub(super) fn neighbour_of(c: [i32; 3]) -> usize {
    let [x, y, z] = c.map(|c| ((c >> 3) + 1) as usize);
    9 * x + 3 * y + z
}

impl<'a> Around<'a> {
    pub fn new(tree: &'a Tree, level: usize, block: &'a Block) -> Self {
        let mut around = Self {
            tree,
            level,
            block,
            exists: [0; ROWS * ROWS],
            split: [0; ROWS * ROWS],
        };
        const EMPTY: Cells = [0; CELLS];
        let sets: [[&Cells; 2]; 27] = std::array::from_fn(|n| match block.neighbours[n] {
            NONE => [&EMPTY, &EMPTY],
            at => {
                let block = &tree[level][at as usize];
                [&block.exists, &block.split]
            }
        });
        for x in -1..=CELLS as i32 {
            for y in -1..=CELLS as i32 {
                let first = neighbour_of([x, y, -1]);
                let byte = |set: &Cells| (set[(x & 7) as usize] >> (8 * (y & 7)) & 0xff) as u16;
                let row = |which: usize| {
                    byte(sets[first][which]) >> 7
                        | byte(sets[first + 1][which]) << 1
                        | (byte(sets[first + 2][which]) & 1) << 9
                };
                around.exists[row_of(x, y)] = row(0);
                around.split[row_of(x, y)] = row(1);
            }
        }
        around
    }

    /// State of a cell, each coordinate in `-1 ..= 8`.
    #[inline(always)]
    pub fn state(&self, c: [i32; 3]) -> State {
        let (row, bit) = (row_of(c[0], c[1]), c[2] + 1);
        if self.exists[row] >> bit & 1 == 0 {
            State::Coarse
        } else if self.split[row] >> bit & 1 == 0 {
            State::Leaf
        } else {
            State::Split
        }
    }

    /// Which of the 27 cells about an own one are split: bit `9(x + 1) + 3(y + 1) + z + 1` for the offset `x, y, z`.
    pub fn split_about(&self, c: [usize; 3]) -> u32 {
        let mut found = 0;
        for x in 0..3 {
            for y in 0..3 {
                let row = self.split[(c[0] + x) * ROWS + c[1] + y] >> c[2] & 7;
                found |= u32::from(row) << (9 * x + 3 * y);
            }
        }
        found
    }

    /// Own cells that share a face or an edge with a split cell.
    pub fn beside_split(&self) -> Cells {
        std::array::from_fn(|x| {
            (0..CELLS).fold(0, |word, y| {
                let split = |dx: i32, dy: i32| self.split[row_of(x as i32 + dx, y as i32 + dy)];
                let wide = |r: u16| r | r << 1 | r >> 1;
                let corners = split(-1, -1) | split(-1, 1) | split(1, -1) | split(1, 1);
                let faces = wide(split(-1, 0) | split(1, 0) | split(0, -1) | split(0, 1));
                let found = corners | faces | wide(split(0, 0));
                word | u64::from(found >> 1 & 0xff) << (CELLS * y)
            })
        })
    }

    /// The block of this level that holds a cell, and the cell in it.
    #[inline(always)]
    pub fn find(&self, c: [i32; 3]) -> Option<(usize, [usize; 3])> {
        let at = self.block.neighbours[neighbour_of(c)];
        (at != NONE).then_some((at as usize, c.map(|c| (c & 7) as usize)))
    }

    /// The block of the level before that holds a cell of this level, and the coarse cell in it.
    pub fn find_coarse(&self, c: [i32; 3]) -> Option<(usize, [usize; 3])> {
        if self.block.parent == NONE {
            return None;
        }
        let parent = &self.tree[self.level - 1][self.block.parent as usize];
        let p: [i32; 3] = std::array::from_fn(|a| 4 * (self.block.key[a] & 1) + (c[a] >> 1));
        let at = parent.neighbours[neighbour_of(p)];
        (at != NONE).then_some((at as usize, p.map(|c| (c & 7) as usize)))
    }

    /// Sign and value of a node of the next level that the split cell `c` has: `node` counts half cells from the
    /// block's first node.
    pub fn fine_node(&self, c: [i32; 3], node: [i32; 3]) -> (bool, f32) {
        let (at, local) = self.find(c).expect("a split cell lies in a block");
        let block = &self.tree[self.level][at];
        let octant = 4 * (local[0] / 4) + 2 * (local[1] / 4) + local[2] / 4;
        let fine = &self.tree[self.level + 1][block.children[octant] as usize];
        let n: [usize; 3] = std::array::from_fn(|a| {
            (node[a] + 2 * CELLS as i32 * self.block.key[a] - CELLS as i32 * fine.key[a]) as usize
        });
        let value = fine.sample.values[(n[0] * NODES + n[1]) * NODES + n[2]];
        (fine.sample.is_inside(n), value)
    }
}
