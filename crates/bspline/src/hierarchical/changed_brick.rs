use std::sync::Arc;

use super::block_edit::{BlockEdit, Change};
use super::brick::{BRICK, BrickKey, Corrections, DenseCorrections};
use super::functions::EditError;
use super::graft::Graft;
use super::{HierarchicalSpline, Lattice};
use crate::Real;

/// A brick whose functions change.
pub(super) struct ChangedBrick<T> {
    level: usize,
    key: BrickKey,
    functions: Functions<T>,
    /// Slots that changed, as in [`Corrections::mask`].
    changed: [u64; BRICK],
}

/// The same for those who ask: packed, shared with the field until they change, where a change costs a search; or with a
/// place for every slot, which costs unpacking.
enum Functions<T> {
    Packed(Arc<Corrections<T>>),
    Dense(DenseCorrections<T>),
}

impl<T: Real> ChangedBrick<T> {
    /// A brick as it is; `is_packed` where few of its functions are to change.
    pub fn of(field: &HierarchicalSpline<T>, level: usize, key: BrickKey, is_packed: bool) -> Self {
        let node = field.find(level, key);
        let old = node.and_then(|n| n.corrections.as_ref());
        let functions = match (is_packed, old) {
            (true, Some(old)) => Functions::Packed(old.clone()),
            (true, None) => Functions::Packed(Arc::new(Corrections::empty())),
            (false, Some(old)) => Functions::Dense((&**old).into()),
            (false, None) => Functions::Dense(DenseCorrections::empty()),
        };
        Self {
            level,
            key,
            functions,
            changed: [0; BRICK],
        }
    }

    /// Adds to the coefficients of functions.
    pub fn add(&mut self, add: &Corrections<T>) -> Result<(), EditError> {
        let (sum, changed) = match &self.functions {
            Functions::Packed(functions) => functions.plus(add),
            Functions::Dense(functions) => functions.pack().plus(add),
        };
        if let Some((slot, value)) = sum.unfit() {
            let at = [slot / BRICK / BRICK, slot / BRICK % BRICK, slot % BRICK];
            let function = std::array::from_fn(|a| self.key.0[a] * BRICK as u32 + at[a] as u32);
            return Err(self.not_finite(function, value));
        }
        self.functions = Functions::Packed(Arc::new(sum));
        self.changed = std::array::from_fn(|x| self.changed[x] | changed[x]);
        Ok(())
    }

    /// Does what a block asks of the brick's functions; `last` is the block's last.
    pub fn put_block(&mut self, edit: &BlockEdit<T>, last: [u32; 3]) -> Result<(), EditError> {
        let corner = self.key.0.map(|k| k * BRICK as u32);
        let range = |a: usize| edit.first[a].max(corner[a])..=last[a].min(corner[a] + BRICK as u32 - 1);
        for x in range(0) {
            for y in range(1) {
                for z in range(2) {
                    let [i, j, k] =
                        [x - edit.first[0], y - edit.first[1], z - edit.first[2]].map(|n| n as usize);
                    let n = (i * edit.shape[1] + j) * edit.shape[2] + k;
                    self.put([x, y, z], |old| match &edit.change {
                        Change::Add(values) => Some(old.unwrap_or(T::zero()) + values[n]),
                        Change::Set(values) => Some(values[n]),
                        Change::Deactivate => None,
                    })?;
                }
            }
        }
        Ok(())
    }

    /// Changes one function: from its coefficient, none if it is not active, to a new one.
    #[inline]
    pub fn put(
        &mut self,
        function: [u32; 3],
        change: impl FnOnce(Option<T>) -> Option<T>,
    ) -> Result<(), EditError> {
        let [x, y, z] = function.map(|s| s as usize % BRICK);
        let slot = (x * BRICK + y) * BRICK + z;
        let old = match &self.functions {
            Functions::Packed(functions) => functions.get(slot),
            Functions::Dense(functions) => functions.get(slot),
        };
        let new = change(old);
        if let Some(new) = new.filter(|new| !new.is_finite()) {
            return Err(self.not_finite(function, new));
        }
        if old != new {
            self.changed[x] |= 1 << (slot % 64);
            match &mut self.functions {
                Functions::Packed(functions) => Arc::make_mut(functions).put(slot, new),
                Functions::Dense(functions) => functions.put(slot, new),
            }
        }
        Ok(())
    }

    /// What the tree is to do, if anything has changed.
    pub fn graft(self, lattice: &Lattice) -> Option<Graft<T>> {
        if self.changed == [0; BRICK] {
            return None;
        }
        let place = (self.level, self.key);
        Some(Graft::new(
            lattice,
            place,
            self.changed,
            Some(self.functions.packed()),
        ))
    }

    fn not_finite(&self, function: [u32; 3], value: T) -> EditError {
        EditError::NotFinite {
            level: self.level,
            function,
            value: value.as_f64(),
        }
    }
}

impl<T: Real> Functions<T> {
    fn packed(self) -> Arc<Corrections<T>> {
        match self {
            Self::Packed(functions) => functions,
            Self::Dense(functions) => Arc::new(functions.pack()),
        }
    }
}
