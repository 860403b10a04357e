//! Where two versions of a field differ, told from the bricks they share.

use std::sync::Arc;

use glam::DVec3;

use super::node::Node;
use super::spline::HierarchicalSpline;
use crate::{Aabb, Real};

/// [`Field::changed_boxes`](crate::Field::changed_boxes) of two versions.
///
/// Two bricks count as equal if they are one, so the versions have to come from each other by edits, in any order and
/// number; of fields built apart everything differs. Time in proportion to the bricks that differ.
pub(super) fn changed_boxes<T: Real>(
    now: &HierarchicalSpline<T>,
    before: &HierarchicalSpline<T>,
    within: &Aabb,
) -> Vec<Aabb> {
    if now.lattice() != before.lattice() || now.slope() != before.slope() {
        return vec![*within];
    }
    let mut changes = Changes {
        spline: now,
        reach: within.transformed(now.lattice_from_world()),
        boxes: Vec::new(),
    };
    changes.compare(&now.root, &before.root);
    changes.boxes
}

impl<T: Real> HierarchicalSpline<T> {
    /// Whether both are one version of a field: at once, and at times no where yes.
    pub(super) fn is_same_version(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.root, &other.root)
            && self.lattice() == other.lattice()
            && self.slope() == other.slope()
    }
}

struct Changes<'a, T> {
    spline: &'a HierarchicalSpline<T>,
    /// How far a change at the lattice's faces reaches outside, in lattice coordinates.
    reach: Aabb,
    boxes: Vec<Aabb>,
}

impl<T: Real> Changes<'_, T> {
    /// Compares two nodes at the same place.
    fn compare(&mut self, a: &Node<T>, b: &Node<T>) {
        if std::ptr::eq(a, b) {
            return;
        }
        let is_same = match (&a.totals, &b.totals) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            (None, None) => true,
            _ => false,
        };
        let width = a.width();
        let corner = DVec3::from_array(a.key.0.map(|k| k as f64 * width));
        let is_divided = [a.has_children(), b.has_children()];
        // Bounds are taken by octants in a node that has children, so with the first of them they change all over it.
        if is_divided[0] != is_divided[1] || !is_same && is_divided == [false; 2] {
            return self.push(corner, corner + width);
        }
        for octant in 0..8usize {
            match (a.child(octant), b.child(octant)) {
                (None, None) if is_same => {}
                (Some(a), Some(b)) => self.compare(a, b),
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
