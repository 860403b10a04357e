use std::collections::BTreeMap;
use std::sync::Arc;

use rustc_hash::FxHashMap;

use super::brick::Brick;
use super::{BrickKey, Corrections, Lattice};
use crate::Real;

/// The stored part of a level: bricks with active functions, in key order.
pub type LevelCorrections<T> = BTreeMap<BrickKey, Arc<Corrections<T>>>;

/// A field of dyadic cubic B-splines, C² everywhere inside its box.
///
/// Outside the box, `f(clamp x) - g·|x - clamp x|` (world distance, `g` the `slope`).
#[derive(Clone, Debug)]
pub struct HierarchicalSpline<T> {
    lattice: Lattice,
    slope: f64,
    levels: Vec<Level<T>>,
}

#[derive(Clone, Debug)]
struct Level<T> {
    bricks: Vec<(BrickKey, Brick<T>)>,
    index: FxHashMap<BrickKey, u32>,
}

impl<T: Real> HierarchicalSpline<T> {
    /// Builds the totals of every level from the stored corrections.
    pub fn from_corrections(_lattice: Lattice, _slope: f64, _levels: Vec<LevelCorrections<T>>) -> Self {
        unimplemented!()
    }
    /// Bricks of `level` that hold active functions, in key order.
    pub fn corrections(&self, _level: usize) -> impl Iterator<Item = (BrickKey, &Arc<Corrections<T>>)> {
        std::iter::empty()
    }
    /// Grids the field stands on.
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }
    /// Fall of the field per world length outside the box, `> 0`.
    pub fn slope(&self) -> f64 {
        self.slope
    }
    /// Number of levels, at least 1.
    pub fn level_count(&self) -> usize {
        self.levels.len()
    }
    /// Active functions over all levels.
    pub fn coefficient_count(&self) -> usize {
        0
    }
    /// Bricks over all levels.
    pub fn brick_count(&self) -> usize {
        0
    }
    /// Bytes of the totals that evaluation reads.
    pub fn totals_bytes(&self) -> usize {
        0
    }
    /// SHA-256 of the canonical form (see `docs/format.md`).
    pub fn sha256(&self) -> [u8; 32] {
        [0; 32]
    }
}
