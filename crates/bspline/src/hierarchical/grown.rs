use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DAffine3, DVec3};

use super::brick::{BRICK, DenseCorrections};
use super::{BrickKey, EditError, HierarchicalSpline, Lattice, LevelCorrections};
use crate::{Field, Real};

impl Lattice {
    /// The lattice with `before` and `behind` more cells of level 0 on each axis; every knot stays where it is.
    pub fn grown(&self, before: [u32; 3], behind: [u32; 3]) -> Self {
        let back = DAffine3::from_translation(-DVec3::from_array(before.map(f64::from)));
        Self {
            world_from_lattice: self.world_from_lattice * back,
            cells: std::array::from_fn(|a| self.cells[a] + before[a] + behind[a]),
        }
    }

    /// Cells before and behind this lattice by which `larger` is the same one [grown](Self::grown).
    pub fn growth_to(&self, larger: &Self) -> Option<[[u32; 3]; 2]> {
        let start = larger
            .world_from_lattice
            .inverse()
            .transform_point3(self.world_from_lattice.translation);
        let before = start.round();
        let room = DVec3::from_array(larger.cells.map(f64::from)) - before - self.extent();
        let is_grown = self.world_from_lattice.matrix3 == larger.world_from_lattice.matrix3
            && start.abs_diff_eq(before, 1e-6)
            && before.cmpge(DVec3::ZERO).all()
            && room.cmpge(DVec3::ZERO).all();
        is_grown.then(|| [before, room].map(|cells| cells.to_array().map(|n| n as u32)))
    }
}

impl<T: Real> HierarchicalSpline<T> {
    /// The field with a larger box: `before` and `behind` more cells of level 0 on each axis.
    ///
    /// In the old box every function stays and no value changes but by rounding. Beyond it the field goes on about as it did outside the
    /// box. The two share nothing: it takes as long as building the field.
    ///
    /// # Errors
    /// Those of [`Self::try_from_corrections`]: [`EditError::Function`] for a box too large for its levels.
    pub fn grown(&self, before: [u32; 3], behind: [u32; 3]) -> Result<Self, EditError> {
        let lattice = self.lattice.grown(before, behind);
        let mut levels: Vec<LevelCorrections<T>> = (0..self.level_count())
            .map(|level| shifted(&self.corrections(level), before.map(|n| n << level)))
            .collect();
        let mut level: BTreeMap<BrickKey, DenseCorrections<T>> = BTreeMap::new();
        for (key, functions) in &levels[0] {
            level.insert(*key, DenseCorrections::from(&**functions));
        }
        // Function `s` is centred on knot `s - 1`.
        let own = |a: usize, s: u32| (before[a]..before[a] + self.lattice.cells[a] + 3).contains(&s);
        let [nx, ny, nz] = lattice.cells.map(|n| n + 3);
        for x in 0..nx {
            for y in 0..ny {
                for z in 0..nz {
                    if own(0, x) && own(1, y) && own(2, z) {
                        continue;
                    }
                    let knot = DVec3::new(x.into(), y.into(), z.into()) - 1.0;
                    let value = self.value(lattice.world_from_lattice.transform_point3(knot));
                    put(&mut level, [x, y, z], T::from_f64(value));
                }
            }
        }
        levels[0] = packed(level);
        Self::try_from_corrections(lattice, self.slope(), levels)
    }
}

/// The functions of a level with larger numbers.
pub fn shifted<T: Real>(level: &LevelCorrections<T>, by: [u32; 3]) -> LevelCorrections<T> {
    let mut out = BTreeMap::new();
    for (key, functions) in level {
        for (slot, value) in functions.iter() {
            let at = [slot / BRICK / BRICK, slot / BRICK % BRICK, slot % BRICK];
            let function = std::array::from_fn(|a| key.0[a] * BRICK as u32 + at[a] as u32 + by[a]);
            put(&mut out, function, value);
        }
    }
    packed(out)
}

fn put<T: Real>(level: &mut BTreeMap<BrickKey, DenseCorrections<T>>, function: [u32; 3], value: T) {
    let brick = level.entry(BrickKey::of(function));
    let brick = brick.or_insert_with(DenseCorrections::empty);
    brick.set(function.map(|s| s as usize % BRICK), value);
}

fn packed<T: Real>(level: BTreeMap<BrickKey, DenseCorrections<T>>) -> LevelCorrections<T> {
    let bricks = level.into_iter();
    bricks
        .map(|(key, functions)| (key, Arc::new(functions.pack())))
        .collect()
}
