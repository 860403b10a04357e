//! The tiles of a level, slab by slab: what is known at their knots of a whole large scan would not fit into memory.

use std::ops::Range;

use super::tiles::TileKey;

/// Tiles in order, and those beside them by one on x, to which what their stencils read does not reach through.
pub(super) struct Slab {
    pub keys: Vec<TileKey>,
    /// First and last of its own on x.
    pub start: i32,
    end: i32,
}

impl Slab {
    /// Which of the tiles are its own.
    pub fn own(&self) -> Range<usize> {
        let first = self.keys.partition_point(|key| key[0] < self.start);
        first..self.keys.partition_point(|key| key[0] <= self.end)
    }
}

/// Slabs of all `keys`, which are sorted: of whole planes on x, as few as hold `most` tiles.
pub(super) fn slabs(keys: &[TileKey], most: usize) -> impl Iterator<Item = Slab> {
    let mut rest = keys;
    std::iter::from_fn(move || {
        let [start, ..] = *rest.first()?;
        let end = rest[most.min(rest.len()) - 1][0];
        rest = &rest[rest.partition_point(|key| key[0] <= end)..];
        let first = keys.partition_point(|key| key[0] < start - 1);
        let last = keys.partition_point(|key| key[0] <= end + 1);
        let keys = keys[first..last].to_vec();
        Some(Slab { keys, start, end })
    })
}
