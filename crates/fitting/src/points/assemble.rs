//! From the levels of a cascade to a field.

use std::collections::BTreeMap;
use std::sync::Arc;

use bspline::hierarchical::{BRICK, BrickKey, DenseCorrections, LevelCorrections};
use bspline::{HierarchicalSpline, Real};
use glam::DVec3;

use super::band;
use super::cascade::Level;
use super::full_grid::FullGrid;
use super::samples::{Samples, lattice};

/// The field: level 0 is the full base level, the others what the cascade found, scaled to world units.
pub(crate) fn assemble<T: Real>(
    samples: &Samples,
    base: &FullGrid<f64>,
    levels: &[Level<T>],
) -> HierarchicalSpline<T> {
    assemble_in(samples.origin, samples.scale, base, levels)
}

/// The same for the box of edge `scale` at `origin`.
pub(crate) fn assemble_in<T: Real>(
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
