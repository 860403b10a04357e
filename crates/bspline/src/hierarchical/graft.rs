use std::sync::Arc;

use super::brick::{BRICK, BrickKey, Corrections, read_slots};
use super::node::crown;
use super::{Lattice, node};
use crate::Real;

/// Where a place lies in the tree; in the order of a walk through it, parents first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Way {
    /// Octants from the root down, three bits each, the first in the highest.
    octants: u128,
    /// Steps from the root down.
    depth: u8,
}

/// Bits of a way: 40 octants.
const BITS: u32 = 120;

impl Way {
    /// From the root to a brick.
    pub fn to(lattice: &Lattice, (level, key): (usize, BrickKey)) -> Self {
        let depth = crown(lattice) as usize + level;
        let octants = (0..depth).fold(0u128, |octants, i| {
            octants << 3 | node::octant(key.0, depth - 1 - i) as u128
        });
        Self {
            octants: octants << (BITS - 3 * depth as u32),
            depth: depth as u8,
        }
    }
}

/// Other functions for one brick.
pub(super) struct Graft<T> {
    way: Way,
    /// Steps from the root down from which on what changes reaches into the place behind, by axis; more than the
    /// brick's own where it does not.
    behind: [u8; 3],
    /// Its functions from now on.
    pub corrections: Option<Arc<Corrections<T>>>,
    /// Slots that change, one bit each as in [`Corrections::mask`].
    pub changed: [u64; BRICK],
}

impl<T: Real> Graft<T> {
    /// The functions of a brick from now on, and which slots that changes.
    pub fn new(
        lattice: &Lattice,
        (level, key): (usize, BrickKey),
        changed: [u64; BRICK],
        new: Option<Arc<Corrections<T>>>,
    ) -> Self {
        let way = Way::to(lattice, (level, key));
        let behind = std::array::from_fn(|a| {
            let low = read_slots(std::array::from_fn(|b| usize::from(a == b)));
            match changed.iter().zip(low).any(|(word, low)| word & low != 0) {
                // A place starts where the brick does if it is no more halvings above than the key has zeros.
                true => way.depth - key.0[a].trailing_zeros().min(way.depth.into()) as u8,
                false => way.depth + 1,
            }
        });
        Self {
            way,
            behind,
            corrections: new.filter(|c| c.count() > 0),
            changed,
        }
    }

    /// Steps from the root down.
    pub fn depth(&self) -> u8 {
        self.way.depth
    }

    /// Which way the path turns to reach a depth below the root.
    pub fn octant(&self, depth: u8) -> usize {
        (self.way.octants >> (BITS - 3 * u32::from(depth)) & 7) as usize
    }

    /// Whether changes at a depth's place or below reach into the one behind it, by axis; at times yes where no.
    pub fn reach_behind(grafts: &[Self], depth: u8) -> [bool; 3] {
        /// Changes up to which looking is cheaper than going there.
        const FEW: usize = 32;
        std::array::from_fn(|a| grafts.len() > FEW || grafts.iter().any(|graft| depth >= graft.behind[a]))
    }

    /// In the order of a walk through the tree.
    pub fn sort(grafts: &mut [Self]) {
        grafts.sort_by_key(|g| g.way);
    }
}
