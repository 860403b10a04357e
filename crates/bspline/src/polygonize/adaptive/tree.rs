//! The octree of cells: divided where the error asks for it, then until neighbours differ by one level at most.

use std::ops::ControlFlow;
use std::sync::Arc;

use rayon::prelude::*;

use super::grid::{Cells, NONE, child, children, count, each, octant_of, octants, parent};
use super::sample::{Judge, Sample, Scratch};
use crate::polygonize::PolygonizeError;
use crate::polygonize::blocks::{BlockKey, CELLS};

/// Blocks worked on between two looks at the caller's wish to stop.
const STRIDE: usize = 1 << 10;

/// What was asked of the field, level by level, sorted by key.
#[derive(Default)]
pub(super) struct Samples(Vec<Vec<(BlockKey, Arc<Sample>)>>);

/// A block of the finished octree.
#[derive(Clone)]
pub(super) struct Block {
    pub key: BlockKey,
    pub sample: Arc<Sample>,
    /// Cells of this level.
    pub exists: Cells,
    /// Those with children.
    pub split: Cells,
    /// Blocks of the next level by octant.
    pub children: [u32; 8],
    /// Block of the level before; none on the first.
    pub parent: u32,
    /// Blocks of this level, `9(x + 1) + 3(y + 1) + z + 1` for the offset `x, y, z`.
    pub neighbours: [u32; 27],
}

/// Blocks by level, sorted by key.
pub(super) type Tree = Vec<Vec<Block>>;

/// Sets of cells by block, sorted by key.
type Sets = Vec<(BlockKey, Cells)>;

/// Called now and then with the blocks at hand; may break off.
pub(super) type Watch<'a> = dyn FnMut(usize) -> ControlFlow<()> + 'a;

/// What limits the work.
#[derive(Clone, Copy)]
pub(super) struct Limits {
    /// Chord error, world length.
    pub error: f64,
    /// Finest level.
    pub depth: usize,
    /// Most blocks.
    pub blocks: usize,
}

impl Samples {
    pub fn new(depth: usize) -> Self {
        Self(vec![Vec::new(); depth + 1])
    }

    /// Number of blocks.
    pub fn len(&self) -> usize {
        self.0.iter().map(Vec::len).sum()
    }

    /// Nodes where the field is not a number.
    pub fn nan_nodes(&self) -> u64 {
        self.0.iter().flatten().map(|(_, s)| u64::from(s.nan_nodes)).sum()
    }

    /// The sample of a block.
    pub fn get(&self, level: usize, key: BlockKey) -> Option<&Arc<Sample>> {
        let level = &self.0[level];
        let at = level.binary_search_by_key(&key, |(k, _)| *k).ok()?;
        Some(&level[at].1)
    }

    /// Sees to it that the cells of `sets` are judged; blocks that are not there are sampled.
    pub fn add(
        &mut self,
        judge: &Judge,
        level: usize,
        sets: &Sets,
        limits: &Limits,
        judged: bool,
        watch: &mut Watch,
    ) -> Result<(), PolygonizeError> {
        let mut known = std::mem::take(&mut self.0[level]).into_iter().peekable();
        let mut merged: Vec<(BlockKey, Arc<Sample>)> = Vec::with_capacity(sets.len());
        let others = self.len();
        for part in sets.chunks(STRIDE) {
            let mut work: Vec<(BlockKey, Cells, bool, Arc<Sample>)> = Vec::with_capacity(part.len());
            for &(key, cells) in part {
                while let Some(before) = known.next_if(|(k, _)| *k < key) {
                    work.push((before.0, [0; CELLS], true, before.1));
                }
                let own = known.next_if(|(k, _)| *k == key).map(|(_, s)| s);
                let cells = if judged { cells } else { [0; CELLS] };
                // Asked for here, not by the threads: what is freed makes room for what the caller asks for.
                work.push((key, cells, own.is_some(), own.unwrap_or_default()));
            }
            merged.par_extend(work.into_par_iter().with_min_len(2).map_init(
                Scratch::default,
                |scratch, (key, cells, is_known, mut sample)| {
                    if !is_known {
                        let blank = Arc::get_mut(&mut sample).expect("nobody else has it yet");
                        blank.fill(judge, level, key, scratch);
                    }
                    let new = sample.unjudged(judge, &cells);
                    if new != [0; CELLS] {
                        Arc::make_mut(&mut sample).judge(judge, level, key, &new, scratch);
                    }
                    (key, sample)
                },
            ));
            if others + merged.len() > limits.blocks {
                return Err(PolygonizeError::TooManyBlocks { limit: limits.blocks });
            }
            if watch(others + merged.len()).is_break() {
                return Err(PolygonizeError::Cancelled);
            }
        }
        merged.extend(known);
        self.0[level] = merged;
        Ok(())
    }

