//! From solved levels to a field.

use std::collections::BTreeMap;
use std::sync::Arc;

use bspline::hierarchical::Lattice;
use bspline::hierarchical::{BRICK, BrickKey, DenseCorrections, LevelCorrections};
use bspline::{HierarchicalSpline, Real};
use glam::{DAffine3, DMat3, DVec3};

use super::BASE_DEPTH;
use super::band::{self, Key};
use super::full_grid::FullGrid;

/// The stored part of a level: the corrections `x` of its active functions, brick by brick.
pub(crate) struct Level<T> {
    pub keys: Vec<Key>,
    pub masks: Vec<u64>,
    pub x: Vec<T>,
}

/// The field in the box of edge `scale` at `origin`: level 0 is the full base level, the others what their solves found,
/// scaled to world units.
pub(crate) fn assemble<T: Real>(
    origin: DVec3,
    scale: f64,
    base: &FullGrid<f64>,
    levels: &[Level<T>],
) -> HierarchicalSpline<T> {
    let mut stored: Vec<LevelCorrections<T>> = Vec::with_capacity(levels.len() + 1);
    let m = base.width();
    let mut bottom: BTreeMap<BrickKey, DenseCorrections<T>> = BTreeMap::new();
    for (i, c) in base.values.iter().enumerate() {
        let s = [i / (m * m), i / m % m, i % m];
        let key = BrickKey(s.map(|s| (s / BRICK) as u32));
        let value = T::from_f64(c * scale);
        bottom
            .entry(key)
            .or_insert_with(DenseCorrections::empty)
            .set(s.map(|s| s % BRICK), value);
    }
    stored.push(bottom.into_iter().map(|(k, c)| (k, Arc::new(c.pack()))).collect());
    let unit = T::from_f64(scale);
    for level in levels {
        let mut values = level.x.iter();
        let mut bricks: BTreeMap<BrickKey, DenseCorrections<T>> = BTreeMap::new();
        for (key, &mask) in level.keys.iter().zip(&level.masks).filter(|(_, m)| **m != 0) {
            let corner = key.map(|k| k as usize * band::BRICK);
            let brick = bricks
                .entry(BrickKey(corner.map(|c| (c / BRICK) as u32)))
                .or_insert_with(DenseCorrections::empty);
            for (slot, value) in band::active_slots(mask).zip(values.by_ref()) {
                let within = [slot / 16, slot / 4 % 4, slot % 4];
                brick.set(
                    std::array::from_fn(|a| corner[a] % BRICK + within[a]),
                    *value * unit,
                );
            }
        }
        let corrections = bricks.into_iter().map(|(k, c)| (k, Arc::new(c.pack()))).collect();
        stored.push(corrections);
    }
    HierarchicalSpline::from_corrections(lattice(origin, scale), 1.0, stored)
}

/// The grids of a fit in the box of edge `scale` at `origin`: level 0 has 32 cells along it.
pub(crate) fn lattice(origin: DVec3, scale: f64) -> Lattice {
    let cells = 1u32 << BASE_DEPTH;
    Lattice {
        world_from_lattice: DAffine3 {
            matrix3: DMat3::from_diagonal(DVec3::splat(scale / cells as f64)),
            translation: origin,
        },
        cells: [cells; 3],
    }
}
