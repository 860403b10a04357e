//! The dyadic grids of a frame, and sets of the cells of a block.

use glam::{DAffine3, DVec3};

use crate::polygonize::blocks::{BlockKey, CELLS, NODES};
use crate::{Aabb, Frame};

/// Nodes of a block.
pub(super) const NODE_COUNT: usize = NODES * NODES * NODES;
/// No block, no vertex.
pub(super) const NONE: u32 = u32::MAX;

/// A set of cells of a block: word `x`, bit `8y + z`.
pub(super) type Cells = [u64; CELLS];

/// The frame of the coarsest cells and its halvings.
pub(super) struct Grids {
    pub frames: Vec<Frame>,
    /// World lengths of a coarsest cell along the grid's axes.
    pub spacing: DVec3,
    /// Whether the map turns right-handed axes into left-handed ones.
    pub mirrored: bool,
}

impl Grids {
    /// `frame` and `depth` halvings of it.
    pub fn new(frame: &Frame, depth: usize) -> Self {
        let m = frame.world_from_grid.matrix3;
        let frames = (0..=depth).map(|level| Frame {
            // Powers of two change no digit: a node has the same coordinates on every level, to the bit.
            world_from_grid: DAffine3 {
                matrix3: m * (-(level as f64)).exp2(),
                translation: frame.world_from_grid.translation,
            },
            cells: frame.cells.map(|n| n << level),
        });
        Self {
            frames: frames.collect(),
            spacing: DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length()),
            mirrored: m.determinant() < 0.0,
        }
    }

    /// The maps from the world to the grids of all levels.
    pub fn inverses(&self) -> Vec<DAffine3> {
        self.frames.iter().map(|f| f.world_from_grid.inverse()).collect()
    }

    /// A place in the grid of a level, in the world.
    pub fn world(&self, level: usize, at: DVec3) -> DVec3 {
        self.frames[level].world_from_grid.transform_point3(at)
    }

    /// Finest level.
    pub fn depth(&self) -> usize {
        self.frames.len() - 1
    }

    /// Cells of `level` along an axis.
    pub fn cells(&self, level: usize, axis: usize) -> i32 {
        self.frames[level].cells[axis] as i32
    }

    /// World lengths of a cell of `level`.
    pub fn size(&self, level: usize) -> DVec3 {
        self.spacing * (-(level as f64)).exp2()
    }

    /// Cells of a block that lie in the frame or touch it from outside: those that may hold surface or cap.
    pub fn domain(&self, level: usize, key: BlockKey) -> Cells {
        let origin = key.map(|b| b * CELLS as i32);
        let is_in = |axis: usize, i: usize| {
            let at = origin[axis] + i as i32;
            (-1..=self.cells(level, axis)).contains(&at)
        };
        let bits = |axis: usize| (0..CELLS).fold(0u64, |m, i| m | u64::from(is_in(axis, i)) << i);
        let (y, z) = (bits(1), bits(2));
        let plane = (0..CELLS).fold(0, |m, j| m | ((y >> j & 1) * (z << (CELLS * j))));
        std::array::from_fn(|i| if is_in(0, i) { plane } else { 0 })
    }

    /// Whether a block has nodes on the frame's faces or beyond.
    pub fn meets_border(&self, level: usize, key: BlockKey) -> bool {
        (0..3).any(|a| key[a] < 0 || (key[a] + 1) * CELLS as i32 > self.cells(level, a))
    }

    /// World box of `count` cells of `level` from cell `lo`, in the frame.
    pub fn world_box(&self, level: usize, lo: [i32; 3], count: i32) -> Aabb {
        let (a, b) = self.clipped(level, lo, count);
        self.frames[level].world_box(a, b)
    }

    /// First and last node of `count` cells of `level` from cell `lo`, in the frame.
    pub fn clipped(&self, level: usize, lo: [i32; 3], count: i32) -> ([i64; 3], [i64; 3]) {
        let clip = |a: usize, x: i32| i64::from(x.clamp(0, self.cells(level, a)));
        (
            std::array::from_fn(|a| clip(a, lo[a])),
            std::array::from_fn(|a| clip(a, lo[a] + count)),
        )
    }
}

/// Number of a cell within its block.
#[inline(always)]
pub(super) fn cell_index(c: [usize; 3]) -> usize {
    (c[0] * CELLS + c[1]) * CELLS + c[2]
}

/// Number of a node within its block.
#[inline(always)]
pub(super) fn node_index(n: [usize; 3]) -> usize {
    (n[0] * NODES + n[1]) * NODES + n[2]
}

