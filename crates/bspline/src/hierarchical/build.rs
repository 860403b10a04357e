use std::sync::Arc;

use super::Lattice;
use super::brick::{BRICK, BrickKey, LevelCorrections};
use super::graft::Graft;
use super::node::{Node, covers_cells};
use super::renew::renewed;
use crate::Real;

/// The tree of all corrections: level 0 whole, on finer levels the bricks that active functions reach.
pub(super) fn tree<T: Real>(lattice: &Lattice, levels: Vec<LevelCorrections<T>>) -> Arc<Node<T>> {
    let count = brick_count(lattice, &levels);
    let all = levels.into_iter().enumerate();
    let grafts = all.flat_map(|(level, bricks)| {
        let bricks = bricks.into_iter();
        bricks.map(move |(key, new)| Graft::new(lattice, (level, key), *new.mask(), Some(new)))
    });
    renewed(lattice, None, grafts.collect(), count)
}

/// Bricks with totals: all of level 0, those that functions reach, and those above them.
fn brick_count<T: Real>(lattice: &Lattice, levels: &[LevelCorrections<T>]) -> usize {
    let base: usize = lattice
        .cells
        .iter()
        .map(|n| n.div_ceil(BRICK as u32) as usize)
        .product();
    let mut count = base;
    let mut finer: Vec<BrickKey> = Vec::new();
    for (level, bricks) in levels.iter().enumerate().skip(1).rev() {
        let mut keys: Vec<BrickKey> = finer.into_iter().map(BrickKey::parent).collect();
        for (key, functions) in bricks {
            let reached = (0..8)
                .map(|n| [n >> 2, n >> 1 & 1, n & 1])
                .filter(|back| (0..3).all(|a| key.0[a] as usize >= back[a]) && functions.reaches(*back));
            keys.extend(reached.map(|back| BrickKey(std::array::from_fn(|a| key.0[a] - back[a] as u32))));
        }
        keys.sort_unstable();
        keys.dedup();
        keys.retain(|key| covers_cells(lattice, (level as i8, *key)));
        count += keys.len();
        finer = keys;
    }
    count
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use glam::DAffine3;

    use super::super::brick::Corrections;
    use super::*;

    /// What is counted beforehand is what the tree holds, also where functions reach back over the border of a brick or
    /// stand behind the last cell.
    #[test]
    fn totals_are_counted_before_they_are_made() {
        let lattice = Lattice {
            cells: [12, 8, 20],
            world_from_lattice: DAffine3::IDENTITY,
        };
        let mut seed = 7u64;
        let mut next = |n: u32| {
            seed = seed
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (seed >> 33) as u32 % n
        };
        for trial in 0..40 {
            let levels: Vec<LevelCorrections<f32>> = (0..1 + trial % 4)
                .map(|level| {
                    let mut bricks: BTreeMap<BrickKey, Corrections<f32>> = BTreeMap::new();
                    for _ in 0..next(12) {
                        let function = lattice.cells_at(level).map(|n| next(n + 3));
                        let slot = function.map(|s| s as usize % BRICK);
                        let brick = bricks
                            .entry(BrickKey::of(function))
                            .or_insert_with(Corrections::empty);
                        brick.set(slot, 1.0 + function[0] as f32);
                    }
                    bricks
                        .into_iter()
                        .map(|(key, brick)| (key, Arc::new(brick)))
                        .collect()
                })
                .collect();
            let count = brick_count(&lattice, &levels);
            assert_eq!(tree(&lattice, levels).brick_count, count as u64, "trial {trial}");
        }
    }
}
