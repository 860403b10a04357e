//! Changes of coefficients, sharing all bricks that they leave as they were.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::brick::{BRICK, DenseCorrections, HALO, HALO_LEN, reaches};
use super::graft::{Graft, grafted};
use super::prolong::prolong;
use super::renew::renewed;
use super::{BrickKey, HierarchicalSpline, Lattice};
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
    /// What is added to its coefficient; 0 makes the function active and changes nothing else.
    pub delta: T,
}

/// What is done to a block of functions of one level.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockEdit<T> {
    /// Level of the functions, 0 the coarsest; may be finer than the field was so far.
    pub level: usize,
    /// Number of the block's first function on each axis.
    pub first: [u32; 3],
    /// Functions on each axis.
    pub shape: [usize; 3],
    /// What is done.
    pub change: Change<T>,
}

/// What an edit does to the corrections of its functions. Values stand in the order of the functions, z fastest.
#[derive(Clone, Debug, PartialEq)]
pub enum Change<T> {
    /// Adds to them; functions that were not active become so. Zeros insert knots without a change.
    Add(Vec<T>),
    /// Sets them; functions that were not active become so.
    Set(Vec<T>),
    /// Takes the functions out of the field; bricks that no function reaches any more go with them.
    Deactivate,
}

/// Why coefficients cannot be changed.
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
    /// A block's values do not fit its shape.
    #[error("a block of {shape:?} functions takes as many values; there are {found}")]
    Length {
        /// Functions on each axis.
        shape: [usize; 3],
        /// Values given.
        found: usize,
    },
}

impl<T: Real> HierarchicalSpline<T> {
    /// The field with coefficients added, in the order given; functions that were not active become so.
    ///
    /// See [`Self::edited_blocks`].
    ///
    /// # Errors
    /// Any [`EditError`]; then nothing is done.
    pub fn edited(&self, edits: &[LevelEdit<T>]) -> Result<Self, EditError> {
        let mut pending = Pending::new(self);
        for edit in edits {
            check_function(&self.lattice, edit.level, edit.function)?;
            let &LevelEdit {
                level,
                function,
                delta,
            } = edit;
            pending.put(level, function, |old| Some(old.unwrap_or(T::zero()) + delta))?;
        }
        Ok(pending.apply())
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
        let mut pending = Pending::new(self);
        for edit in edits {
            let (Change::Add(values) | Change::Set(values)) = &edit.change else {
                edit.each(&self.lattice, |_, function| {
                    pending.put(edit.level, function, |_| None)
                })?;
                continue;
            };
            if values.len() != edit.shape.iter().product::<usize>() {
                return Err(EditError::Length {
                    shape: edit.shape,
                    found: values.len(),
                });
            }
            let adds = matches!(edit.change, Change::Add(_));
            edit.each(&self.lattice, |i, function| {
                pending.put(edit.level, function, |old| {
                    let base = old.filter(|_| adds);
                    Some(base.map_or(values[i], |old| old + values[i]))
                })
            })?;
        }
        Ok(pending.apply())
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

impl<T> BlockEdit<T> {
    /// Calls `visit` with the place in `values` and the number of every function.
    fn each(
        &self,
        lattice: &Lattice,
        mut visit: impl FnMut(usize, [u32; 3]) -> Result<(), EditError>,
    ) -> Result<(), EditError> {
        let [nx, ny, nz] = self.shape;
        if nx * ny * nz == 0 {
            return Ok(());
        }
        check_function(lattice, self.level, last_of(self.first, self.shape))?;
        for x in 0..nx {
            for y in 0..ny {
                for z in 0..nz {
                    let at = [x, y, z];
                    let function = std::array::from_fn(|a| self.first[a] + at[a] as u32);
                    visit((x * ny + y) * nz + z, function)?;
                }
            }
        }
        Ok(())
    }
}

fn last_of(first: [u32; 3], count: [usize; 3]) -> [u32; 3] {
    std::array::from_fn(|a| {
        let last = first[a] as u64 + (count[a] as u64).saturating_sub(1);
        u32::try_from(last).unwrap_or(u32::MAX)
    })
}

/// Whether a lattice has the functions of a level up to number `function`.
pub(super) fn check_function(lattice: &Lattice, level: usize, function: [u32; 3]) -> Result<(), EditError> {
    let most = u64::from(lattice.cells.into_iter().max().expect("three axes"));
    let max = (0..MAX_LEVELS)
        .rev()
        .find(|l| most << l <= MAX_CELLS)
        .unwrap_or(0);
    if level > max {
        return Err(EditError::Level { level, max });
    }
    let count = lattice.cells_at(level).map(|n| n + 3);
    if (0..3).any(|a| function[a] >= count[a]) {
        return Err(EditError::Function {
            level,
            function,
            count,
        });
    }
    Ok(())
}

/// Bricks with changed functions.
struct Pending<'a, T> {
    field: &'a HierarchicalSpline<T>,
    bricks: BTreeMap<(usize, BrickKey), Brick<T>>,
    /// The brick of the last change, out of `bricks`: changes come in blocks.
    last: Option<((usize, BrickKey), Brick<T>)>,
}

struct Brick<T> {
    corrections: DenseCorrections<T>,
    /// Slots that changed, as in [`DenseCorrections::mask`].
    changed: [u64; BRICK],
}

impl<'a, T: Real> Pending<'a, T> {
    fn new(field: &'a HierarchicalSpline<T>) -> Self {
        Self {
            field,
            bricks: BTreeMap::new(),
            last: None,
        }
    }

