//! Where two versions of a field differ, told from the bricks they share.

use std::sync::Arc;

use glam::DVec3;

use super::brick::{BRICK, BrickKey, NONE};
use super::spline::HierarchicalSpline;
use crate::{Aabb, Real};

impl<T: Real> HierarchicalSpline<T> {
    /// World boxes outside which, within `within`, this field has the very bits of `other`.
    ///
    /// Two bricks count as equal if they are one, so the versions have to come from each other by [`Self::edited`], in
    /// any order and number; of fields built apart everything differs. Time in proportion to the number of bricks.
    pub fn changed_boxes(&self, other: &Self, within: &Aabb) -> Vec<Aabb> {
        if self.lattice() != other.lattice() || self.slope() != other.slope() {
            return vec![*within];
        }
        let mut changes = Changes {
            spline: self,
            other,
            reach: within.transformed(self.lattice_from_world()),
            boxes: Vec::new(),
        };
        for root in 0..self.levels[0].len() as u32 {
            changes.compare(0, root, root);
        }
        changes.boxes
    }

    /// Whether `level` has a brick at `key`: its cells are then evaluated at this level or a finer one, and editing
    /// functions of the level changes no rounding beside their supports.
    pub fn has_brick(&self, level: usize, key: BrickKey) -> bool {
        self.find(level, key).is_some()
    }

    /// Bricks of totals that are not the very bricks of `other`.
    pub fn unshared_brick_count(&self, other: &Self) -> usize {
        let shared: rustc_hash::FxHashSet<_> = other
            .levels
            .iter()
            .flatten()
            .map(|b| Arc::as_ptr(&b.totals))
            .collect();
        let all = self.levels.iter().flatten();
        all.filter(|b| !shared.contains(&Arc::as_ptr(&b.totals))).count()
    }
}

struct Changes<'a, T> {
    spline: &'a HierarchicalSpline<T>,
    other: &'a HierarchicalSpline<T>,
    /// How far a change at the lattice's faces reaches outside, in lattice coordinates.
    reach: Aabb,
    boxes: Vec<Aabb>,
}

impl<T: Real> Changes<'_, T> {
    /// Compares two bricks at the same place.
    fn compare(&mut self, level: usize, index: u32, other: u32) {
        let a = &self.spline.levels[level][index as usize];
        let b = &self.other.levels[level][other as usize];
        let same = Arc::ptr_eq(&a.totals, &b.totals);
        let width = BRICK as f64 / (1u64 << level) as f64;
        let corner = DVec3::from_array(a.key.0.map(|k| k as f64 * width));
        if !same && !a.has_children() && !b.has_children() {
            return self.push(corner, corner + width);
        }
        for octant in 0..8usize {
            match (a.children[octant], b.children[octant]) {
                (NONE, NONE) if same => {}
                (x, y) if x != NONE && y != NONE => self.compare(level + 1, x, y),
                _ => {
                    let half = |axis: usize| (octant >> (2 - axis) & 1) as f64 * width / 2.0;
                    let low = corner + DVec3::from_array(std::array::from_fn(half));
                    self.push(low, low + width / 2.0);
                }
            }
        }
    }

    /// Notes a box of lattice coordinates, and what lies outside behind its faces.
    fn push(&mut self, low: DVec3, high: DVec3) {
        let extent = self.spline.lattice().extent();
        if low.cmpge(extent).any() {
            return;
        }
        let high = high.min(extent);
        let low = DVec3::select(low.cmple(DVec3::ZERO), low.min(self.reach.min), low);
        let high = DVec3::select(high.cmpge(extent), high.max(self.reach.max), high);
        let lattice_box = Aabb { min: low, max: high };
        let map = &self.spline.lattice().world_from_lattice;
        self.boxes.push(lattice_box.transformed(map));
    }
}
