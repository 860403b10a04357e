//! An octree that follows its field in place: what changes costs, not what is there.
//!
//! 1. From the first level down, blocks in which the field may have changed, and those of which other cells are asked
//!    for, are judged again: they tell which of their cells are to be divided.
//! 2. From the last level up, cells are divided for the balance, beside blocks where that may have changed.
//! 3. From the first level down, cells come and go with the division of their parents.
//!
//! Each step makes of a block what [`super::tree`] makes of it, wherever its input may differ.

use std::sync::Arc;

use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::changed::Changed;
use super::grid::{Cells, Grids, NONE, child, children, each, octant_of, parent};
use super::sample::{Judge, Sample, Scratch};
use super::tree::{Block, Limits, Tree, balance};
use crate::polygonize::PolygonizeError;
use crate::polygonize::blocks::{BlockKey, CELLS};

const NO_CELLS: Cells = [0; CELLS];

/// Level and slot of a block.
pub(super) type Place = (usize, u32);

/// Blocks that keep their slots while others come and go.
pub(super) struct Octree {
    /// By level and slot; slots that are free hold blocks without cells.
    pub tree: Tree,
    /// Cells of a block that the error asks for, and those of them that it asks to divide.
    asked: Vec<Vec<[Cells; 2]>>,
    slots: Vec<FxHashMap<BlockKey, u32>>,
    free: Vec<Vec<u32>>,
    blank: Arc<Sample>,
}

/// A change of the field, and what to judge cells by now.
pub(super) struct Change<'a> {
    pub judge: &'a Judge<'a>,
    /// Blocks of the first level in `dirty` that may hold surface, sorted.
    pub roots: &'a [BlockKey],
    /// Blocks of the first level in which the field may have changed, sorted.
    pub dirty: &'a [BlockKey],
    /// Where it may have changed.
    pub boxes: &'a Changed,
    pub limits: &'a Limits,
}

/// What has become of the blocks.
#[derive(Default)]
pub(super) struct Followed {
    /// Blocks sampled or judged.
    pub sampled: usize,
    /// Blocks that a change of the field met.
    pub dirty: Vec<Place>,
    /// Blocks whose cells, or their division, or those of a neighbour, are not what they were.
    pub about: Vec<Place>,
    /// Slots that are free now, and what they held.
    pub gone: Vec<(Place, BlockKey)>,
}

/// A block to be judged.
struct Work {
    slot: u32,
    key: BlockKey,
    /// Boxes of the change that meet it.
    boxes: Vec<u32>,
    asked: Cells,
    is_new: bool,
    sample: Arc<Sample>,
}

fn sampled(judge: &Judge, level: usize, key: BlockKey, scratch: &mut Scratch) -> Arc<Sample> {
    let mut sample = Sample::default();
    sample.fill(judge, level, key, scratch);
    Arc::new(sample)
}

fn both(a: Cells, b: Cells) -> Cells {
    std::array::from_fn(|x| a[x] & b[x])
}

impl Octree {
    pub fn new(depth: usize) -> Self {
        Self {
            tree: (0..=depth).map(|_| Vec::new()).collect(),
            asked: vec![Vec::new(); depth + 1],
            slots: vec![FxHashMap::default(); depth + 1],
            free: vec![Vec::new(); depth + 1],
            blank: Arc::default(),
        }
    }

    /// Number of blocks.
    pub fn len(&self) -> usize {
        self.slots.iter().map(FxHashMap::len).sum()
    }

    pub fn slot(&self, level: usize, key: BlockKey) -> Option<u32> {
        self.slots[level].get(&key).copied()
    }

    /// The blocks that are there, level by level.
    pub fn places(&self) -> impl Iterator<Item = Place> {
        let levels = self.tree.iter().enumerate();
        levels.flat_map(|(level, blocks)| {
            let slots = blocks.iter().enumerate();
            slots
                .filter(|(_, b)| b.exists != NO_CELLS)
                .map(move |(slot, _)| (level, slot as u32))
        })
    }

    pub fn block(&self, (level, slot): Place) -> &Block {
        &self.tree[level][slot as usize]
    }

