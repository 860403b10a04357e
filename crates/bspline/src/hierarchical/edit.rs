//! Changes of coefficients, sharing all bricks that they leave as they were.

use std::collections::BTreeMap;
use std::sync::Arc;

use rayon::prelude::*;

use super::block_edit::{BlockEdit, Change, last_of};
use super::brick::{BRICK, Corrections, HALO, HALO_LEN};
use super::changed_brick::ChangedBrick;
use super::functions::{EditError, check_function, check_functions};
use super::graft::{Graft, Way};
use super::prolong::prolong;
use super::renew::renewed;
use super::{BrickKey, HierarchicalSpline};
use crate::Real;

/// What is added to the coefficient of one function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelEdit<T> {
    /// Level of the function, 0 the coarsest; may be finer than the field was so far.
    pub level: usize,
    /// Number of the function on each axis, `0 .. cells + 3`: number `s` is centred on knot `s - 1`.
    pub function: [u32; 3],
    /// What is added to its coefficient; 0 makes the function active and changes nothing else.
    pub delta: T,
}

/// What is added to functions of one brick.
#[derive(Clone, Debug, PartialEq)]
pub struct BrickEdit<T> {
    /// Level of the brick, 0 the coarsest; may be finer than the field was so far.
    pub level: usize,
    /// Place of the brick.
    pub key: BrickKey,
    /// Its functions become active, its coefficients are added to theirs.
    pub add: Corrections<T>,
}

impl<T: Real> HierarchicalSpline<T> {
    /// The field with coefficients added, in the order given; functions that were not active become so.
    ///
    /// See [`Self::edited_blocks`].
    ///
    /// # Errors
    /// Any [`EditError`]; then nothing is done.
    pub fn edited(&self, edits: &[LevelEdit<T>]) -> Result<Self, EditError> {
        for edit in edits {
            check_function(&self.lattice, edit.level, edit.function)?;
        }
        const FEW: usize = 8;
        let place = |edit: &LevelEdit<T>| (edit.level, BrickKey::of(edit.function));
        self.edited_by_brick(edits, FEW, place, |brick, edit| {
            brick.put(edit.function, |old| Some(old.unwrap_or(T::zero()) + edit.delta))
        })
    }

    /// The field with edits put into their bricks, brick beside brick; those of one brick in their order. `few`: as many
    /// edits of one brick do not pay for [`DenseCorrections`](super::DenseCorrections).
    fn edited_by_brick<E: Sync>(
        &self,
        edits: &[E],
        few: usize,
        place: impl Fn(&E) -> (usize, BrickKey) + Sync,
        put: impl Fn(&mut ChangedBrick<T>, &E) -> Result<(), EditError> + Sync,
    ) -> Result<Self, EditError> {
        // In the order of the tree, so that bricks close in it are found one after the other.
        let way = |edit: &E| Way::to(&self.lattice, place(edit));
        let mut order: Vec<_> = edits.iter().map(|edit| (way(edit), edit)).collect();
        order.sort_by_key(|(way, _)| *way);
        let groups: Vec<_> = order.chunk_by(|a, b| a.0 == b.0).collect();
        let changed = groups.into_par_iter().with_min_len(64).map(|group| {
            let (level, key) = place(group[0].1);
            let mut brick = ChangedBrick::of(self, level, key, group.len() <= few);
            group.iter().try_for_each(|(_, edit)| put(&mut brick, edit))?;
            Ok(brick.graft(&self.lattice))
        });
        // The first error, whichever thread meets one first.
        let grafts: Vec<Result<_, EditError>> = changed.collect();
        let grafts = grafts.into_iter().filter_map(Result::transpose);
        Ok(self.with_grafts(grafts.collect::<Result<_, _>>()?))
    }

    /// The field with blocks of coefficients changed, in the order given.
    ///
    /// The very field, to the bit, that [`Self::from_corrections`] makes of the new corrections. `self` stays as it is,
    /// and all bricks that come out with the bits they had are shared by both: the old version costs the bricks changed,
    /// and keeping it is how an edit is undone (subtraction would not give the old bits back). Only the bricks that the
    /// functions reach are computed, and only the paths to them are copied.
    ///
    /// # Errors
    /// Any [`EditError`]; then nothing is done.
    pub fn edited_blocks(&self, edits: &[BlockEdit<T>]) -> Result<Self, EditError> {
        let mut bricks: BTreeMap<(usize, BrickKey), ChangedBrick<T>> = BTreeMap::new();
        for edit in edits {
            let [nx, ny, nz] = edit.shape;
            let found = match &edit.change {
                Change::Add(values) | Change::Set(values) => values.len(),
                Change::Deactivate => nx * ny * nz,
            };
            if found != nx * ny * nz {
                return Err(EditError::Length {
                    shape: edit.shape,
                    found,
                });
            }
            if found == 0 {
                continue;
            }
            let last = last_of(edit.first, edit.shape);
            check_function(&self.lattice, edit.level, last)?;
            for key in keys_between(BrickKey::of(edit.first), BrickKey::of(last)) {
                bricks
                    .entry((edit.level, key))
                    .or_insert_with(|| ChangedBrick::of(self, edit.level, key, false))
                    .put_block(edit, last)?;
            }
        }
        let bricks: Vec<_> = bricks.into_values().collect();
        let grafts = bricks
            .into_par_iter()
            .with_min_len(64)
            .filter_map(|brick| brick.graft(&self.lattice));
        Ok(self.with_grafts(grafts.collect()))
    }

    /// The field with coefficients added brick by brick; of several edits of one brick all are added, in order.
    ///
    /// See [`Self::edited_blocks`].
    ///
    /// # Errors
    /// Any [`EditError`]; then nothing is done.
    pub fn added(&self, edits: &[BrickEdit<T>]) -> Result<Self, EditError> {
        for edit in edits {
            check_functions(&self.lattice, edit.level, edit.key, &edit.add)?;
        }
        let place = |edit: &BrickEdit<T>| (edit.level, edit.key);
        self.edited_by_brick(edits, usize::MAX, place, |brick, edit| brick.add(&edit.add))
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
        let last = last_of(first, count);
        check_function(&self.lattice, level, last)?;
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
        if let Some(totals) = self.find(level, key).and_then(|n| n.totals.as_ref()) {
            return totals.clone();
        }
        let parent = self.totals_at(level - 1, key.parent());
        let mut totals = [T::zero(); HALO_LEN];
        prolong(&parent, key.octant(), &mut totals);
        Arc::new(totals)
    }
}

fn keys_between(first: BrickKey, last: BrickKey) -> impl Iterator<Item = BrickKey> {
    let range = move |a: usize| first.0[a]..=last.0[a];
    range(0).flat_map(move |x| range(1).flat_map(move |y| range(2).map(move |z| BrickKey([x, y, z]))))
}

impl<T: Real> HierarchicalSpline<T> {
    /// The field with other functions in some bricks.
    pub(super) fn with_grafts(&self, grafts: Vec<Graft<T>>) -> Self {
        if grafts.is_empty() {
            return self.clone();
        }
        Self {
            root: renewed(&self.lattice, Some(&self.root), grafts, 0),
            ..self.clone()
        }
    }
}
