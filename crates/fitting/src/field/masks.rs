//! Which knots of a tile: one bit each.

use std::ops::Range;

use super::tiles::{TILE, TileKey};

/// One bit per knot: word `x`, bit `8y + z`.
pub(super) type Mask = [u64; TILE];

pub(super) const NONE: Mask = [0; TILE];
pub(super) const ALL: Mask = [!0; TILE];

/// Whether no bit is set. Comparing with [`NONE`] is a call.
#[inline]
pub(super) fn is_none(mask: &Mask) -> bool {
    mask.iter().fold(0, |all, word| all | word) == 0
}

/// Rows of a tile along z that matter: a range on x and one on y.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    pub x: Range<usize>,
    pub y: Range<usize>,
}

impl Rows {
    /// Whether they are all of a tile.
    pub fn is_all(&self) -> bool {
        self.x.len() == TILE && self.y.len() == TILE
    }

    /// Those with a knot of a mask.
    pub fn of(mask: &Mask) -> Self {
        let plane = mask.iter().fold(0, |all, word| all | word).to_le_bytes();
        let ends = |is_set: &dyn Fn(usize) -> bool| {
            let first = (0..TILE).find(|i| is_set(*i)).unwrap_or(0);
            let last = (0..TILE).rev().find(|i| is_set(*i));
            first..last.map_or(first, |last| last + 1)
        };
        Self {
            x: ends(&|x| mask[x] != 0),
            y: ends(&|y| plane[y] != 0),
        }
    }
}

/// Knots of the tile in the middle of 27 that lie no more than `reach` (1 or 2) from those of their masks on any axis.
pub(super) fn spread(reach: usize, mask: impl Fn(usize) -> Option<Mask>) -> Mask {
    // Along z, then y, then x.
    let mut rows = [NONE; 9];
    for (n, row) in rows.iter_mut().enumerate() {
        let tiles = [3 * n, 3 * n + 1, 3 * n + 2].map(|n| mask(n).unwrap_or(NONE));
        if tiles.iter().any(|mask| !is_none(mask)) {
            let words = |x: usize| tiles.each_ref().map(|mask| mask[x]);
            *row = std::array::from_fn(|x| spread_bits(reach, words(x)));
        }
    }
    let plane = |n: usize| -> Mask {
        std::array::from_fn(|x| spread_bytes(reach, [rows[3 * n][x], rows[3 * n + 1][x], rows[3 * n + 2][x]]))
    };
    let planes = [plane(0), plane(1), plane(2)];
    let planes = planes.as_flattened();
    std::array::from_fn(|x| {
        let near = &planes[TILE + x - reach..=TILE + x + reach];
        near.iter().fold(0, |all, word| all | word)
    })
}

/// Bits of the second word no more than `reach` from those of the same bytes of three words, one behind the other.
fn spread_bits(reach: usize, [before, own, behind]: [u64; 3]) -> u64 {
    const EACH: u64 = 0x0101_0101_0101_0101;
    (1..=reach).fold(own, |all, by| {
        let (low, high) = (EACH * ((1 << by) - 1), EACH * (0xff >> by));
        let back = TILE - by;
        all | own >> by & high | (own & high) << by | before >> back & low | (behind & low) << back
    })
}

/// Bytes of the second word no more than `reach` from those of three words.
fn spread_bytes(reach: usize, [before, own, behind]: [u64; 3]) -> u64 {
    (1..=reach).fold(own, |all, by| {
        let (by, back) = (8 * by, 64 - 8 * by);
        all | own >> by | own << by | before >> back | behind << back
    })
}

/// The knots `lo ..= hi` of a tile.
pub(super) fn between(key: TileKey, lo: [i64; 3], hi: [i64; 3]) -> Mask {
    let [xs, ys, zs] = [0, 1, 2].map(|a| {
        let first = i64::from(key[a]) * TILE as i64;
        let start = (lo[a] - first).clamp(0, TILE as i64);
        let end = (hi[a] + 1 - first).clamp(start, TILE as i64);
        start as usize..end as usize
    });
    let row = ((1u64 << zs.len()) - 1) << zs.start;
    let plane = ys.fold(0, |plane, y| plane | row << (TILE * y));
    std::array::from_fn(|x| if xs.contains(&x) { plane } else { 0 })
}

/// Bits of a mask, with their place `64x + 8y + z`.
pub(super) fn places(mask: &Mask) -> impl Iterator<Item = usize> {
    bspline::hierarchical::active_slots(mask)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masks_spread_as_far_as_they_reach() {
        // A few bits of 27 tiles, by their distance.
        let is_set = |at: [i64; 3]| (at[0] * 31 + at[1] * 17 + at[2] * 7).rem_euclid(101) == 3;
        let knots = || (0..8i64).flat_map(|x| (0..8i64).flat_map(move |y| (0..8i64).map(move |z| [x, y, z])));
        let mask = |n: usize| {
            let corner = [n / 9, n / 3 % 3, n % 3].map(|s| 8 * s as i64 - 8);
            let mut mask = NONE;
            for [x, y, z] in knots().filter(|at| is_set(std::array::from_fn(|a| corner[a] + at[a]))) {
                mask[x as usize] |= 1 << (8 * y + z);
            }
            mask
        };
        for reach in [1, 2] {
            let found = spread(reach, |n| Some(mask(n)));
            let r = reach as i64;
            for at in knots() {
                let is_near = (-r..=r)
                    .any(|x| (-r..=r).any(|y| (-r..=r).any(|z| is_set([at[0] + x, at[1] + y, at[2] + z]))));
                let bit = found[at[0] as usize] >> (8 * at[1] + at[2]) & 1 == 1;
                assert_eq!(bit, is_near, "{at:?}, reach {reach}");
            }
        }
    }
}