    /// Blocks of the same level that touch one, itself among them.
    pub fn neighbours(&self, place: Place) -> impl Iterator<Item = Place> + '_ {
        let found = self.block(place).neighbours.iter();
        found.filter(|n| **n != NONE).map(move |n| (place.0, *n))
    }

    /// Blocks of the same and the next level that touch some cells of one.
    pub fn touching(&self, place: Place, cells: &Cells) -> Vec<Place> {
        let (level, _) = place;
        let block = self.block(place);
        let (mut near, mut found) = (0u32, Vec::new());
        for c in each(*cells) {
            near |= (0..27).fold(0, |near, n| {
                let beside = [n / 9, n / 3 % 3, n % 3];
                let is_near = (0..3).all(|a| [c[a] == 0, true, c[a] + 1 == CELLS][beside[a]]);
                near | u32::from(is_near) << n
            });
            if level + 1 == self.tree.len() {
                continue;
            }
            // Finer cells from one before the leaf's to one after.
            for corner in 0..8 {
                let at: [i32; 3] = std::array::from_fn(|a| 2 * c[a] as i32 - 1 + 3 * (corner >> a & 1));
                let fine: BlockKey = std::array::from_fn(|a| 2 * block.key[a] + (at[a] >> 3));
                let n: [usize; 3] = std::array::from_fn(|a| (parent(fine)[a] - block.key[a] + 1) as usize);
                let holder = block.neighbours[9 * n[0] + 3 * n[1] + n[2]];
                if holder != NONE {
                    let slot = self.tree[level][holder as usize].children[octant_of(fine)];
                    found.extend((slot != NONE).then_some((level + 1, slot)));
                }
            }
        }
        let beside = (0..27).filter(|n| near >> n & 1 == 1 && block.neighbours[*n] != NONE);
        found.extend(beside.map(|n| (level, block.neighbours[n])));
        found.sort_unstable();
        found.dedup();
        found
    }

    /// Blocks of the next level that touch one.
    pub fn finer(&self, place: Place) -> impl Iterator<Item = Place> + '_ {
        let found = self
            .neighbours(place)
            .flat_map(move |n| self.block(n).children.iter());
        found.filter(|n| **n != NONE).map(move |n| (place.0 + 1, *n))
    }

    /// Follows a change of the field.
    pub fn follow(&mut self, change: &Change) -> Result<Followed, PolygonizeError> {
        let (judge, limits) = (change.judge, change.limits);
        let mut found = Followed::default();
        // Blocks that are divided otherwise, by level, with how they were.
        let mut divided: Vec<Vec<(u32, Cells)>> = vec![Vec::new(); limits.depth + 1];
        let mut unsampled = Vec::new();
        let first = self.judge(change, &mut found, &mut divided)?;
        self.balance(judge.grids, &mut divided, &mut unsampled);
        self.settle_cells(judge.grids, first, &divided, &mut unsampled, &mut found);
        let samples: Vec<Arc<Sample>> = unsampled
            .par_iter()
            .with_min_len(2)
            .map_init(Scratch::default, |scratch, &place| {
                sampled(judge, place.0, self.block(place).key, scratch)
            })
            .collect();
        found.sampled += samples.len();
        for ((level, slot), sample) in unsampled.into_iter().zip(samples) {
            self.tree[level][slot as usize].sample = sample;
        }
        for (place, _) in &found.gone {
            self.remove(*place);
        }
        for places in [&mut found.dirty, &mut found.about] {
            places.retain(|p| self.block(*p).exists != NO_CELLS);
            places.sort_unstable();
            places.dedup();
        }
        if self.len() > limits.blocks {
            return Err(PolygonizeError::TooManyBlocks { limit: limits.blocks });
        }
        Ok(found)
    }

    /// Step 1. Gives the blocks of the first level that it met.
    fn judge(
        &mut self,
        change: &Change,
        found: &mut Followed,
        divided: &mut [Vec<(u32, Cells)>],
    ) -> Result<Vec<u32>, PolygonizeError> {
        let Change {
            judge,
            roots,
            dirty,
            boxes: changed,
            limits,
        } = *change;
        let grids = judge.grids;
        let all = changed.all();
        let mut keys: Vec<(BlockKey, Cells)> = roots.iter().map(|&key| (key, grids.domain(0, key))).collect();
        let without = |key: &&BlockKey| self.slot(0, **key).is_some() && roots.binary_search(key).is_err();
        keys.extend(dirty.iter().filter(without).map(|&key| (key, NO_CELLS)));
        let work = keys.into_iter().map(|(key, asked)| {
            let boxes = changed.meeting(0, key, 0.0, &all);
            self.work((0, self.slot(0, key).unwrap_or(NONE)), key, boxes, asked)
        });
        let mut work: Vec<Work> = work.collect();
        let first = work.iter().map(|w| w.slot).collect();
        for level in 0..=limits.depth {
            work.par_iter_mut()
                .with_min_len(2)
                .for_each_init(Scratch::default, |scratch, w| {
                    if w.is_new {
                        w.sample = sampled(judge, level, w.key, scratch);
                    } else if !w.boxes.is_empty() {
                        let (nodes, stale) = changed.within(grids, level, w.key, &w.boxes);
                        Arc::make_mut(&mut w.sample).refill(judge, level, w.key, nodes, stale, scratch);
                    }
                    let new = w.sample.unjudged(judge, &w.asked);
                    if new != NO_CELLS {
                        Arc::make_mut(&mut w.sample).judge(judge, level, w.key, &new, scratch);
                    }
                });
            found.sampled += work.len();
            let mut next = Vec::new();
            for w in std::mem::take(&mut work) {
                let place = (level, w.slot);
                let split = if level < limits.depth {
                    w.sample.larger(&w.asked, limits.error as f32)
                } else {
                    NO_CELLS
                };
                self.tree[level][w.slot as usize].sample = w.sample;
                let known = &mut self.asked[level][w.slot as usize];
                let [_, before] = std::mem::replace(known, [w.asked, split]);
                if split != before {
                    divided[level].push((w.slot, self.block(place).split));
                }
                if !w.boxes.is_empty() {
                    found.dirty.push(place);
                }
                if level == limits.depth || (w.boxes.is_empty() && split == before) {
                    continue;
                }
                for octant in 0..8 {
                    let key = child(w.key, octant);
                    let slot = self.block(place).children[octant];
                    let domain = grids.domain(level + 1, key);
                    let [asked, before] = [split, before].map(|s| both(children(&s, octant), domain));
                    let boxes = changed.meeting(level + 1, key, 0.0, &w.boxes);
                    if asked != before || (slot != NONE && !boxes.is_empty()) {
                        next.push(self.work((level + 1, slot), key, boxes, asked));
                    }
                }
            }
            work = next;
            if self.len() > limits.blocks {
                return Err(PolygonizeError::TooManyBlocks { limit: limits.blocks });
            }
        }
        Ok(first)
    }

    /// A block to be judged, which is put in if it is not there.
    fn work(&mut self, (level, slot): Place, key: BlockKey, boxes: Vec<u32>, asked: Cells) -> Work {
        let is_new = slot == NONE;
        let slot = if is_new { self.insert(level, key) } else { slot };
        // Taken out, so that nobody else has it.
        let sample = std::mem::replace(&mut self.tree[level][slot as usize].sample, self.blank.clone());
        Work {
            slot,
            key,
            boxes,
            asked,
            is_new,
            sample,
        }
    }

    /// Step 2, from blocks of which other cells are to be divided, which it completes by what the balance asks for.
    fn balance(&mut self, grids: &Grids, divided: &mut [Vec<(u32, Cells)>], unsampled: &mut Vec<Place>) {
        for level in (0..divided.len() - 1).rev() {
            let mut keys: Vec<BlockKey> = Vec::new();
            for (slot, _) in &divided[level] {
                keys.push(self.tree[level][*slot as usize].key);
            }
            for (slot, _) in &divided[level + 1] {
                let fine = self.tree[level + 1][*slot as usize].key;
                let own = parent(fine);
                keys.extend((0..8).map(|side| {
                    let out = |a: usize| (2 * (fine[a] & 1) - 1) * (side >> a & 1);
                    std::array::from_fn(|a| own[a] + out(a))
                }));
            }
            keys.sort_unstable();
            keys.dedup();
            keys.retain(|key| grids.domain(level, *key) != NO_CELLS);
            let mut finer: Vec<u32> = Vec::new();
            for key in &keys {
                let at = |n: i32| [n / 16, n / 4 % 4, n % 4];
                let near = (0..64).map(|n| std::array::from_fn(|a| 2 * key[a] - 1 + at(n)[a]));
                finer.extend(near.filter_map(|near| self.slot(level + 1, near)));
            }
            finer.sort_unstable();
            finer.dedup();
            let fine = finer.iter().map(|slot| {
                let block = &self.tree[level + 1][*slot as usize];
                (block.key, block.split)
            });
            let coarse = keys.iter().map(|key| {
                let slot = self.slot(level, *key);
                (
                    *key,
                    slot.map_or(NO_CELLS, |slot| self.asked[level][slot as usize][1]),
                )
            });
            let mut sets = [coarse.collect(), fine.filter(|(_, s)| *s != NO_CELLS).collect()];
            balance(&mut sets, |finer, key| grids.domain(level + finer, key));
            let mut before: FxHashMap<u32, Cells> = divided[level].drain(..).collect();
            for key in keys {
                let at = sets[0].binary_search_by_key(&key, |(k, _)| *k);
                let split = at.map_or(NO_CELLS, |n| sets[0][n].1);
                let slot = match self.slot(level, key) {
                    Some(slot) => slot,
                    None if split == NO_CELLS => continue,
                    None => {
                        let slot = self.insert(level, key);
                        unsampled.push((level, slot));
                        slot
                    }
                };
                let known = &mut self.tree[level][slot as usize].split;
                let before = before.remove(&slot).unwrap_or(*known);
                *known = split;
                if split != before {
                    divided[level].push((slot, before));
                }
            }
        }
    }

    /// Step 3. `first` are blocks of the first level that may have come or gone.
    fn settle_cells(
        &mut self,
        grids: &Grids,
        mut first: Vec<u32>,
        divided: &[Vec<(u32, Cells)>],
        unsampled: &mut Vec<Place>,
        found: &mut Followed,
    ) {
        let mut moved: Vec<Place> = Vec::new();
        first.extend(divided[0].iter().map(|(slot, _)| *slot));
        first.sort_unstable();
        first.dedup();
        for slot in first {
            let [asked, _] = self.asked[0][slot as usize];
            let block = &mut self.tree[0][slot as usize];
            let is_there = asked != NO_CELLS || block.split != NO_CELLS;
            let exists = if is_there {
                grids.domain(0, block.key)
            } else {
                NO_CELLS
            };
            if exists == NO_CELLS {
                found.gone.push(((0, slot), block.key));
            }
            if exists != block.exists || exists == NO_CELLS {
                block.exists = exists;
                moved.push((0, slot));
            }
        }
        for (level, divided) in divided.iter().enumerate() {
            for &(slot, before) in divided {
                moved.push((level, slot));
                let block = self.block((level, slot));
                let (key, split) = (block.key, block.split);
                for octant in 0..8 {
                    let [cells, before] = [split, before].map(|s| children(&s, octant));
                    if cells == before {
                        continue;
                    }
                    let key = child(key, octant);
                    let exists = both(cells, grids.domain(level + 1, key));
                    let slot = match self.block((level, slot)).children[octant] {
                        NONE if exists == NO_CELLS => continue,
                        NONE => {
                            let slot = self.insert(level + 1, key);
                            unsampled.push((level + 1, slot));
                            slot
                        }
                        slot => slot,
                    };
                    self.tree[level + 1][slot as usize].exists = exists;
                    moved.push((level + 1, slot));
                    if exists == NO_CELLS {
                        found.gone.push(((level + 1, slot), key));
                    }
                }
            }
        }
        for place in moved {
            found.about.extend(self.neighbours(place));
        }
    }

    fn insert(&mut self, level: usize, key: BlockKey) -> u32 {
        let mut block = Block {
            key,
            sample: self.blank.clone(),
            exists: NO_CELLS,
            split: NO_CELLS,
            children: [NONE; 8],
            parent: NONE,
            neighbours: [NONE; 27],
        };
        let slot = self.free[level].pop().unwrap_or_else(|| {
            self.tree[level].push(block.clone());
            self.asked[level].push([NO_CELLS; 2]);
            self.tree[level].len() as u32 - 1
        });
        self.slots[level].insert(key, slot);
        for n in 0..27 {
            let at = [n / 9, n / 3 % 3, n % 3];
            let beside: BlockKey = std::array::from_fn(|a| key[a] + at[a] as i32 - 1);
            if let Some(other) = self.slot(level, beside) {
                block.neighbours[n] = other;
                self.tree[level][other as usize].neighbours[26 - n] = slot;
            }
        }
        if let Some(above) = level.checked_sub(1).and_then(|up| self.slot(up, parent(key))) {
            block.parent = above;
            self.tree[level - 1][above as usize].children[octant_of(key)] = slot;
        }
        if level + 1 < self.tree.len() {
            for octant in 0..8 {
                if let Some(below) = self.slot(level + 1, child(key, octant)) {
                    block.children[octant] = below;
                    self.tree[level + 1][below as usize].parent = slot;
                }
            }
        }
        self.tree[level][slot as usize] = block;
        slot
    }

    fn remove(&mut self, (level, slot): Place) {
        let block = &mut self.tree[level][slot as usize];
        let (key, above, neighbours) = (block.key, block.parent, block.neighbours);
        block.sample = self.blank.clone();
        (block.exists, block.split) = (NO_CELLS, NO_CELLS);
        block.neighbours = [NONE; 27];
        let children = std::mem::replace(&mut block.children, [NONE; 8]);
        for (n, other) in neighbours.into_iter().enumerate() {
            if other != NONE {
                self.tree[level][other as usize].neighbours[26 - n] = NONE;
            }
        }
        if above != NONE {
            self.tree[level - 1][above as usize].children[octant_of(key)] = NONE;
        }
        for below in children.into_iter().filter(|c| *c != NONE) {
            self.tree[level + 1][below as usize].parent = NONE;
        }
        self.asked[level][slot as usize] = [NO_CELLS; 2];
        self.slots[level].remove(&key);
        self.free[level].push(slot);
    }
}
