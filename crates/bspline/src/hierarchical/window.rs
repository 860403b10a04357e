use std::sync::Arc;

use super::brick::{BRICK, Corrections, HALO, HALO_LEN, active_slots, read_slots};
use super::graft::Graft;
use super::node::Node;
use super::prolong::{prolong, prolonged_at};
use crate::Real;

/// Totals of a brick up to which they are made one by one: what costs as much as all 1331 at once.
const FEW: u32 = 64;

/// A place in the tree and its seven upper neighbours: all whose functions reach into its cells. Number `4x + 2y + z`,
/// each 0 or 1.
pub(super) struct Window<'a, T> {
    places: [Place<'a, T>; 8],
    /// Steps from the root down.
    depth: u8,
}

/// What stands at a place, and what is to change there and below.
struct Place<'a, T> {
    node: Option<&'a Node<T>>,
    grafts: &'a [Graft<T>],
}

impl<T> Clone for Place<'_, T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Place<'_, T> {}

/// Slots of the eight places.
pub(super) type Slots = [[u64; BRICK]; 8];

impl<'a, T: Real> Window<'a, T> {
    /// About the root, which spans all functions. The grafts are in their order.
    pub fn root(root: Option<&'a Node<T>>, grafts: &'a [Graft<T>]) -> Self {
        let nothing = Place {
            node: None,
            grafts: &[],
        };
        let mut places = [nothing; 8];
        places[0] = Place { node: root, grafts };
        Self { places, depth: 0 }
    }

    /// About a child.
    pub fn child(&self, octant: usize) -> Self {
        let depth = self.depth + 1;
        let places = std::array::from_fn(|ahead| {
            // Per axis 0, 1 or 2 halves from the place's start.
            let halves = [2, 1, 0].map(|a| (octant >> a & 1) + (ahead >> a & 1));
            let parent = self.places[number(halves.map(|h| h / 2), 2)];
            parent.child(number(halves.map(|h| h % 2), 2), depth)
        });
        Self { places, depth }
    }

    /// Whether nothing changes in it.
    pub fn is_quiet(&self) -> bool {
        self.places.iter().all(|place| place.grafts.is_empty())
    }

    /// Bricks that change at the place or below.
    pub fn graft_count(&self) -> usize {
        self.places[0].grafts.len()
    }

    /// Whether anything changes below the eight places.
    pub fn has_grafts_below(&self) -> bool {
        self.places
            .iter()
            .any(|place| !place.below(self.depth).is_empty())
    }

    /// The children about whose windows something changes, there or below: a bit each.
    pub fn reached_children(&self) -> u8 {
        // The octants in the first half on an axis, in the second, in both.
        const HALVES: [[u8; 4]; 3] = [
            [0, 0x0f, 0xf0, 0xff],
            [0, 0x33, 0xcc, 0xff],
            [0, 0x55, 0xaa, 0xff],
        ];
        let mut reached = 0;
        for (n, place) in self.places.iter().enumerate() {
            let mut grafts = place.below(self.depth);
            while let Some(first) = grafts.first() {
                let octant = first.octant(self.depth + 1);
                let end = grafts.partition_point(|g| g.octant(self.depth + 1) <= octant);
                let (here, rest) = grafts.split_at(end);
                grafts = rest;
                let behind = Graft::reach_behind(here, self.depth + 1);
                let on_axes = [0, 1, 2].map(|a| {
                    // Halves from the place's start; a child's window spans its own half and the next.
                    let half = 2 * ahead(n)[a] + ahead(octant)[a];
                    let halves = 1 << half | u8::from(behind[a]) << half >> 1;
                    HALVES[a][usize::from(halves & 3)]
                });
                reached |= on_axes[0] & on_axes[1] & on_axes[2];
            }
        }
        reached
    }

