//! Where two versions of a field differ, told from the bricks they share.

use std::sync::Arc;

use glam::DVec3;

use super::brick::BrickKey;
use super::node::Node;
use super::spline::HierarchicalSpline;
use crate::{Aabb, Real};

impl<T: Real> HierarchicalSpline<T> {
    /// World boxes outside which, within `within`, this field has the very bits of `other`.
    ///
    /// Two bricks count as equal if they are one, so the versions have to come from each other by [`Self::edited`], in
    /// any order and number; of fields built apart everything differs. Time in proportion to the bricks that differ.
    pub fn changed_boxes(&self, other: &Self, within: &Aabb) -> Vec<Aabb> {
        if self.lattice() != other.lattice() || self.slope() != other.slope() {
            return vec![*within];
        }
        let mut changes = Changes {
            spline: self,
            reach: within.transformed(self.lattice_from_world()),
            boxes: Vec::new(),
        };
        changes.compare(&self.root, &other.root);
        changes.boxes
    }

    /// Whether `level` has a brick at `key`: its cells are then evaluated at this level or a finer one, and editing
    /// functions of the level changes no rounding beside their supports.
    pub fn has_brick(&self, level: usize, key: BrickKey) -> bool {
        self.find(level, key).is_some_and(|node| node.totals.is_some())
    }

    /// Bricks of totals that are not the very bricks of `other`.
    pub fn unshared_brick_count(&self, other: &Self) -> usize {
        let own = |node: &Node<T>, other: Option<&Node<T>>| {
            let totals = other.and_then(|o| o.totals.as_ref());
            let is_shared = node
                .totals
                .as_ref()
                .zip(totals)
                .is_some_and(|(a, b)| Arc::ptr_eq(a, b));
            usize::from(node.totals.is_some() && !is_shared)
        };
        unshared(&self.root, Some(&other.root), &own)
    }
}

/// Sum of `count` over the nodes of a tree that are not shared with another, each with its counterpart there.
fn unshared<T: Real>(
    node: &Node<T>,
    other: Option<&Node<T>>,
    count: &impl Fn(&Node<T>, Option<&Node<T>>) -> usize,
) -> usize {
    if other.is_some_and(|other| std::ptr::eq(node, other)) {
        return 0;
    }
    let children = node.children.iter().enumerate().map(|(octant, child)| {
        let other = other.and_then(|o| o.children[octant].as_deref());
        child.as_deref().map_or(0, |child| unshared(child, other, count))
    });
    count(node, other) + children.sum::<usize>()
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
        if !is_same && !a.has_children() && !b.has_children() {
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
