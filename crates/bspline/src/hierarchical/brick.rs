use std::collections::BTreeMap;
use std::sync::Arc;

use crate::Real;

/// Coefficients along one edge of a brick.
pub const BRICK: usize = 8;
/// Coefficients in a brick.
pub const BRICK_LEN: usize = BRICK * BRICK * BRICK;
/// Edge of a brick of totals: 8 cells read 11 coefficients.
pub const HALO: usize = BRICK + 3;
/// Totals in a brick with its halo.
pub const HALO_LEN: usize = HALO * HALO * HALO;

/// Place of a brick on its level, in bricks; ordered by x, then y, then z.
///
/// Function `i` of a level (centred on knot `i`, `-1 <= i <= n+1` over `n` cells) is stored at
/// `s = i + 1`: in brick `s / 8`, slot `s % 8`. Brick `b` covers the cells `8b .. 8b+8` of its level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BrickKey(pub [u32; 3]);

impl BrickKey {
    /// The brick of the next coarser level that covers this one's cells.
    pub fn parent(self) -> Self {
        Self(self.0.map(|b| b >> 1))
    }

    /// The brick of the next finer level in octant `4x + 2y + z`.
    pub fn child(self, octant: usize) -> Self {
        Self(std::array::from_fn(|a| {
            2 * self.0[a] + (octant >> (2 - a) & 1) as u32
        }))
    }

    /// Which half of its parent the brick is, on each axis.
    pub(crate) fn octant(self) -> [usize; 3] {
        self.0.map(|b| (b & 1) as usize)
    }
}

/// The active functions of one brick and their coefficients. Inactive slots are zero.
#[derive(Clone, Debug, PartialEq)]
pub struct Corrections<T> {
    /// One bit per slot: word `x`, bit `8y + z`.
    pub mask: [u64; BRICK],
    /// Coefficient of slot `(x, y, z)` at `64x + 8y + z`.
    pub values: Box<[T; BRICK_LEN]>,
}

impl<T: Real> Corrections<T> {
    /// No function active.
    pub fn empty() -> Self {
        Self {
            mask: [0; BRICK],
            values: Box::new([T::zero(); BRICK_LEN]),
        }
    }

    /// Makes slot `(x, y, z)` active with coefficient `c`.
    pub fn set(&mut self, slot: [usize; 3], c: T) {
        self.mask[slot[0]] |= 1 << (BRICK * slot[1] + slot[2]);
        self.values[(slot[0] * BRICK + slot[1]) * BRICK + slot[2]] = c;
    }

    /// Number of active functions.
    pub fn count(&self) -> usize {
        self.mask.iter().map(|w| w.count_ones() as usize).sum()
    }

    /// Whether slot number `64x + 8y + z` is active.
    pub fn is_active(&self, slot: usize) -> bool {
        self.mask[slot / 64] >> (slot % 64) & 1 == 1
    }

    /// [`reaches`] for the active functions.
    pub(crate) fn reaches(&self, back: [usize; 3]) -> bool {
        reaches(&self.mask, back)
    }
}

/// Whether the support of one of the functions `mask` reaches into the brick `back` bricks behind on each axis
/// (0 or 1): the functions in slots 0, 1 and 2 do.
pub(super) fn reaches(mask: &[u64; BRICK], back: [usize; 3]) -> bool {
    const Y_LOW: u64 = 0x00ff_ffff;
    const Z_LOW: u64 = 0x0707_0707_0707_0707;
    let planes = if back[0] == 1 { 3 } else { BRICK };
    let rows = if back[1] == 1 { Y_LOW } else { !0 } & if back[2] == 1 { Z_LOW } else { !0 };
    mask[..planes].iter().any(|w| w & rows != 0)
}

/// The stored part of a level: bricks with active functions, in key order.
pub type LevelCorrections<T> = BTreeMap<BrickKey, Arc<Corrections<T>>>;
