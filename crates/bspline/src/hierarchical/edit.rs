//! Addition of coefficients, sharing all bricks that it leaves as they were.

use std::collections::BTreeSet;
use std::sync::{Arc, OnceLock};

use rayon::prelude::*;

use super::brick::{BRICK, Brick, HALO, HALO_LEN, NONE};
use super::build::{brick_totals, gathered_hull, min_max};
use super::prolong::prolong;
use super::spline::{HierarchicalSpline, find};
use super::{BrickKey, Corrections};
use crate::Real;

/// Most levels that an edit may lead to.
pub const MAX_LEVELS: usize = 21;
/// Most cells of a level on an axis.
const MAX_CELLS: u64 = 1 << 30;

/// What is added to the coefficient of one function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelEdit<T> {
    /// Level of the function, 0 the coarsest; may be finer than the field was so far.
    pub level: usize,
    /// Number of the function on each axis, `0 .. cells + 3`: number `s` is centred on knot `s - 1`.
    pub function: [u32; 3],
    /// What is added to its coefficient.
    pub delta: T,
}

/// Why coefficients cannot be added.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EditError {
    /// Too deep.
    #[error("level {level} is deeper than {max}, the deepest that this lattice can have")]
    Level {
        /// Level asked for.
        level: usize,
        /// Deepest possible one.
        max: usize,
    },
    /// No such function.
    #[error("level {level} has {count:?} functions; there is none with the number {function:?}")]
    Function {
        /// Level asked for.
        level: usize,
        /// Function asked for.
        function: [u32; 3],
        /// Functions on each axis.
        count: [u32; 3],
    },
    /// The coefficient would be NaN or infinite.
    #[error("function {function:?} of level {level} would get the coefficient {value}; it has to be finite")]
    NotFinite {
        /// Level of the function.
        level: usize,
        /// Number of the function.
        function: [u32; 3],
        /// What it would be.
        value: f64,
    },
}

impl<T: Real> HierarchicalSpline<T> {
    /// The field with coefficients added, in the order given; functions that were not active become so.
    ///
    /// The very field, to the bit, that [`Self::from_corrections`] makes of the new corrections. `self` stays as it is,
    /// and all bricks that come out with the bits they had are shared by both: the old version costs the bricks changed,
    /// and keeping it is how an edit is undone (subtraction would not give the old bits back). Computes only the bricks
    /// that the functions reach; besides that, the tables of all bricks are copied (about 40 ns for each).
    ///
    /// # Errors
    /// Any [`EditError`]; then nothing is done.
    pub fn edited(&self, edits: &[LevelEdit<T>]) -> Result<Self, EditError> {
        let mut next = self.clone();
        let mut touched: Vec<BTreeSet<BrickKey>> = vec![BTreeSet::new(); next.levels.len()];
        for edit in edits {
            let keys = next.add(edit)?;
            touched.resize(next.levels.len(), BTreeSet::new());
            touched[edit.level].extend(keys);
        }
        let missing = next.missing(&touched);
        let mut dirty: Vec<BTreeSet<u32>> = Vec::with_capacity(touched.len());
        for level in 0..next.levels.len() {
            next.insert_bricks(level, &missing[level], dirty.last_mut());
            let mut reached: BTreeSet<u32> = touched[level]
                .iter()
                .chain(&missing[level])
                .map(|key| next.find(level, *key).expect("inserted if it was missing"))
                .collect();
            if let Some(parents) = dirty.last() {
                let above = &next.levels[level - 1];
                let children = parents.iter().flat_map(|&p| above[p as usize].children);
                reached.extend(children.filter(|&c| c != NONE));
            }
            let changed = next.recompute(level, reached, &missing[level]);
            dirty.push(changed);
        }
        next.renew_hulls(dirty);
        Ok(next)
    }

