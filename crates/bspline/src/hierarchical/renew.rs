//! Totals and summaries of a grafted tree.

use std::sync::{Arc, Mutex};

use rayon::prelude::*;

use super::Lattice;
use super::brick::HALO_LEN;
use super::node::{Children, Node, covers_cells};
use super::window::Window;
use crate::Real;

/// Bricks below a node from which on its children are made side by side: about a millisecond's work, as waking another
/// thread may take a tenth of that.
const SIDE_BY_SIDE: u64 = 200;

/// Makes the totals that are missing in `grafted`, and those that follow from others; nodes that come out as they are in
/// `old` are `old`'s. Bricks that no function reaches are left out.
pub(super) fn renewed<T: Real>(
    lattice: &Lattice,
    old: Option<&Arc<Node<T>>>,
    grafted: &Arc<Node<T>>,
) -> Arc<Node<T>> {
    // A whole field's totals are asked for here, not by the threads: so they take the place of what the caller has freed.
    let mut blank = Vec::new();
    if old.is_none() {
        grafted.walk(&mut |node| {
            blank.extend(covers_cells(lattice, node.place()).then(|| Arc::new([T::zero(); HALO_LEN])));
            true
        });
    }
    let root = Renewal {
        lattice,
        blank: &Mutex::new(blank),
        old,
        grafted,
        window: Window::root(grafted),
        parent: None,
    };
    root.run(false).expect("level 0 has cells")
}

/// One node in the old tree and in the grafted one.
struct Renewal<'a, T> {
    lattice: &'a Lattice,
    /// Totals that are all 0, to be filled; when there are none left they are allocated.
    blank: &'a Mutex<Vec<Arc<[T; HALO_LEN]>>>,
    old: Option<&'a Arc<Node<T>>>,
    grafted: &'a Arc<Node<T>>,
    window: Window<'a, T>,
    parent: Option<&'a [T; HALO_LEN]>,
}

impl<T: Real> Renewal<'_, T> {
    /// The new node, none if nothing needs it. `is_forced`: the parent's totals have changed.
    fn run(&self, is_forced: bool) -> Option<Arc<Node<T>>> {
        let (old, grafted) = (self.old, self.grafted);
        if !is_forced && old.is_some_and(|old| Arc::ptr_eq(old, grafted)) {
            return Some(grafted.clone());
        }
        let (totals, has_changed) = self.totals(is_forced);
        let children = self.children(totals.as_deref(), has_changed);
        let is_brick = totals.is_some();
        let is_needed = !is_brick
            || grafted.level == 0
            || children.iter().flatten().any(|c| c.holds_cells())
            || self.window.has_functions();
        let totals = totals.filter(|_| is_needed);
        if totals.is_none() && grafted.corrections.is_none() && children.iter().all(Option::is_none) {
            return None;
        }
        if let Some(old) = old
            && is_same(&old.totals, &totals)
            && is_same(&old.corrections, &grafted.corrections)
            && old.children.iter().zip(&children).all(|(a, b)| is_same(a, b))
        {
            return Some(old.clone());
        }
        Some(Arc::new(Node::new(
            grafted.place(),
            totals,
            grafted.corrections.clone(),
            children,
        )))
    }

    /// Totals of the brick, if it has cells, and whether they are others than in the old tree.
    fn totals(&self, is_forced: bool) -> (Option<Arc<[T; HALO_LEN]>>, bool) {
        let grafted = self.grafted;
        if !covers_cells(self.lattice, grafted.place()) {
            return (None, false);
        }
        if let (Some(kept), false) = (&grafted.totals, is_forced) {
            return (Some(kept.clone()), false);
        }
        let kept = self.blank.lock().expect("no thread panics with it").pop();
        let mut totals = kept.unwrap_or_else(|| Arc::new([T::zero(); HALO_LEN]));
        let blank = Arc::get_mut(&mut totals).expect("just made");
        self.window.fill(self.parent, grafted.key.octant(), blank);
        match self.old.and_then(|old| old.totals.as_ref()) {
            Some(old) if same_bits(old, &totals) => (Some(old.clone()), false),
            _ => (Some(totals), true),
        }
    }

    fn children(&self, totals: Option<&[T; HALO_LEN]>, has_changed: bool) -> Children<T> {
        let child = |octant: usize| {
            let grafted = self.grafted.children[octant].as_ref()?;
            let child = Renewal {
                lattice: self.lattice,
                blank: self.blank,
                old: self.old.and_then(|old| old.children[octant].as_ref()),
                grafted,
                window: self.window.child(octant),
                parent: totals,
            };
            child.run(has_changed)
        };
        let work = match (self.old, has_changed) {
            (Some(old), true) => self.grafted.brick_count.max(old.brick_count),
            _ => self.grafted.brick_count,
        };
        if work < SIDE_BY_SIDE {
            return std::array::from_fn(child);
        }
        let made: Vec<_> = (0..8).into_par_iter().with_max_len(1).map(child).collect();
        made.try_into().expect("eight children")
    }
}

fn is_same<N: ?Sized>(a: &Option<Arc<N>>, b: &Option<Arc<N>>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => Arc::ptr_eq(a, b),
        (None, None) => true,
        _ => false,
    }
}

/// Equal, and zeros of the same sign.
fn same_bits<T: Real>(a: &[T; HALO_LEN], b: &[T; HALO_LEN]) -> bool {
    let same = |(x, y): (&T, &T)| x == y && x.is_sign_negative() == y.is_sign_negative();
    a.iter().zip(b).all(same)
}