    /// Functions at the place from now on.
    pub fn own_corrections(&self) -> Option<&'a Arc<Corrections<T>>> {
        self.places[0].corrections(self.depth)
    }

    /// Whether any function that is active from now on reaches into the place's cells.
    pub fn has_functions(&self) -> bool {
        // All of its own do, and there is none of a node without them.
        self.own_corrections().is_some()
            || (self.corrections().skip(1))
                .any(|(ahead, corrections)| corrections.is_some_and(|c| c.reaches(ahead)))
    }

    /// Functions of the eight from now on, and how many bricks ahead they stand.
    fn corrections(&self) -> impl Iterator<Item = ([usize; 3], Option<&'a Arc<Corrections<T>>>)> {
        let all = self.places.iter().enumerate();
        all.map(|(n, place)| (ahead(n), place.corrections(self.depth)))
    }

    /// Slots whose change reaches into the place's cells.
    pub fn changed(&self) -> Slots {
        std::array::from_fn(|n| match self.places[n].own(self.depth) {
            Some(graft) => {
                let read = read_slots(ahead(n));
                std::array::from_fn(|x| graft.changed[x] & read[x])
            }
            None => [0; BRICK],
        })
    }

    /// Totals of the place: its parent's, prolonged, and the corrections of the window.
    #[inline(never)]
    pub fn fill(&self, parent: Option<&[T; HALO_LEN]>, octant: [usize; 3], blank: &mut [T; HALO_LEN]) {
        if let Some(parent) = parent {
            prolong(parent, octant, blank);
        }
        for (ahead, corrections) in self.corrections() {
            let Some(corrections) = corrections else { continue };
            let count = ahead.map(|a| if a == 1 { HALO - BRICK } else { BRICK });
            corrections.add_to(count, blank, BRICK * number(ahead, HALO));
        }
    }

    /// [`Self::fill`] where only the `changed` slots are others than when the totals were `old`. None if they are so
    /// many that filling is cheaper.
    #[inline(never)]
    pub fn patched(
        &self,
        changed: &Slots,
        old: &Arc<[T; HALO_LEN]>,
        parent: Option<&[T; HALO_LEN]>,
        octant: [usize; 3],
    ) -> Option<Arc<[T; HALO_LEN]>> {
        let count: u32 = changed.as_flattened().iter().map(|w| w.count_ones()).sum();
        if count > FEW {
            return None;
        }
        // What others share is copied, not first counted: that would wait for memory far from the cache.
        let mut copy: Option<Arc<[T]>> = None;
        for (n, slots) in changed.iter().enumerate() {
            // Nodes beside the place are not read where nothing changes in them.
            if *slots == [0; BRICK] {
                continue;
            }
            let (ahead, corrections) = (ahead(n), self.places[n].corrections(self.depth));
            for slot in active_slots(slots) {
                let within = [slot / 64, slot / 8 % 8, slot % 8];
                let at = std::array::from_fn(|a| BRICK * ahead[a] + within[a]);
                let mut total = parent.map_or(T::zero(), |parent| prolonged_at(parent, octant, at));
                if let Some(correction) = corrections.and_then(|c| c.get(slot)) {
                    total += correction;
                }
                let at = number(at, HALO);
                if !has_same_bits(old[at], total) {
                    let copy = copy.get_or_insert_with(|| Arc::from(old.as_slice()));
                    Arc::get_mut(copy).expect("just made")[at] = total;
                }
            }
        }
        let whole = |copy: Arc<[T]>| copy.try_into().expect("as long as it was");
        Some(copy.map_or_else(|| old.clone(), whole))
    }
}

impl<'a, T: Real> Place<'a, T> {
    /// What changes at the place itself.
    #[inline]
    fn own(&self, depth: u8) -> Option<&'a Graft<T>> {
        self.grafts.first().filter(|g| g.depth() == depth)
    }

    /// What changes below it.
    fn below(&self, depth: u8) -> &'a [Graft<T>] {
        &self.grafts[usize::from(self.own(depth).is_some())..]
    }

    fn corrections(&self, depth: u8) -> Option<&'a Arc<Corrections<T>>> {
        match self.own(depth) {
            Some(graft) => graft.corrections.as_ref(),
            None => self.node.and_then(|node| node.corrections.as_ref()),
        }
    }

    /// A place one step down, at a depth.
    fn child(&self, octant: usize, depth: u8) -> Self {
        let mut grafts = self.grafts;
        if !grafts.is_empty() {
            grafts = self.below(depth - 1);
            let start = grafts.partition_point(|g| g.octant(depth) < octant);
            let end = grafts.partition_point(|g| g.octant(depth) <= octant);
            grafts = &grafts[start..end];
        }
        let node = self.node.and_then(|node| node.children[octant].as_deref());
        Self { node, grafts }
    }
}

/// Bricks ahead on each axis of number `n` in a window.
fn ahead(n: usize) -> [usize; 3] {
    [n >> 2, n >> 1 & 1, n & 1]
}

/// Place of `at` in a cube of edge `n`, z fastest.
fn number(at: [usize; 3], n: usize) -> usize {
    (at[0] * n + at[1]) * n + at[2]
}

/// Whether all totals are equal, and zeros of the same sign.
pub(super) fn have_same_bits<T: Real>(a: &[T; HALO_LEN], b: &[T; HALO_LEN]) -> bool {
    // Planes at a time: a loop that may end anywhere is not vectorized.
    let planes = a.chunks(HALO * HALO).zip(b.chunks(HALO * HALO));
    planes.into_iter().all(|(a, b)| {
        let pairs = a.iter().zip(b);
        pairs.fold(true, |all, (a, b)| all & has_same_bits(*a, *b))
    })
}

/// Equal, and zeros of the same sign.
fn has_same_bits<T: Real>(a: T, b: T) -> bool {
    (a == b) & (a.is_sign_negative() == b.is_sign_negative())
}
