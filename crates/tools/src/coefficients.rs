//! Single functions of a field: where they reach, and versions in which some of them are others.

use std::collections::BTreeMap;
use std::sync::Arc;

use bspline::hierarchical::{BRICK, BrickChange, BrickDiff, BrickKey, DenseCorrections, DiffError};
use bspline::{Aabb, HierarchicalSpline, Real};
use glam::DVec3;

/// Functions by level and number, with their coefficients; none is to be inactive.
pub type Functions<T> = BTreeMap<(usize, [u32; 3]), Option<T>>;

/// World place of a function's knot, and a world box about its support in the field's own box.
pub fn support<T: Real>(field: &HierarchicalSpline<T>, level: usize, function: [u32; 3]) -> (DVec3, Aabb) {
    let lattice = field.lattice();
    let spacing = 1.0 / (1u64 << level) as f64;
    // Function `s` is centred on knot `s - 1`.
    let knot = (DVec3::from_array(function.map(f64::from)) - 1.0) * spacing;
    let extent = lattice.extent();
    let end = |reach: f64| (knot + reach * spacing).clamp(DVec3::ZERO, extent);
    let map = &lattice.world_from_lattice;
    (
        map.transform_point3(knot),
        Aabb::new(end(-2.0), end(2.0)).transformed(map),
    )
}

/// Coefficient of a function, if it is active.
pub fn coefficient<T: Real>(field: &HierarchicalSpline<T>, level: usize, function: [u32; 3]) -> Option<T> {
    let brick = field.brick_corrections(level, BrickKey::of(function))?;
    brick.get(slot_of(function))
}

/// Functions that differ between two versions, with the coefficients of the newer one.
///
/// # Errors
/// [`DiffError::Lattice`].
pub fn changed<T: Real>(
    old: &HierarchicalSpline<T>,
    new: &HierarchicalSpline<T>,
) -> Result<Functions<T>, DiffError> {
    let mut found = Functions::new();
    for BrickChange { level, key, old, new } in old.difference(new)?.bricks {
        for slot in 0..BRICK * BRICK * BRICK {
            let [old, new] = [&old, &new].map(|side| side.as_ref().and_then(|c| c.get(slot)));
            if old != new {
                let at = [slot / BRICK / BRICK, slot / BRICK % BRICK, slot % BRICK];
                let function = std::array::from_fn(|a| key.0[a] * BRICK as u32 + at[a] as u32);
                found.insert((level, function), new);
            }
        }
    }
    Ok(found)
}

/// The field with these functions.
///
/// # Errors
/// [`DiffError`] for a function that the lattice does not have.
pub fn with_functions<T: Real>(
    field: &HierarchicalSpline<T>,
    functions: &Functions<T>,
) -> Result<HierarchicalSpline<T>, DiffError> {
    let mut bricks: BTreeMap<(usize, BrickKey), DenseCorrections<T>> = BTreeMap::new();
    for ((level, function), value) in functions {
        let key = BrickKey::of(*function);
        let brick = bricks.entry((*level, key)).or_insert_with(|| {
            let own = field.brick_corrections(*level, key);
            own.map_or_else(DenseCorrections::empty, |own| DenseCorrections::from(&**own))
        });
        let slot = slot_of(*function);
        match value {
            Some(value) => brick.set([slot / 64, slot / 8 % 8, slot % 8], *value),
            None => {
                brick.mask[slot / 64] &= !(1 << (slot % 64));
                brick.values[slot] = T::zero();
            }
        }
    }
    let change = |((level, key), new): ((usize, BrickKey), DenseCorrections<T>)| {
        let new = new.pack();
        BrickChange {
            level,
            key,
            old: field.brick_corrections(level, key).cloned(),
            new: (new.count() > 0).then(|| Arc::new(new)),
        }
    };
    let bricks = bricks
        .into_iter()
        .map(change)
        .filter(|change| change.old != change.new);
    field.applied(&BrickDiff {
        bricks: bricks.collect(),
    })
}

fn slot_of(function: [u32; 3]) -> usize {
    let [x, y, z] = function.map(|s| s as usize % BRICK);
    (x * BRICK + y) * BRICK + z
}
