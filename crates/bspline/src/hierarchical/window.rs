use super::brick::{BRICK, HALO, HALO_LEN};
use super::node::Node;
use super::prolong::prolong;
use crate::Real;

/// A node and its seven upper neighbours: all whose functions reach into the node's cells. Number `4x + 2y + z`, each
/// 0 or 1.
#[derive(Clone, Copy)]
pub(super) struct Window<'a, T>([Option<&'a Node<T>>; 8]);

impl<'a, T: Real> Window<'a, T> {
    /// About the root, which spans all functions.
    pub fn root(root: &'a Node<T>) -> Self {
        let mut window = [None; 8];
        window[0] = Some(root);
        Self(window)
    }

    /// About a child of the node.
    pub fn child(&self, octant: usize) -> Self {
        Self(std::array::from_fn(|ahead| {
            // Per axis 0, 1 or 2 halves from the node's start.
            let halves = [2, 1, 0].map(|a| (octant >> a & 1) + (ahead >> a & 1));
            let number = |at: [usize; 3]| 4 * at[0] + 2 * at[1] + at[2];
            let parent = self.0[number(halves.map(|h| h / 2))]?;
            parent.children[number(halves.map(|h| h % 2))].as_deref()
        }))
    }

    /// Whether any active function reaches into the node's cells.
    pub fn has_functions(&self) -> bool {
        (0..8).any(|ahead| {
            let corrections = self.0[ahead].and_then(|n| n.corrections.as_deref());
            corrections.is_some_and(|c| c.reaches([ahead >> 2, ahead >> 1 & 1, ahead & 1]))
        })
    }

    /// Totals of the node: its parent's, prolonged, and the corrections of the window.
    #[inline(never)]
    pub fn fill(&self, parent: Option<&[T; HALO_LEN]>, octant: [usize; 3], blank: &mut [T; HALO_LEN]) {
        if let Some(parent) = parent {
            prolong(parent, octant, blank);
        }
        for ahead in 0..8usize {
            let Some(c) = self.0[ahead].and_then(|n| n.corrections.as_deref()) else {
                continue;
            };
            let ahead = [ahead >> 2, ahead >> 1 & 1, ahead & 1];
            let count = ahead.map(|a| if a == 1 { HALO - BRICK } else { BRICK });
            let start = BRICK * ((ahead[0] * HALO + ahead[1]) * HALO + ahead[2]);
            c.add_to(count, blank, start);
        }
    }
}
