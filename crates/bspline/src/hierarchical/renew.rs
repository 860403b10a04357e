//! A tree with other functions in some bricks, made by copying the paths to what changes.

use std::hint::black_box;
use std::sync::{Arc, Mutex};

use rayon::prelude::*;

use super::Lattice;
use super::brick::{BrickKey, HALO_LEN};
use super::graft::Graft;
use super::node::{Children, Node, covers_cells, crown, meets_cells};
use super::window::{Slots, Window, have_same_bits};
use crate::Real;

/// Bricks below a node from which on its children are made side by side: about a millisecond's work, as waking another
/// thread may take a tenth of that.
const SIDE_BY_SIDE: usize = 200;

/// Bricks that read the functions of one, about: its own and those behind it.
const READERS: usize = 3;

/// The tree `old`, or one without functions, with `grafts` put in. Nodes that come out as they were are `old`'s. Bricks
/// that no function reaches are left out, but for those of level 0. `count` totals are asked for here, not by the threads:
/// so they take the place of what the caller has freed.
pub(super) fn renewed<T: Real>(
    lattice: &Lattice,
    old: Option<&Arc<Node<T>>>,
    mut grafts: Vec<Graft<T>>,
    count: usize,
) -> Arc<Node<T>> {
    Graft::sort(&mut grafts);
    let blank = Mutex::new((0..count).map(|_| Arc::new([T::zero(); HALO_LEN])).collect());
    let root = Renewal {
        lattice,
        blank: &blank,
        old,
        place: (-crown(lattice), BrickKey([0; 3])),
        window: Window::root(old.map(|old| &**old), &grafts),
        parent: None,
    };
    root.run(false).expect("level 0 has cells")
}

/// One place of the tree.
struct Renewal<'a, T> {
    lattice: &'a Lattice,
    /// Totals that are all 0, to be filled; when there are none left they are allocated.
    blank: &'a Mutex<Vec<Arc<[T; HALO_LEN]>>>,
    old: Option<&'a Arc<Node<T>>>,
    /// Level and key.
    place: (i8, BrickKey),
    window: Window<'a, T>,
    parent: Option<&'a [T; HALO_LEN]>,
}

impl<T: Real> Renewal<'_, T> {
    /// The new node, none if nothing needs it. `is_forced`: the parent's totals have changed.
    fn run(&self, is_forced: bool) -> Option<Arc<Node<T>>> {
        let is_kept = if self.old.is_some() {
            !is_forced
        } else {
            !self.is_always_there()
        };
        if is_kept && self.window.is_quiet() {
            return self.old.cloned();
        }
        let changed = self.window.changed();
        let is_read = changed.as_flattened().iter().any(|&word| word != 0);
        if is_kept && !is_read && !self.window.has_grafts_below() {
            return self.old.cloned();
        }
        let (totals, has_changed) = self.totals(&changed, is_forced);
        let children = self.children(totals.as_deref(), has_changed);
        let is_needed = self.is_always_there()
            || children.iter().flatten().any(|c| c.holds_cells())
            || self.window.has_functions();
        let totals = totals.filter(|_| is_needed);
        let corrections = self.window.own_corrections();
        let is_empty = totals.is_none() && corrections.is_none() && children.iter().all(Option::is_none);
        if is_empty {
            return None;
        }
        if let Some(old) = self.old
            && is_shared(old.totals.as_ref(), totals.as_ref())
            && is_shared(old.corrections.as_ref(), corrections)
            && old
                .children
                .iter()
                .zip(&children)
                .all(|(a, b)| is_shared(a.as_ref(), b.as_ref()))
        {
            return Some(old.clone());
        }
        Some(Arc::new(Node::new(
            self.old.map(|old| &**old),
            self.place,
            totals,
            corrections.cloned(),
            children,
        )))
    }

    /// Whether the place has a node even if no function reaches it: level 0, and what leads there.
    fn is_always_there(&self) -> bool {
        self.place.0 <= 0 && meets_cells(self.lattice, self.place)
    }

    /// Whether the place may come to have totals.
    fn may_have_totals(&self) -> bool {
        covers_cells(self.lattice, self.place)
            && (self.old.is_some_and(|old| old.holds_cells())
                || self.is_always_there()
                || self.window.has_grafts_below()
                || self.window.has_functions())
    }

    /// Totals of the brick, if it has cells, and whether they are others than in the old tree.
    fn totals(&self, changed: &Slots, is_forced: bool) -> (Option<Arc<[T; HALO_LEN]>>, bool) {
        if !self.may_have_totals() {
            return (None, false);
        }
        let octant = self.place.1.octant();
        let old = self.old.and_then(|old| old.totals.as_ref());
        if let (Some(old), false) = (old, is_forced)
            && let Some(totals) = self.window.patched(changed, old, self.parent, octant)
        {
            let has_changed = !Arc::ptr_eq(&totals, old);
            return (Some(totals), has_changed);
        }
        let kept = self.blank.lock().expect("no thread panics with it").pop();
        let mut totals = kept.unwrap_or_else(|| Arc::new([T::zero(); HALO_LEN]));
        let blank = Arc::get_mut(&mut totals).expect("just made");
        self.window.fill(self.parent, octant, blank);
        match old {
            Some(old) if have_same_bits(old, &totals) => (Some(old.clone()), false),
            _ => (Some(totals), true),
        }
    }

    fn child<'b>(&'b self, octant: usize, totals: Option<&'b [T; HALO_LEN]>) -> Renewal<'b, T> {
        let (level, key) = self.place;
        Renewal {
            lattice: self.lattice,
            blank: self.blank,
            old: self.old.and_then(|old| old.children[octant].as_ref()),
            place: (level + 1, key.child(octant)),
            window: self.window.child(octant),
            parent: totals,
        }
    }

    /// Reads a word of each child and of its totals. In a large field they are far from the cache, and the walk would wait
    /// for them one after the other; here they are asked for together.
    fn ask_for_children(&self) {
        let children = || self.old.iter().flat_map(|old| old.children.iter().flatten());
        black_box(children().map(|child| child.count).sum::<u64>());
        let totals = children().filter_map(|child| child.totals.as_ref());
        black_box(totals.map(|totals| totals[0]).fold(T::zero(), |all, t| all + t));
    }

    fn children(&self, totals: Option<&[T; HALO_LEN]>, has_changed: bool) -> Children<T> {
        let reached = self.window.reached_children();
        self.ask_for_children();
        let is_built = self.old.is_none() && self.place.0 < 0;
        let child = |octant: usize| {
            let old = self.old.and_then(|old| old.children[octant].as_ref());
            if reached >> octant & 1 == 1 || is_built || old.is_some() && has_changed {
                self.child(octant, totals).run(has_changed)
            } else {
                old.cloned()
            }
        };
        let forced = self
            .old
            .filter(|_| has_changed)
            .map_or(0, |old| old.brick_count as usize);
        if forced.max(READERS * self.window.graft_count()) < SIDE_BY_SIDE {
            return std::array::from_fn(child);
        }
        let made: Vec<_> = (0..8).into_par_iter().with_max_len(1).map(child).collect();
        made.try_into().expect("eight children")
    }
}

/// Both none or one and the same.
fn is_shared<N: ?Sized>(a: Option<&Arc<N>>, b: Option<&Arc<N>>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => Arc::ptr_eq(a, b),
        (None, None) => true,
        _ => false,
    }
}