    /// Coefficients `first .. first + count` of the total spline of `level` (function numbers as in [`LevelEdit`]), last
    /// axis fastest: all levels up to that one written in its functions. Where finer levels are active, they are not in
    /// it.
    ///
    /// # Errors
    /// [`EditError::Level`], [`EditError::Function`].
    pub fn level_coefficients(
        &self,
        level: usize,
        first: [u32; 3],
        count: [usize; 3],
    ) -> Result<Vec<T>, EditError> {
        let last = std::array::from_fn(|a| {
            let last = first[a] as u64 + (count[a] as u64).saturating_sub(1);
            u32::try_from(last).unwrap_or(u32::MAX)
        });
        self.check_function(level, last)?;
        let end: [u32; 3] = self.lattice.cells_at(level).map(|n| n.div_ceil(BRICK as u32) - 1);
        let mut found = vec![T::zero(); count.iter().product()];
        let brick = |a: usize, s: u32| (s / BRICK as u32).min(end[a]);
        let range = |a: usize| brick(a, first[a])..=brick(a, last[a]);
        if found.is_empty() {
            return Ok(found);
        }
        for x in range(0) {
            for y in range(1) {
                for z in range(2) {
                    let key = [x, y, z];
                    let totals = self.totals_at(level, BrickKey(key));
                    let lo: [u32; 3] = std::array::from_fn(|a| first[a].max(key[a] * BRICK as u32));
                    let hi: [u32; 3] = std::array::from_fn(|a| {
                        let own = if key[a] == end[a] { HALO } else { BRICK };
                        last[a].min(key[a] * BRICK as u32 + own as u32 - 1)
                    });
                    for sx in lo[0]..=hi[0] {
                        for sy in lo[1]..=hi[1] {
                            for sz in lo[2]..=hi[2] {
                                let s = [sx, sy, sz];
                                let [i, j, k] = [0, 1, 2].map(|a| (s[a] - key[a] * BRICK as u32) as usize);
                                let [u, v, w] = [0, 1, 2].map(|a| (s[a] - first[a]) as usize);
                                found[(u * count[1] + v) * count[2] + w] = totals[(i * HALO + j) * HALO + k];
                            }
                        }
                    }
                }
            }
        }
        Ok(found)
    }

    /// Totals of a brick; prolonged from coarser levels where the level has none.
    fn totals_at(&self, level: usize, key: BrickKey) -> Arc<[T; HALO_LEN]> {
        if let Some(index) = self.find(level, key) {
            return self.levels[level][index as usize].totals.clone();
        }
        let parent = self.totals_at(level - 1, key.parent());
        let mut totals = [T::zero(); HALO_LEN];
        prolong(&parent, key.octant(), &mut totals);
        Arc::new(totals)
    }

    fn check_function(&self, level: usize, function: [u32; 3]) -> Result<(), EditError> {
        let most = u64::from(self.lattice.cells.into_iter().max().expect("three axes"));
        let max = (0..MAX_LEVELS)
            .rev()
            .find(|l| most << l <= MAX_CELLS)
            .unwrap_or(0)
            .max(self.levels.len() - 1);
        if level > max {
            return Err(EditError::Level { level, max });
        }
        let count = self.lattice.cells_at(level).map(|n| n + 3);
        if (0..3).any(|a| function[a] >= count[a]) {
            return Err(EditError::Function {
                level,
                function,
                count,
            });
        }
        Ok(())
    }

    /// Adds to one correction; returns the bricks that read its function.
    fn add(&mut self, edit: &LevelEdit<T>) -> Result<impl Iterator<Item = BrickKey> + use<T>, EditError> {
        let &LevelEdit {
            level,
            function,
            delta,
        } = edit;
        self.check_function(level, function)?;
        while self.levels.len() <= level {
            self.levels.push(Vec::new());
            self.corrections.push(Arc::default());
        }
        let key = BrickKey(function.map(|s| s / BRICK as u32));
        let slot = function.map(|s| s as usize % BRICK);
        let bricks = Arc::make_mut(&mut self.corrections[level]);
        let corrections = bricks
            .entry(key)
            .or_insert_with(|| Arc::new(Corrections::empty()));
        let corrections = Arc::make_mut(corrections);
        let value = corrections.values[(slot[0] * BRICK + slot[1]) * BRICK + slot[2]] + delta;
        if !value.is_finite() {
            return Err(EditError::NotFinite {
                level,
                function,
                value: value.as_f64(),
            });
        }
        corrections.set(slot, value);
        let limit = self.lattice.cells_at(level).map(|n| n.div_ceil(BRICK as u32));
        Ok((0..8usize).filter_map(move |octant| {
            let back = [octant >> 2, octant >> 1 & 1, octant & 1];
            let reads = (0..3).all(|a| back[a] == 0 || (slot[a] < HALO - BRICK && key.0[a] > 0));
            let reader: [u32; 3] = std::array::from_fn(|a| key.0[a].wrapping_sub(back[a] as u32));
            (reads && (0..3).all(|a| reader[a] < limit[a])).then_some(BrickKey(reader))
        }))
    }

    /// The bricks that `touched` needs and that do not exist, with all their missing parents.
    fn missing(&self, touched: &[BTreeSet<BrickKey>]) -> Vec<BTreeSet<BrickKey>> {
        let mut missing = vec![BTreeSet::new(); touched.len()];
        for level in (0..touched.len()).rev() {
            let finer = missing.get(level + 1).into_iter().flatten();
            let parents: Vec<BrickKey> = finer.map(|key: &BrickKey| key.parent()).collect();
            let wanted = touched[level].iter().copied().chain(parents);
            missing[level] = wanted.filter(|key| self.find(level, *key).is_none()).collect();
        }
        missing
    }

