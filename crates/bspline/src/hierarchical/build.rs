use std::sync::{Arc, OnceLock};

use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::brick::{BRICK, Brick, HALO, HALO_LEN, LevelCorrections, NONE};
use super::prolong::prolong;
use super::{BrickKey, Lattice};
use crate::Real;

/// Bricks of every level, in key order, with totals and children.
pub(crate) fn build_levels<T: Real>(
    lattice: &Lattice,
    corrections: &[Arc<LevelCorrections<T>>],
) -> Vec<Vec<Brick<T>>> {
    let keys = needed_keys(lattice, corrections);
    let mut levels: Vec<Vec<Brick<T>>> = Vec::with_capacity(keys.len());
    for (level, keys) in keys.iter().enumerate() {
        let parents = levels.last_mut();
        let parent_index: FxHashMap<BrickKey, u32> = parents
            .as_ref()
            .map(|p| p.iter().enumerate().map(|(i, b)| (b.key, i as u32)).collect())
            .unwrap_or_default();
        let make = |(key, mut totals): (&BrickKey, Arc<[T; HALO_LEN]>)| {
            let parent = parents
                .as_deref()
                .map(|parents| &*parents[parent_index[&key.parent()] as usize].totals);
            fill_totals(
                parent,
                &corrections[level],
                *key,
                Arc::get_mut(&mut totals).expect("just made"),
            );
            let hull = min_max(totals.as_slice());
            Brick {
                key: *key,
                totals,
                hull,
                bend: OnceLock::new(),
                children: [NONE; 8],
            }
        };
        // Asked for here, not by the threads: so they take the place of what the caller has freed.
        let blank: Vec<_> = keys.iter().map(|_| Arc::new([T::zero(); HALO_LEN])).collect();
        let bricks: Vec<Brick<T>> = keys.par_iter().zip(blank).with_min_len(64).map(make).collect();
        if let Some(parents) = levels.last_mut() {
            for (i, brick) in bricks.iter().enumerate() {
                let o = brick.key.octant();
                let parent = parent_index[&brick.key.parent()] as usize;
                parents[parent].children[4 * o[0] + 2 * o[1] + o[2]] = i as u32;
            }
        }
        levels.push(bricks);
    }
    gather_hulls(&mut levels);
    levels
}

/// `C_ℓ` = prolonged `C_{ℓ-1}` + corrections of one brick.
pub(super) fn brick_totals<T: Real>(
    parent: Option<&[T; HALO_LEN]>,
    corrections: &LevelCorrections<T>,
    key: BrickKey,
) -> Arc<[T; HALO_LEN]> {
    let mut totals = Arc::new([T::zero(); HALO_LEN]);
    fill_totals(
        parent,
        corrections,
        key,
        Arc::get_mut(&mut totals).expect("just made"),
    );
    totals
}

fn fill_totals<T: Real>(
    parent: Option<&[T; HALO_LEN]>,
    corrections: &LevelCorrections<T>,
    key: BrickKey,
    blank: &mut [T; HALO_LEN],
) {
    if let Some(parent) = parent {
        prolong(parent, key.octant(), blank);
    }
    add_corrections(corrections, key, blank);
}

/// Least and largest value.
pub(super) fn min_max<T: Real>(values: &[T]) -> [T; 2] {
    const LANES: usize = 16;
    // Lanes by hand: the order of one accumulator is not for the compiler to change. Comparisons as written here turn
    // into vector instructions; `Float::min` does not.
    let (mut lo, mut hi) = ([T::infinity(); LANES], [T::neg_infinity(); LANES]);
    let raise = |lo: &mut [T], hi: &mut [T], values: &[T]| {
        for ((lo, hi), &v) in lo.iter_mut().zip(hi).zip(values) {
            *lo = if v < *lo { v } else { *lo };
            *hi = if v > *hi { v } else { *hi };
        }
    };
    let (rows, rest) = values.as_chunks::<LANES>();
    for row in rows {
        raise(&mut lo, &mut hi, row);
    }
    raise(&mut lo, &mut hi, rest);
    let least = lo
        .into_iter()
        .fold(T::infinity(), |m, v| if v < m { v } else { m });
    let most = hi
        .into_iter()
        .fold(T::neg_infinity(), |m, v| if v > m { v } else { m });
    [least, most]
}

