//! New corrections put into a tree by copying the paths to them.

use std::sync::Arc;

use rayon::prelude::*;

use super::brick::{BrickKey, Corrections};
use super::node::{Children, Node, crown};
use super::{Lattice, node};
use crate::Real;

/// What is to become of one brick.
pub(super) struct Graft<T> {
    /// Octants from the root down, three bits each, the first in the highest.
    path: u128,
    depth: u8,
    /// Its functions from now on, if they change.
    corrections: Option<Option<Arc<Corrections<T>>>>,
    /// Whether its totals have to be made anew.
    is_stale: bool,
}

/// Bits of a path: 40 octants.
const PATH: u32 = 120;

/// Grafts from which on a node's children are made side by side: a millisecond's work.
const SIDE_BY_SIDE: usize = 1000;

impl<T: Real> Graft<T> {
    /// The functions of a brick from now on; none removes them.
    pub fn functions(
        lattice: &Lattice,
        level: usize,
        key: BrickKey,
        functions: Option<Arc<Corrections<T>>>,
    ) -> Self {
        Self {
            corrections: Some(functions),
            ..Self::stale(lattice, level, key)
        }
    }

    /// A brick whose functions stay, but not its totals.
    pub fn stale(lattice: &Lattice, level: usize, key: BrickKey) -> Self {
        let depth = crown(lattice) as usize + level;
        let path = (0..depth).fold(0u128, |path, i| {
            path << 3 | node::octant(key.0, depth - 1 - i) as u128
        });
        Self {
            path: path << (PATH - 3 * depth as u32),
            depth: depth as u8,
            corrections: None,
            is_stale: node::covers_cells(lattice, (level as i8, key)),
        }
    }

    fn octant(&self, depth: u8) -> usize {
        (self.path >> (PATH - 3 * u32::from(depth)) & 7) as usize
    }
}

/// The tree `old` with `grafts`, which share all nodes that lie on no path to one. Totals that have to be made anew are
/// missing in it.
pub(super) fn grafted<T: Real>(
    lattice: &Lattice,
    old: Option<&Arc<Node<T>>>,
    mut grafts: Vec<Graft<T>>,
) -> Arc<Node<T>> {
    grafts.sort_by_key(|g| (g.path, g.depth));
    let root = (-crown(lattice), BrickKey([0; 3]));
    Arc::new(at_node(old, root, 0, &grafts))
}

fn at_node<T: Real>(
    old: Option<&Arc<Node<T>>>,
    (level, key): (i8, BrickKey),
    depth: u8,
    grafts: &[Graft<T>],
) -> Node<T> {
    let (mut totals, mut corrections, mut children): (_, _, Children<T>) = match old {
        Some(old) => (old.totals.clone(), old.corrections.clone(), old.children.clone()),
        None => Default::default(),
    };
    let own = grafts.partition_point(|g| g.depth == depth);
    let (own, mut below) = grafts.split_at(own);
    for graft in own {
        if graft.is_stale {
            totals = None;
        }
        if let Some(new) = &graft.corrections {
            corrections = new.clone();
        }
    }
    let mut split = children.iter_mut().enumerate().map(|(octant, child)| {
        let count = below.partition_point(|g| g.octant(depth + 1) == octant);
        let (here, rest) = below.split_at(count);
        below = rest;
        (octant, child, here)
    });
    let graft = |(octant, child, here): (usize, &mut Option<Arc<Node<T>>>, &[Graft<T>])| {
        if !here.is_empty() {
            let place = (level + 1, key.child(octant));
            *child = Some(Arc::new(at_node(child.as_ref(), place, depth + 1, here)));
        }
    };
    if grafts.len() < SIDE_BY_SIDE {
        split.for_each(graft);
    } else {
        let split: [_; 8] = std::array::from_fn(|_| split.next().expect("eight children"));
        split.into_par_iter().with_max_len(1).for_each(graft);
    }
    Node::skeleton((level, key), totals, corrections, children, grafts.len())
}