    /// Puts new bricks, still empty, among those of a level and renumbers the children of the level above; the parents
    /// that get a child count as dirty.
    fn insert_bricks(
        &mut self,
        level: usize,
        keys: &BTreeSet<BrickKey>,
        dirty_parents: Option<&mut BTreeSet<u32>>,
    ) {
        let (Some(dirty_parents), false) = (dirty_parents, keys.is_empty()) else {
            return;
        };
        let old = std::mem::take(&mut self.levels[level]);
        let mut place = Vec::with_capacity(old.len());
        let mut merged: Vec<Brick<T>> = Vec::with_capacity(old.len() + keys.len());
        let mut new = keys.iter().peekable();
        let empty = Arc::new([T::zero(); HALO_LEN]);
        let brick = |key: BrickKey| Brick {
            key,
            totals: empty.clone(),
            hull: [T::zero(); 2],
            bend: OnceLock::new(),
            children: [NONE; 8],
        };
        for existing in old {
            while let Some(key) = new.next_if(|key| **key < existing.key) {
                merged.push(brick(*key));
            }
            place.push(merged.len() as u32);
            merged.push(existing);
        }
        merged.extend(new.map(|key| brick(*key)));
        let (above, below) = self.levels.split_at_mut(level);
        below[0] = merged;
        for parent in above[level - 1].iter_mut() {
            for child in parent.children.iter_mut().filter(|c| **c != NONE) {
                *child = place[*child as usize];
            }
        }
        for (index, brick) in below[0].iter().enumerate() {
            if keys.contains(&brick.key) {
                let parent = find(&self.lattice, above, level - 1, brick.key.parent());
                let parent = parent.expect("parents are inserted first");
                let o = brick.key.octant();
                above[level - 1][parent as usize].children[4 * o[0] + 2 * o[1] + o[2]] = index as u32;
                dirty_parents.insert(parent);
            }
        }
    }

    /// Totals of the bricks `reached`; those whose bits change, or that are new, are returned.
    fn recompute(&mut self, level: usize, reached: BTreeSet<u32>, new: &BTreeSet<BrickKey>) -> BTreeSet<u32> {
        let reached: Vec<u32> = reached.into_iter().collect();
        let this = &*self;
        let renewed: Vec<(u32, Arc<[T; HALO_LEN]>)> = reached
            .par_iter()
            .with_min_len(64)
            .filter_map(|&index| {
                let brick = &this.levels[level][index as usize];
                let parent = (level > 0).then(|| {
                    let above = this
                        .find(level - 1, brick.key.parent())
                        .expect("a brick has a parent");
                    &*this.levels[level - 1][above as usize].totals
                });
                let totals = brick_totals(parent, &this.corrections[level], brick.key);
                let keeps = !new.contains(&brick.key) && same_bits(&totals, &brick.totals);
                (!keeps).then_some((index, totals))
            })
            .collect();
        renewed
            .into_iter()
            .map(|(index, totals)| {
                self.levels[level][index as usize].totals = totals;
                index
            })
            .collect()
    }

    /// Hulls of the `dirty` bricks and of all above them, finest first; what is known of their Hessians is forgotten.
    fn renew_hulls(&mut self, mut dirty: Vec<BTreeSet<u32>>) {
        for level in (0..self.levels.len()).rev() {
            for &index in &dirty[level] {
                let brick = &self.levels[level][index as usize];
                let finer = self.levels.get(level + 1).map_or(&[][..], Vec::as_slice);
                let hull = gathered_hull(brick, min_max(brick.totals.as_slice()), finer);
                let brick = &mut self.levels[level][index as usize];
                brick.hull = hull;
                brick.bend = OnceLock::new();
            }
            if level > 0 {
                let parents: Vec<u32> = dirty[level]
                    .iter()
                    .map(|&i| self.levels[level][i as usize].key.parent())
                    .map(|key| self.find(level - 1, key).expect("a brick has a parent"))
                    .collect();
                dirty[level - 1].extend(parents);
            }
        }
    }
}

/// Equal, and zeros of the same sign.
fn same_bits<T: Real>(a: &[T; HALO_LEN], b: &[T; HALO_LEN]) -> bool {
    let same = |(x, y): (&T, &T)| x == y && x.is_sign_negative() == y.is_sign_negative();
    a.iter().zip(b).all(same)
}