/// A cell in the word of its `x`.
#[inline(always)]
pub(super) fn bit(c: [usize; 3]) -> u64 {
    1 << (CELLS * c[1] + c[2])
}

/// Whether a set holds a cell.
#[inline(always)]
pub(super) fn holds(set: &Cells, c: [usize; 3]) -> bool {
    set[c[0]] & bit(c) != 0
}

/// How many cells of a set come before this one.
#[inline(always)]
pub(super) fn rank(set: &Cells, c: [usize; 3]) -> usize {
    let before: u32 = set[..c[0]].iter().map(|w| w.count_ones()).sum();
    (before + (set[c[0]] & (bit(c) - 1)).count_ones()) as usize
}

/// The cells of a set in order.
pub(super) fn each(set: Cells) -> impl Iterator<Item = [usize; 3]> {
    set.into_iter().enumerate().flat_map(|(x, word)| {
        let mut bits = word;
        std::iter::from_fn(move || {
            let bit = bits.trailing_zeros() as usize;
            bits &= bits.wrapping_sub(1);
            (bit < 64).then_some([x, bit / CELLS, bit % CELLS])
        })
    })
}

/// Number of cells of a set.
pub(super) fn count(set: &Cells) -> u32 {
    set.iter().map(|w| w.count_ones()).sum()
}

/// Which octants (bit `4x + 2y + z`) of a block hold cells of the set.
pub(super) fn octants(set: &Cells) -> u8 {
    const LOW_Y: u64 = 0xffff_ffff;
    const LOW_Z: u64 = 0x0f0f_0f0f_0f0f_0f0f;
    let mut found = 0;
    for half in 0..2 {
        let word = set[4 * half..4 * half + 4].iter().fold(0, |a, b| a | b);
        for (q, mask) in [LOW_Y & LOW_Z, LOW_Y & !LOW_Z, !LOW_Y & LOW_Z, !LOW_Y & !LOW_Z]
            .into_iter()
            .enumerate()
        {
            found |= u8::from(word & mask != 0) << (4 * half + q);
        }
    }
    found
}

/// First cell of an octant.
pub(super) fn octant_place(octant: usize) -> [usize; 3] {
    [4 * (octant >> 2), 4 * (octant >> 1 & 1), 4 * (octant & 1)]
}

/// The octant that a cell lies in.
pub(super) fn octant_with(c: [usize; 3]) -> usize {
    4 * (c[0] / 4) + 2 * (c[1] / 4) + c[2] / 4
}

/// The cells of a set in an octant.
pub(super) fn octant_of_set(set: &Cells, octant: usize) -> Cells {
    let at = octant_place(octant);
    let mask = (0x0f0f_0f0f << (CELLS * at[1])) << at[2];
    std::array::from_fn(|x| if x / 4 * 4 == at[0] { set[x] & mask } else { 0 })
}

/// The children of a set's cells in an octant, as cells of the child block.
pub(super) fn children(set: &Cells, octant: usize) -> Cells {
    const TWICE: [u64; 16] = {
        let mut table = [0; 16];
        let mut n = 0;
        while n < 16 {
            let mut bit = 0;
            while bit < 4 {
                if n >> bit & 1 == 1 {
                    table[n] |= 3 << (2 * bit);
                }
                bit += 1;
            }
            n += 1;
        }
        table
    };
    let [ox, oy, oz] = [octant >> 2 & 1, octant >> 1 & 1, octant & 1];
    let mut fine = [0; CELLS];
    for x in 0..4 {
        let word = set[4 * ox + x];
        let mut both = 0;
        for y in 0..4 {
            let row = TWICE[(word >> (CELLS * (4 * oy + y) + 4 * oz) & 15) as usize];
            both |= (row | row << CELLS) << (2 * CELLS * y);
        }
        fine[2 * x] = both;
        fine[2 * x + 1] = both;
    }
    fine
}

/// Parent of a block.
pub(super) fn parent(key: BlockKey) -> BlockKey {
    key.map(|b| b >> 1)
}

/// Which octant of its parent a block is.
pub(super) fn octant_of(key: BlockKey) -> usize {
    let [x, y, z] = key.map(|b| (b & 1) as usize);
    4 * x + 2 * y + z
}

/// Child of a block in an octant.
pub(super) fn child(key: BlockKey, octant: usize) -> BlockKey {
    let o = [octant >> 2 & 1, octant >> 1 & 1, octant & 1];
    std::array::from_fn(|a| 2 * key[a] + o[a] as i32)
}
