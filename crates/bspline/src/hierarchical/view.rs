//! Bricks as other programs' parts see them: what is drawn, uploaded, or stored beside a brick.

use std::sync::Arc;

use glam::DVec3;

use super::brick::{BrickKey, Corrections, HALO_LEN};
use super::node::Node;
use super::spline::HierarchicalSpline;
use crate::{Aabb, Real};

/// A brick of a field, to read.
#[derive(Clone, Copy, Debug)]
pub struct Brick<'a, T>(&'a Node<T>);

impl<'a, T: Real> Brick<'a, T> {
    /// Level, 0 the coarsest.
    pub fn level(&self) -> usize {
        self.0.level as usize
    }

    /// Place among the bricks of the level.
    pub fn key(&self) -> BrickKey {
        self.0.key
    }

    /// What evaluation reads: the totals of functions `8b-1 ..= 8b+9` on each axis, z fastest. Two versions of a field
    /// have the same brick where this is the same pointer.
    pub fn totals(&self) -> &'a Arc<[T; HALO_LEN]> {
        self.0.totals.as_ref().expect("only nodes with totals are bricks")
    }

    /// Least and largest coefficient that the evaluation of any point of the brick reads, on this level or a finer one.
    pub fn hull(&self) -> [T; 2] {
        self.0.hull
    }

    /// The brick's own active functions.
    pub fn corrections(&self) -> Option<&'a Arc<Corrections<T>>> {
        self.0.corrections.as_ref()
    }

    /// Active functions of the brick and of all below it.
    pub fn coefficient_count(&self) -> u64 {
        self.0.count
    }

    /// The brick of the next level over octant `4x + 2y + z`; the cells of an octant without one are this brick's.
    pub fn child(&self, octant: usize) -> Option<Brick<'a, T>> {
        self.0.child(octant).map(Brick)
    }
}

impl<T: Real> HierarchicalSpline<T> {
    /// The brick of `level` at `key`, if its cells are evaluated at this level or a finer one.
    pub fn brick(&self, level: usize, key: BrickKey) -> Option<Brick<'_, T>> {
        self.find(level, key)
            .filter(|node| node.totals.is_some())
            .map(Brick)
    }

    /// All bricks, coarser ones before those below them.
    pub fn bricks(&self) -> Vec<Brick<'_, T>> {
        let mut found = Vec::with_capacity(self.brick_count());
        self.root.walk(&mut |node| {
            found.extend(node.totals.is_some().then_some(Brick(node)));
            node.holds_cells()
        });
        found
    }

    /// Finest level with a brick that reaches a world box, 0 if none does. Takes time in proportion to the bricks there.
    pub fn finest_in(&self, b: &Aabb) -> usize {
        let local = b.transformed(self.lattice_from_world());
        let mut finest = 0;
        self.root.walk(&mut |node| {
            let first = DVec3::from_array(node.key.0.map(f64::from)) * node.width();
            let is_reached = first.cmple(local.max).all() && (first + node.width()).cmpge(local.min).all();
            if is_reached && node.totals.is_some() {
                finest = finest.max(node.level as usize);
            }
            is_reached && node.holds_cells()
        });
        finest
    }

    /// Bricks that `before` does not have, or has with other totals; at the cost of what the versions do not share.
    pub fn changed_bricks(&self, before: &Self) -> Vec<Brick<'_, T>> {
        let mut found = Vec::new();
        unshared(&self.root, Some(&before.root), &mut found);
        found
    }
}

fn unshared<'a, T: Real>(node: &'a Node<T>, before: Option<&Node<T>>, found: &mut Vec<Brick<'a, T>>) {
    if before.is_some_and(|before| std::ptr::eq(node, before)) {
        return;
    }
    let totals = before.and_then(|b| b.totals.as_ref());
    let is_shared = node
        .totals
        .as_ref()
        .zip(totals)
        .is_some_and(|(a, b)| Arc::ptr_eq(a, b));
    if node.totals.is_some() && !is_shared {
        found.push(Brick(node));
    }
    for (octant, child) in node.children.iter().enumerate() {
        let before = before.and_then(|b| b.children[octant].as_deref());
        if let Some(child) = child {
            unshared(child, before, found);
        }
    }
}
