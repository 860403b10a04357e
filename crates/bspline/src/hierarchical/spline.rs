use std::sync::Arc;

use glam::{DAffine3, DVec3};
use sha2::{Digest, Sha256};

use super::brick::{BRICK, Brick, HALO_LEN, NONE};
use super::build::build_levels;
use super::{BrickKey, Lattice, LevelCorrections};
use crate::Real;
use crate::placed_box::PlacedBox;

/// A field of dyadic cubic B-splines, C² everywhere inside its box.
///
/// Each level stores corrections to the prolonged coarser level, and the totals of the two, so that a point
/// is evaluated from the 64 coefficients of one level however deep the hierarchy is.
/// Outside the box, `f(clamp x) - g·|x - clamp x|` (clamped in lattice coordinates, world distance, `g` the
/// [slope](Self::slope)).
#[derive(Clone, Debug)]
pub struct HierarchicalSpline<T> {
    pub(super) lattice: Lattice,
    pub(super) place: PlacedBox,
    pub(super) corrections: Vec<Arc<LevelCorrections<T>>>,
    pub(super) levels: Vec<Vec<Brick<T>>>,
}

/// A point of the box, found: which brick evaluates it, which cell of that brick, where in the cell.
pub(super) struct Place<'a, T> {
    pub brick: &'a Brick<T>,
    pub level: usize,
    /// Place of the brick among those of its level.
    pub index: u32,
    pub cell: [usize; 3],
    pub t: [T; 3],
}

impl<T: Real> HierarchicalSpline<T> {
    /// Builds the totals of every level from the stored corrections, coarsest level first.
    ///
    /// `slope > 0` is the fall of the field per world length outside the box.
    ///
    /// # Panics
    /// If `levels` is empty, the box has no cells, or the lattice's map cannot be inverted.
    pub fn from_corrections(lattice: Lattice, slope: f64, levels: Vec<LevelCorrections<T>>) -> Self {
        assert!(!levels.is_empty(), "a hierarchy has at least one level");
        assert!(
            lattice.cells.iter().all(|&n| n > 0),
            "a box has at least one cell on each axis"
        );
        let lattice_from_world = lattice.world_from_lattice.inverse();
        assert!(
            lattice_from_world.is_finite(),
            "the map from lattice to world can be inverted"
        );
        let levels: Vec<_> = levels.into_iter().map(Arc::new).collect();
        let bricks = build_levels(&lattice, &levels);
        Self {
            lattice,
            place: PlacedBox {
                min: DVec3::ZERO,
                max: lattice.extent(),
                world_from_local: lattice.world_from_lattice,
                local_from_world: lattice_from_world,
                slope,
            },
            corrections: levels,
            levels: bricks,
        }
    }

    /// Bricks of `level` that hold active functions, in key order.
    ///
    /// # Panics
    /// If there is no such level.
    pub fn corrections(&self, level: usize) -> &LevelCorrections<T> {
        &self.corrections[level]
    }

    /// Grids the field stands on.
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// World to lattice coordinates.
    pub fn lattice_from_world(&self) -> &DAffine3 {
        &self.place.local_from_world
    }

    /// Fall of the field per world length outside the box, `> 0`.
    pub fn slope(&self) -> f64 {
        self.place.slope
    }

    /// Number of levels, at least 1.
    pub fn level_count(&self) -> usize {
        self.levels.len()
    }

    /// Active functions over all levels.
    pub fn coefficient_count(&self) -> usize {
        self.corrections
            .iter()
            .flat_map(|l| l.values())
            .map(|c| c.count())
            .sum()
    }

    /// Bricks of totals over all levels.
    pub fn brick_count(&self) -> usize {
        self.levels.iter().map(Vec::len).sum()
    }

    /// Bytes of the totals that evaluation reads.
    pub fn totals_bytes(&self) -> usize {
        self.brick_count() * HALO_LEN * size_of::<T>()
    }

    /// SHA-256 of what the field is: precision, box, map, slope, and the corrections of every level. Neither
    /// time, compression nor provenance enter (`docs/format.md`).
    pub fn sha256(&self) -> [u8; 32] {
        let mut hash = Sha256::new();
        hash.update(b"isoclay-field-1");
        hash.update(T::NAME);
        for n in self.lattice.cells {
            hash.update(n.to_le_bytes());
        }
        for x in self.lattice.world_from_lattice.to_cols_array() {
            hash.update(x.to_le_bytes());
        }
        hash.update(self.place.slope.to_le_bytes());
        hash.update((self.corrections.len() as u32).to_le_bytes());
        let mut bytes = Vec::new();
        for level in &self.corrections {
            hash.update((level.len() as u32).to_le_bytes());
            for (key, c) in level.as_ref() {
                bytes.clear();
                key.0.iter().for_each(|k| bytes.extend(k.to_le_bytes()));
                c.mask.iter().for_each(|m| bytes.extend(m.to_le_bytes()));
                for slot in (0..c.values.len()).filter(|&s| c.is_active(s)) {
                    // Adding +0 turns -0 into +0: both are the same field.
                    (c.values[slot] + T::zero()).extend_le_bytes(&mut bytes);
                }
                hash.update(&bytes);
            }
        }
        hash.finalize().into()
    }