    fn brick(&mut self, place: (usize, BrickKey)) -> &mut Brick<T> {
        if self.last.as_ref().is_none_or(|(last, _)| *last != place) {
            if let Some((last, brick)) = self.last.take() {
                self.bricks.insert(last, brick);
            }
            let brick = self.bricks.remove(&place).unwrap_or_else(|| {
                let node = self.field.find(place.0, place.1);
                let corrections = node.and_then(|n| n.corrections.as_deref());
                Brick {
                    corrections: corrections.map_or_else(DenseCorrections::empty, DenseCorrections::from),
                    changed: [0; BRICK],
                }
            });
            self.last = Some((place, brick));
        }
        &mut self.last.as_mut().expect("just set").1
    }

    /// Changes one function: from its coefficient, none if it is not active, to a new one.
    fn put(
        &mut self,
        level: usize,
        function: [u32; 3],
        change: impl FnOnce(Option<T>) -> Option<T>,
    ) -> Result<(), EditError> {
        let brick = self.brick((level, BrickKey(function.map(|s| s / BRICK as u32))));
        let slot = function.map(|s| s as usize % BRICK);
        let bit = 1 << (BRICK * slot[1] + slot[2]);
        let is_active = brick.corrections.mask[slot[0]] & bit != 0;
        let value = &mut brick.corrections.values[(slot[0] * BRICK + slot[1]) * BRICK + slot[2]];
        let old = is_active.then_some(*value);
        let new = change(old);
        if let Some(new) = new.filter(|new| !new.is_finite()) {
            return Err(EditError::NotFinite {
                level,
                function,
                value: new.as_f64(),
            });
        }
        if old != new {
            *value = new.unwrap_or(T::zero());
            brick.changed[slot[0]] |= bit;
            brick.corrections.mask[slot[0]] &= !bit;
            if new.is_some() {
                brick.corrections.mask[slot[0]] |= bit;
            }
        }
        Ok(())
    }

    fn apply(mut self) -> HierarchicalSpline<T> {
        self.bricks.extend(self.last.take());
        let lattice = &self.field.lattice;
        let mut grafts = Vec::new();
        for ((level, key), brick) in self.bricks {
            if brick.changed == [0; BRICK] {
                continue;
            }
            let readers = readers(key, brick.changed);
            grafts.extend(readers.map(|key| Graft::stale(lattice, level, key)));
            let is_empty = brick.corrections.mask == [0; BRICK];
            let functions = (!is_empty).then(|| Arc::new(brick.corrections.pack()));
            grafts.push(Graft::functions(lattice, level, key, functions));
        }
        self.field.with_grafts(grafts)
    }
}

impl<T: Real> HierarchicalSpline<T> {
    /// The field with other functions in some bricks, whose readers are among the grafts.
    pub(super) fn with_grafts(&self, grafts: Vec<Graft<T>>) -> Self {
        if grafts.is_empty() {
            return self.clone();
        }
        let grafted = grafted(&self.lattice, Some(&self.root), grafts);
        Self {
            root: renewed(&self.lattice, Some(&self.root), &grafted),
            ..self.clone()
        }
    }
}

/// The bricks behind one whose cells read its functions `mask`.
pub(super) fn readers(key: BrickKey, mask: [u64; BRICK]) -> impl Iterator<Item = BrickKey> {
    (1..8usize).filter_map(move |octant| {
        let back = [octant >> 2, octant >> 1 & 1, octant & 1];
        let is_read = (0..3).all(|a| key.0[a] as usize >= back[a]) && reaches(&mask, back);
        is_read.then(|| BrickKey(std::array::from_fn(|a| key.0[a] - back[a] as u32)))
    })
}
