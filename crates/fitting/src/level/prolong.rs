//! A level's totals from those of the level above it.

use bspline::Real;
use bspline::hierarchical::refine_block;

use super::brick::{BRICK, BRICK_LEN, Key};

/// Parents of a brick along an axis.
pub(super) const SPAN: usize = BRICK / 2 + 2;
/// All of them.
pub(super) const PARENTS: usize = SPAN * SPAN * SPAN;

/// Totals of the bricks `keys` by the two-scale relation, of the parents from a slot on as `read` gives them.
pub(super) fn prolonged<T: Real>(keys: &[Key], read: impl Fn([usize; 3], &mut [T; PARENTS])) -> Vec<T> {
    let mut totals = vec![T::zero(); keys.len() * BRICK_LEN];
    let mut parents = [T::zero(); PARENTS];
    let mut work = [T::zero(); SPAN * SPAN * BRICK + SPAN * BRICK * BRICK];
    for (key, target) in keys.iter().zip(totals.chunks_exact_mut(BRICK_LEN)) {
        // Slots 4b .. 4b+3 have parents in slots 2b .. 2b+3.
        read(key.map(|b| BRICK / 2 * b as usize), &mut parents);
        refine_block::<T, SPAN, BRICK>(&parents, &mut work, target);
    }
    totals
}