    /// Bound on what rounding can do to one evaluation of the value inside the box.
    ///
    /// 4 + 4 + 4 products and sums, and the rounding of the weights, against the largest coefficient.
    pub fn rounding_bound(&self) -> f64 {
        let largest = self.levels[0]
            .iter()
            .map(|b| b.hull[0].as_f64().abs().max(b.hull[1].as_f64().abs()))
            .fold(0.0, f64::max);
        64.0 * T::UNIT_ROUND_OFF * largest
    }

    /// Index of brick `key` of `level`, if there is one.
    pub(super) fn find(&self, level: usize, key: BrickKey) -> Option<u32> {
        find(&self.lattice, &self.levels, level, key)
    }

    /// Where lattice point `q`, inside the box, is evaluated: in the finest brick that covers it.
    #[inline]
    pub(super) fn place(&self, q: DVec3) -> Place<'_, T> {
        self.place_after(None, q)
    }

    /// [`Self::place`], without the way down from the coarsest level if `q` lies in the same brick as `last`.
    #[inline]
    pub(super) fn place_after<'a>(&'a self, last: Option<&Place<'a, T>>, q: DVec3) -> Place<'a, T> {
        let finest = self.levels.len() - 1;
        let limit = self.lattice.cells_at(finest);
        let scaled = q * (1u64 << finest) as f64;
        let cell: [u32; 3] = std::array::from_fn(|a| (scaled[a] as u32).min(limit[a] - 1));
        let (level, index) = match last {
            Some(last) if self.is_finest_over(last, cell) => (last.level, last.index),
            _ => self.brick_of(cell),
        };
        let shift = finest - level;
        let scale = (1u64 << level) as f64;
        Place {
            brick: &self.levels[level][index as usize],
            level,
            index,
            cell: cell.map(|c| (c >> shift) as usize % BRICK),
            t: std::array::from_fn(|a| T::from_f64(q[a] * scale - (cell[a] >> shift) as f64)),
        }
    }

    /// Whether the brick of `place` is the one that evaluates a cell of the finest level.
    #[inline]
    fn is_finest_over(&self, place: &Place<'_, T>, cell: [u32; 3]) -> bool {
        let shift = self.levels.len() - 1 - place.level;
        let key = cell.map(|c| c >> shift >> BRICK.ilog2());
        if key != place.brick.key.0 {
            return false;
        }
        shift == 0 || place.brick.children[octant(cell, shift - 1)] == NONE
    }

    /// The finest brick over a cell of the finest level: its level and its index there.
    #[inline]
    fn brick_of(&self, cell: [u32; 3]) -> (usize, u32) {
        let finest = self.levels.len() - 1;
        let counts = self.lattice.cells.map(|n| n.div_ceil(BRICK as u32));
        let b: [u32; 3] = cell.map(|c| c >> (finest + 3));
        let mut index = (b[0] * counts[1] + b[1]) * counts[2] + b[2];
        for level in 1..=finest {
            let child = self.levels[level - 1][index as usize].children[octant(cell, finest - level)];
            if child == NONE {
                return (level - 1, index);
            }
            index = child;
        }
        (finest, index)
    }

    /// Gradient by cell coordinates of `level` to gradient by world coordinates.
    #[inline]
    pub(super) fn world_gradient(&self, level: usize, g: [T; 3]) -> DVec3 {
        let scale = (1u64 << level) as f64;
        let g = DVec3::new(g[0].as_f64(), g[1].as_f64(), g[2].as_f64()) * scale;
        self.place.local_from_world.matrix3.transpose() * g
    }
}

/// Index of brick `key` of `level` by the way down from level 0; only the levels above have to be linked.
pub(super) fn find<T>(
    lattice: &Lattice,
    levels: &[Vec<Brick<T>>],
    level: usize,
    key: BrickKey,
) -> Option<u32> {
    let counts = lattice.cells.map(|n| n.div_ceil(BRICK as u32));
    let root = key.0.map(|k| k.checked_shr(level as u32).unwrap_or(0));
    if (0..3).any(|a| root[a] >= counts[a]) {
        return None;
    }
    let mut index = (root[0] * counts[1] + root[1]) * counts[2] + root[2];
    for above in 0..level {
        let half = key.0.map(|k| (k >> (level - 1 - above) & 1) as usize);
        index = levels.get(above)?[index as usize].children[4 * half[0] + 2 * half[1] + half[2]];
        if index == NONE {
            return None;
        }
    }
    Some(index)
}

/// Which child holds a cell of the finest level, `shift` levels above it.
#[inline]
fn octant(cell: [u32; 3], shift: usize) -> usize {
    let o = cell.map(|c| (c >> shift >> BRICK.ilog2() & 1) as usize);
    4 * o[0] + 2 * o[1] + o[2]
}