    /// Cells of `sets` that the error asks to divide.
    fn to_split(&self, level: usize, sets: &Sets, limits: &Limits) -> Sets {
        if level >= limits.depth {
            return Vec::new();
        }
        let error = limits.error as f32;
        sets.iter()
            .filter_map(|&(key, cells)| {
                let sample = self.get(level, key).expect("every set was sampled");
                let split = sample.larger(&cells, error);
                (split != [0; CELLS]).then_some((key, split))
            })
            .collect()
    }

    /// Divides from the blocks `roots` of the first level on until no error exceeds that of `limits`, and balances.
    pub fn grow(
        &mut self,
        judge: &Judge,
        roots: &[BlockKey],
        limits: &Limits,
        watch: &mut Watch,
    ) -> Result<Tree, PolygonizeError> {
        let grids = judge.grids;
        let mut sets: Sets = roots.iter().map(|&key| (key, grids.domain(0, key))).collect();
        let mut wanted: Vec<Sets> = Vec::new();
        for level in 0..=limits.depth {
            self.add(judge, level, &sets, limits, true, watch)?;
            let split = self.to_split(level, &sets, limits);
            sets = below(&split, |key| grids.domain(level + 1, key));
            wanted.push(split);
            if sets.is_empty() {
                break;
            }
        }
        balance(&mut wanted, |level, key| grids.domain(level, key));
        let mut tree = Tree::new();
        let mut sets: Sets = roots.iter().map(|&key| (key, grids.domain(0, key))).collect();
        sets.extend(wanted[0].iter().map(|&(key, _)| (key, grids.domain(0, key))));
        sets.sort_unstable_by_key(|(key, _)| *key);
        sets.dedup_by_key(|(key, _)| *key);
        for (level, split) in wanted.iter().enumerate() {
            self.add(judge, level, &sets, limits, false, watch)?;
            tree.push(self.blocks(level, &sets, split));
            sets = below(split, |key| grids.domain(level + 1, key));
        }
        debug_assert!(sets.is_empty(), "the finest cells are not split");
        link(&mut tree);
        Ok(tree)
    }

    fn blocks(&self, level: usize, sets: &Sets, split: &Sets) -> Vec<Block> {
        let mut split = split.iter().peekable();
        let own = |&(key, exists): &(BlockKey, Cells)| Block {
            key,
            sample: self.get(level, key).expect("every block was sampled").clone(),
            exists,
            split: split.next_if(|(k, _)| *k == key).map_or([0; CELLS], |(_, s)| *s),
            children: [NONE; 8],
            parent: NONE,
            neighbours: [NONE; 27],
        };
        sets.iter().map(own).collect()
    }
}

/// Cells of the next level whose parents are in the sets, sorted.
fn below(sets: &Sets, domain: impl Fn(BlockKey) -> Cells) -> Sets {
    let mut fine: Sets = sets
        .iter()
        .flat_map(|(key, cells)| {
            let found = octants(cells);
            (0..8)
                .filter(move |o| found >> o & 1 == 1)
                .map(|o| (child(*key, o), children(cells, o)))
        })
        .collect();
    for (key, cells) in &mut fine {
        let domain = domain(*key);
        for x in 0..CELLS {
            cells[x] &= domain[x];
        }
    }
    fine.retain(|(_, cells)| *cells != [0; CELLS]);
    fine.sort_unstable_by_key(|(key, _)| *key);
    fine
}

