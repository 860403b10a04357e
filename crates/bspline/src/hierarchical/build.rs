use std::sync::Arc;

use super::Lattice;
use super::brick::LevelCorrections;
use super::graft::Graft;
use super::node::Node;
use super::renew::renewed;
use crate::Real;

/// The tree of all corrections: level 0 whole, on finer levels the bricks that active functions reach.
pub(super) fn tree<T: Real>(lattice: &Lattice, levels: Vec<LevelCorrections<T>>) -> Arc<Node<T>> {
    let all = levels.into_iter().enumerate();
    let grafts = all.flat_map(|(level, bricks)| {
        let bricks = bricks.into_iter();
        bricks.map(move |(key, new)| Graft::new(lattice, (level, key), *new.mask(), Some(new)))
    });
    renewed(lattice, None, grafts.collect())
}