/// From the finest level up: a brick's hull covers its children's, and its own where a child is missing.
fn gather_hulls<T: Real>(levels: &mut [Vec<Brick<T>>]) {
    for level in (1..levels.len()).rev() {
        let (coarser, finer) = levels.split_at_mut(level);
        for brick in coarser[level - 1].iter_mut().filter(|b| b.has_children()) {
            brick.hull = gathered_hull(brick, brick.hull, &finer[0]);
        }
    }
}

/// Hull of a brick whose own coefficients lie in `own` and whose children are among `finer`.
pub(super) fn gathered_hull<T: Real>(brick: &Brick<T>, own: [T; 2], finer: &[Brick<T>]) -> [T; 2] {
    let nothing = [T::infinity(), T::neg_infinity()];
    let is_covered = brick.children.iter().all(|&c| c != NONE);
    let children = brick.children.iter().filter(|&&c| c != NONE);
    children.fold(if is_covered { nothing } else { own }, |hull, &child| {
        let below = finer[child as usize].hull;
        [hull[0].min(below[0]), hull[1].max(below[1])]
    })
}

/// Level 0 whole; on finer levels every brick that the support of an active function touches, and the
/// parents of all bricks below.
fn needed_keys<T: Real>(lattice: &Lattice, corrections: &[Arc<LevelCorrections<T>>]) -> Vec<Vec<BrickKey>> {
    let brick_counts = |level| lattice.cells_at(level).map(|n| n.div_ceil(BRICK as u32));
    let mut keys: Vec<Vec<BrickKey>> = vec![Vec::new(); corrections.len()];
    for level in (1..corrections.len()).rev() {
        let limit = brick_counts(level);
        let mut needed: Vec<BrickKey> = Vec::new();
        for (key, active) in corrections[level].as_ref() {
            for octant in 0..8usize {
                let back = [octant >> 2, octant >> 1 & 1, octant & 1];
                if (0..3).all(|a| key.0[a] as usize >= back[a]) && active.reaches(back) {
                    let k = std::array::from_fn(|a| key.0[a] - back[a] as u32);
                    if (0..3).all(|a| k[a] < limit[a]) {
                        needed.push(BrickKey(k));
                    }
                }
            }
        }
        if let Some(finer) = keys.get(level + 1) {
            needed.extend(finer.iter().map(|k| k.parent()));
        }
        needed.sort_unstable();
        needed.dedup();
        keys[level] = needed;
    }
    let [nx, ny, nz] = brick_counts(0);
    keys[0] = (0..nx)
        .flat_map(|x| (0..ny).flat_map(move |y| (0..nz).map(move |z| BrickKey([x, y, z]))))
        .collect();
    keys
}

/// Adds to a brick's 11³ totals its own corrections and the first three layers of its upper neighbours.
fn add_corrections<T: Real>(level: &LevelCorrections<T>, key: BrickKey, totals: &mut [T; HALO_LEN]) {
    for octant in 0..8usize {
        let ahead = [octant >> 2, octant >> 1 & 1, octant & 1];
        let Some(c) = level.get(&BrickKey(std::array::from_fn(|a| key.0[a] + ahead[a] as u32))) else {
            continue;
        };
        let count = ahead.map(|a| if a == 1 { HALO - BRICK } else { BRICK });
        for x in 0..count[0] {
            for y in 0..count[1] {
                let source = (x * BRICK + y) * BRICK;
                let target = ((x + ahead[0] * BRICK) * HALO + y + ahead[1] * BRICK) * HALO + ahead[2] * BRICK;
                let row = &c.values[source..source + count[2]];
                for (total, value) in totals[target..target + count[2]].iter_mut().zip(row) {
                    *total += *value;
                }
            }
        }
    }
}
