//! Fields of large volumes, put together from fits of blocks.
//!
//! What is known of a block is a part: bricks with the keys that they have in the whole field ([`formats::field::PartIndex`]).
//! Blocks begin at bricks of level 0, so that a brick and all finer ones in its place are of one block, and parts are disjoint.

mod part;
mod rank;
mod ticket;
mod write;

use std::collections::btree_map::Entry;
use std::sync::Arc;

use bspline::hierarchical::{BRICK, BrickKey, Corrections, DenseCorrections, Lattice, LevelCorrections};
use glam::{DAffine3, DVec3};

pub use part::{block_part, finished_block, near_field};
pub use write::write_blocks;

/// Levels of a volume's field: knots every 4, 2 and 1 voxels.
const LEVELS: usize = 3;
/// Voxels along a leaf, which is a cell of level 0.
const LEAF: u32 = 4;

/// The bricks of each level.
type Levels = [LevelCorrections<f32>; LEVELS];

/// Voxels along a brick of a level.
fn along(level: usize) -> u32 {
    (BRICK as u32) << (LEVELS - 1 - level)
}

/// The grids of a volume of `shape` voxels that `affine` maps to the world.
fn lattice(shape: [u32; 3], affine: DAffine3) -> Lattice {
    Lattice {
        world_from_lattice: affine * DAffine3::from_scale(DVec3::splat(f64::from(LEAF))),
        cells: shape.map(|n| (n - 1).div_ceil(LEAF).max(1)),
    }
}

/// Adds the functions of a brick to those that are there.
fn add(all: &mut LevelCorrections<f32>, key: BrickKey, more: &Arc<Corrections<f32>>) {
    match all.entry(key) {
        Entry::Vacant(place) => drop(place.insert(more.clone())),
        Entry::Occupied(mut place) => {
            let mut sum = DenseCorrections::from(&**place.get());
            for (slot, value) in more.iter() {
                // Slots without a function hold 0.
                let value = sum.values[slot] + value;
                sum.set([slot / 64, slot / 8 % 8, slot % 8], value);
            }
            place.insert(Arc::new(sum.pack()));
        }
    }
}
