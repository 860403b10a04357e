//! What limits leave of a change.
//!
//! A stroke moves the functions of one level, as wide as its tool. Those that meet what may not change give way to finer ones: each
//! is a sum of functions half as wide, and of these the free ones stay.

use std::collections::BTreeMap;

use bspline::{HierarchicalSpline, Real};

use crate::coefficients::{Functions, changed, coefficient, support, with_functions};
use crate::limits::Limits;

/// Levels by which functions at a border may be finer.
const FINER: usize = 2;
/// Shares of the five functions half as wide that one is made of, on an axis.
const SHARES: [f64; 5] = [0.125, 0.5, 0.75, 0.5, 0.125];

/// Changes of functions of one level.
type Changes = BTreeMap<[u32; 3], f64>;

/// The version `new`, changed on `level`, as far as limits allow it. Where they allow all it is `new`, and every function whose support
/// meets what may not change keeps its bits.
///
/// # Panics
/// If the two are not versions of one field.
pub fn within<T: Real>(
    old: &HierarchicalSpline<T>,
    new: &HierarchicalSpline<T>,
    limits: &Limits,
    level: usize,
) -> HierarchicalSpline<T> {
    if limits.is_none() {
        return new.clone();
    }
    let finest = limits.finest().unwrap_or(usize::MAX).min(level + FINER);
    let (mut free, mut open) = (Functions::new(), Changes::new());
    for ((at, function), value) in changed(old, new).expect("versions of one field") {
        if limits.is_free(&support(old, at, function).1) {
            free.insert((at, function), value);
        } else if at == level {
            let [from, to] = [coefficient(old, at, function), value].map(|c| c.map_or(0.0, T::as_f64));
            open.insert(function, to - from);
        }
    }
    for at in level..finest {
        open.retain(|function, _| !limits.is_shut(&support(old, at, *function).1));
        let counts = old.lattice().cells_at(at + 1).map(|n| i64::from(n) + 3);
        open = (0..3).fold(open, |open, axis| halved(&open, axis, counts[axis]));
        open.retain(|function, change| {
            let is_free = limits.is_free(&support(old, at + 1, *function).1);
            if is_free {
                let before = coefficient(old, at + 1, *function).map_or(0.0, T::as_f64);
                free.insert((at + 1, *function), Some(T::from_f64(before + *change)));
            }
            !is_free
        });
    }
    with_functions(old, &free).expect("functions of the lattice")
}

/// The same changes by functions half as wide along an axis, of which there are `count`. Function `s` of a level is made of those with
/// the numbers `2s - 3` to `2s + 1` of the next.
fn halved(changes: &Changes, axis: usize, count: i64) -> Changes {
    let mut finer = Changes::new();
    for (function, change) in changes {
        for (k, share) in SHARES.into_iter().enumerate() {
            let number = 2 * i64::from(function[axis]) - 3 + k as i64;
            if (0..count).contains(&number) {
                let mut at = *function;
                at[axis] = number as u32;
                *finer.entry(at).or_insert(0.0) += share * change;
            }
        }
    }
    finer
}