/// Adds to the split cells of each level the parents of all 26 neighbours of the split cells of the next.
///
/// The children of those then touch cells of at least their parents' size only: 26 neighbours, 2 : 1.
pub(super) fn balance(split: &mut [Sets], domain: impl Fn(usize, BlockKey) -> Cells) {
    for level in (1..split.len()).rev() {
        let (coarse, fine) = split.split_at_mut(level);
        let target = &mut coarse[level - 1];
        for (key, cells) in &fine[0] {
            let at = octant_of(*key);
            let offset = [at >> 2 & 1, at >> 1 & 1, at & 1].map(|o| 4 * o as i32);
            // In each axis the own block of the parents and the one beside it.
            let mut found = [[0; CELLS]; 8];
            for c in each(*cells) {
                for corner in 0..8usize {
                    let mut side = 0;
                    let p: [usize; 3] = std::array::from_fn(|a| {
                        let step = [-1, 1][c[a] & 1] * (corner >> a & 1) as i32;
                        let p = offset[a] + (c[a] / 2) as i32 + step;
                        side |= usize::from(!(0..CELLS as i32).contains(&p)) << a;
                        (p & 7) as usize
                    });
                    found[side][p[0]] |= 1 << (CELLS * p[1] + p[2]);
                }
            }
            let own = parent(*key);
            for (side, cells) in found.into_iter().enumerate() {
                if cells == [0; CELLS] {
                    continue;
                }
                let key: BlockKey = std::array::from_fn(|a| {
                    let out = if offset[a] == 0 { -1 } else { 1 };
                    own[a] + out * (side >> a & 1) as i32
                });
                target.push((key, cells));
            }
        }
        target.sort_unstable_by_key(|(key, _)| *key);
        target.dedup_by(|next, first| {
            let same = next.0 == first.0;
            if same {
                for x in 0..CELLS {
                    first.1[x] |= next.1[x];
                }
            }
            same
        });
        for (key, cells) in target.iter_mut() {
            let domain = domain(level - 1, *key);
            for x in 0..CELLS {
                cells[x] &= domain[x];
            }
        }
        target.retain(|(_, cells)| *cells != [0; CELLS]);
    }
}

/// Links parents, children and neighbours.
fn link(tree: &mut Tree) {
    for level in 0..tree.len() {
        let (done, rest) = tree.split_at_mut(level);
        let blocks = &mut rest[0];
        let keys: Vec<BlockKey> = blocks.iter().map(|b| b.key).collect();
        let find = |key: BlockKey| keys.binary_search(&key).map_or(NONE, |n| n as u32);
        blocks.par_iter_mut().with_min_len(64).for_each(|block| {
            for n in 0..27 {
                let d = [n / 9, n / 3 % 3, n % 3].map(|d| d as i32 - 1);
                block.neighbours[n] = find(std::array::from_fn(|a| block.key[a] + d[a]));
            }
        });
        let Some(coarse) = done.last_mut() else { continue };
        let above: Vec<BlockKey> = coarse.iter().map(|b| b.key).collect();
        for (n, block) in blocks.iter_mut().enumerate() {
            let at = above
                .binary_search(&parent(block.key))
                .expect("a child has a parent");
            block.parent = at as u32;
            coarse[at].children[octant_of(block.key)] = n as u32;
        }
    }
}

/// Leaves of a block.
pub(super) fn leaves(block: &Block) -> Cells {
    std::array::from_fn(|x| block.exists[x] & !block.split[x])
}

/// Leaves with corners on both sides, over the whole tree.
pub(super) fn crossed_leaves(tree: &Tree) -> u64 {
    let blocks = tree.iter().flatten();
    blocks
        .map(|b| {
            let (leaves, crossed) = (leaves(b), b.sample.crossed);
            u64::from(count(&std::array::from_fn(|x| leaves[x] & crossed[x])))
        })
        .sum()
}
