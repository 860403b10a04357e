use std::sync::Arc;

use super::brick::{BRICK, BrickKey, Corrections, read_slots};
use super::node::crown;
use super::{Lattice, node};
use crate::Real;

/// Other functions for one brick.
pub(super) struct Graft<T> {
    key: BrickKey,
    /// Octants from the root down, three bits each, the first in the highest.
    path: u128,
    /// Steps from the root down.
    pub depth: u8,
    /// Its functions from now on.
    pub corrections: Option<Arc<Corrections<T>>>,
    /// Slots that change, one bit each as in [`Corrections::mask`].
    pub changed: [u64; BRICK],
}

/// Bits of a path: 40 octants.
const PATH: u32 = 120;

impl<T: Real> Graft<T> {
    /// The functions of a brick from now on, and which slots that changes.
    pub fn new(
        lattice: &Lattice,
        (level, key): (usize, BrickKey),
        changed: [u64; BRICK],
        new: Option<Arc<Corrections<T>>>,
    ) -> Self {
        let depth = crown(lattice) as usize + level;
        let path = (0..depth).fold(0u128, |path, i| {
            path << 3 | node::octant(key.0, depth - 1 - i) as u128
        });
        Self {
            key,
            path: path << (PATH - 3 * depth as u32),
            depth: depth as u8,
            corrections: new.filter(|c| c.count() > 0),
            changed,
        }
    }

    /// Which way the path turns to reach a depth below the root.
    pub fn octant(&self, depth: u8) -> usize {
        (self.path >> (PATH - 3 * u32::from(depth)) & 7) as usize
    }

    /// Whether changes at a depth's place or below reach into the one behind it, by axis; at times yes where no.
    pub fn reach_behind(grafts: &[Self], depth: u8) -> [bool; 3] {
        /// Changes up to which looking is cheaper than going there.
        const FEW: usize = 8;
        std::array::from_fn(|a| {
            let slots = read_slots(std::array::from_fn(|b| usize::from(a == b)));
            grafts.len() > FEW
                || grafts.iter().any(|graft| {
                    let steps = u32::from(graft.depth - depth);
                    u64::from(graft.key.0[a]).trailing_zeros() >= steps
                        && graft.changed.iter().zip(slots).any(|(word, low)| word & low != 0)
                })
        })
    }

    /// In the order of a walk through the tree, parents first.
    pub fn sort(grafts: &mut [Self]) {
        grafts.sort_by_key(|g| (g.path, g.depth));
    }
}
