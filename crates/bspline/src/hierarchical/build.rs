use std::sync::Arc;

use super::brick::{BRICK, LevelCorrections, readers};
use super::graft::{Graft, grafted};
use super::node::Node;
use super::renew::renewed;
use super::{BrickKey, Lattice};
use crate::Real;

/// The tree of all corrections: level 0 whole, on finer levels the bricks that active functions reach.
pub(super) fn tree<T: Real>(lattice: &Lattice, levels: Vec<LevelCorrections<T>>) -> Arc<Node<T>> {
    let [nx, ny, nz] = lattice.cells.map(|n| n.div_ceil(BRICK as u32));
    let whole = (0..nx).flat_map(|x| (0..ny).flat_map(move |y| (0..nz).map(move |z| BrickKey([x, y, z]))));
    let mut grafts: Vec<Graft<T>> = whole.map(|key| Graft::stale(lattice, 0, key)).collect();
    for (level, bricks) in levels.into_iter().enumerate() {
        let reached = bricks.iter().flat_map(|(key, c)| readers(*key, *c.mask()));
        let mut reached: Vec<BrickKey> = reached.filter(|key| !bricks.contains_key(key)).collect();
        reached.sort_unstable();
        reached.dedup();
        grafts.extend(reached.into_iter().map(|key| Graft::stale(lattice, level, key)));
        let full = bricks.into_iter().filter(|(_, c)| c.count() > 0);
        grafts.extend(full.map(|(key, c)| Graft::functions(lattice, level, key, Some(c))));
    }
    let grafted = grafted(lattice, None, grafts);
    renewed(lattice, None, &grafted)
}
