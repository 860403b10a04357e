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
    /// The brick in which a function's coefficient stands.
    pub fn of(function: [u32; 3]) -> Self {
        Self(function.map(|s| s / BRICK as u32))
    }

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

/// The active functions of one brick and their coefficients. A coefficient of −0 is kept as +0, so that equal functions
/// have equal bits.
#[derive(Clone, Debug, PartialEq)]
pub struct Corrections<T> {
    /// One bit per slot: word `x`, bit `8y + z`.
    mask: [u64; BRICK],
    /// Coefficients of the active slots, in the order of their numbers `64x + 8y + z`.
    values: Vec<T>,
}

impl<T: Real> Corrections<T> {
    /// No function active.
    pub fn empty() -> Self {
        Self {
            mask: [0; BRICK],
            values: Vec::new(),
        }
    }

    /// The functions of `mask`, with `values` in the order of their slots.
    ///
    /// # Panics
    /// If there are not as many values as functions.
    pub fn new(mask: [u64; BRICK], mut values: Vec<T>) -> Self {
        values.iter_mut().for_each(|v| *v += T::zero());
        let found = Self { mask, values };
        assert_eq!(found.values.len(), found.count(), "a value for each function");
        found
    }

    /// Makes slot `(x, y, z)` active with coefficient `c`.
    pub fn set(&mut self, slot: [usize; 3], c: T) {
        self.put((slot[0] * BRICK + slot[1]) * BRICK + slot[2], Some(c));
    }

    /// Gives slot number `64x + 8y + z` a coefficient, or makes it inactive.
    pub(super) fn put(&mut self, slot: usize, value: Option<T>) {
        let (rank, bit) = (self.rank(slot), 1 << (slot % 64));
        match (self.is_active(slot), value) {
            (true, Some(c)) => self.values[rank] = c + T::zero(),
            (false, Some(c)) => self.values.insert(rank, c + T::zero()),
            (true, None) => drop(self.values.remove(rank)),
            (false, None) => {}
        }
        self.mask[slot / 64] &= !bit;
        self.mask[slot / 64] |= if value.is_some() { bit } else { 0 };
    }

    /// One bit per slot: word `x`, bit `8y + z`.
    pub fn mask(&self) -> &[u64; BRICK] {
        &self.mask
    }

    /// Coefficients of the active slots, in the order of their numbers.
    pub fn values(&self) -> &[T] {
        &self.values
    }

    /// Coefficient of slot number `64x + 8y + z`, if it is active.
    pub fn get(&self, slot: usize) -> Option<T> {
        self.is_active(slot).then(|| self.values[self.rank(slot)])
    }

    /// The first active slot whose coefficient is no number, with it.
    pub(super) fn unfit(&self) -> Option<(usize, T)> {
        // Most are fit, and that is told faster without their slots.
        match self
            .values
            .iter()
            .fold(true, |all, value| all & value.is_finite())
        {
            true => None,
            false => self.iter().find(|(_, value)| !value.is_finite()),
        }
    }

    /// Numbers of the active slots with their coefficients, in order.
    pub fn iter(&self) -> impl Iterator<Item = (usize, T)> {
        active_slots(&self.mask).zip(self.values.iter().copied())
    }

    /// Number of active functions.
    pub fn count(&self) -> usize {
        self.mask.iter().map(|w| w.count_ones() as usize).sum()
    }

    /// Whether slot number `64x + 8y + z` is active.
    pub fn is_active(&self, slot: usize) -> bool {
        self.mask[slot / 64] >> (slot % 64) & 1 == 1
    }

    /// Active slots before one.
    fn rank(&self, slot: usize) -> usize {
        let (word, bit) = (slot / 64, slot % 64);
        let before: u32 = self.mask[..word].iter().map(|w| w.count_ones()).sum();
        (before + (self.mask[word] & ((1 << bit) - 1)).count_ones()) as usize
    }

    /// With the coefficients of `add` added, and the slots that this changes, one bit each as in [`Self::mask`].
    pub(super) fn plus(&self, add: &Self) -> (Self, [u64; BRICK]) {
        let mask: [u64; BRICK] = std::array::from_fn(|x| self.mask[x] | add.mask[x]);
        let count: u32 = mask.iter().map(|w| w.count_ones()).sum();
        let mut values = Vec::with_capacity(count as usize);
        let (mut own, mut more) = (&self.values[..], &add.values[..]);
        let changed = std::array::from_fn(|x| {
            let (here, there) = (self.mask[x], add.mask[x]);
            let (a, b);
            (a, own) = own.split_at(here.count_ones() as usize);
            (b, more) = more.split_at(there.count_ones() as usize);
            if there == 0 {
                values.extend_from_slice(a);
                return 0;
            }
            let is_changed = |(old, new): (&T, &T)| u64::from(old != new);
            if here == there {
                let start = values.len();
                values.extend(a.iter().zip(b).map(|(a, b)| *a + *b));
                let pairs = a.iter().zip(&values[start..]);
                if here == u64::MAX {
                    let pairs = pairs.enumerate();
                    return pairs.fold(0, |changed, (slot, pair)| changed | is_changed(pair) << slot);
                }
                let pairs = bits(here).zip(pairs);
                return pairs.fold(0, |changed, (slot, pair)| changed | is_changed(pair) << slot);
            }
            if here | there == here {
                let start = values.len();
                values.extend_from_slice(a);
                return bits(there).zip(b).fold(0, |changed, (slot, more)| {
                    let rank = match here {
                        u64::MAX => slot,
                        here => (here & ((1 << slot) - 1)).count_ones() as usize,
                    };
                    let value = &mut values[start + rank];
                    let old = std::mem::replace(value, *value + *more);
                    changed | is_changed((&old, value)) << slot
                });
            }
            let (mut a, mut b) = (a.iter(), b.iter());
            let next = |values: &mut std::slice::Iter<T>, word: u64, slot: usize| {
                let is_active = word >> slot & 1 == 1;
                is_active.then(|| *values.next().expect("a value for each function"))
            };
            bits(here | there).fold(0, |changed, slot| {
                let old = next(&mut a, here, slot);
                let new = old.unwrap_or(T::zero()) + next(&mut b, there, slot).unwrap_or(T::zero());
                values.push(new);
                changed | u64::from(old != Some(new)) << slot
            })
        });
        (Self { mask, values }, changed)
    }

    /// Whether the support of an active function reaches into the brick `back` bricks behind on each axis (0 or 1).
    pub(super) fn reaches(&self, back: [usize; 3]) -> bool {
        self.mask
            .iter()
            .zip(read_slots(back))
            .any(|(w, read)| w & read != 0)
    }

    /// Adds the coefficients of the slots below `count` on each axis to `target`, 11 wide, from `start` on.
    pub(super) fn add_to(&self, count: [usize; 3], target: &mut [T; HALO_LEN], start: usize) {
        match count[2] {
            BRICK => self.add_rows::<BRICK>([count[0], count[1]], target, start),
            _ => self.add_rows::<{ HALO - BRICK }>([count[0], count[1]], target, start),
        }
    }

    /// [`Self::add_to`] of rows along z of one length.
    #[inline(always)]
    fn add_rows<const ROW: usize>(&self, count: [usize; 2], target: &mut [T; HALO_LEN], start: usize) {
        let mut rank = 0;
        for (x, &word) in self.mask.iter().enumerate().take(count[0]) {
            let mut values = &self.values[rank..];
            rank += word.count_ones() as usize;
            if word == u64::MAX {
                let (own, _) = values[..BRICK * BRICK].as_chunks::<BRICK>();
                for (y, own) in own.iter().enumerate().take(count[1]) {
                    let to = start + (x * HALO + y) * HALO;
                    let to: &mut [T; ROW] = (&mut target[to..to + ROW]).try_into().expect("a row");
                    for z in 0..ROW {
                        to[z] += own[z];
                    }
                }
                continue;
            }
            let mut rows = word;
            for y in 0..count[1] {
                if rows == 0 {
                    break;
                }
                let mut row = rows as u8;
                rows >>= BRICK;
                let (own, rest) = values.split_at(row.count_ones() as usize);
                values = rest;
                let to = start + (x * HALO + y) * HALO;
                let to: &mut [T; ROW] = (&mut target[to..to + ROW]).try_into().expect("a row");
                if row == 0xff {
                    let own: &[T; ROW] = own[..ROW].try_into().expect("a row");
                    for z in 0..ROW {
                        to[z] += own[z];
                    }
                    continue;
                }
                for value in own {
                    let Some(t) = to.get_mut(row.trailing_zeros() as usize) else {
                        break;
                    };
                    *t += *value;
                    row &= row - 1;
                }
            }
        }
    }
}

/// [`Corrections`] while they change: a place for every slot.
#[derive(Clone, Debug)]
pub struct DenseCorrections<T> {
    /// As in [`Corrections::mask`].
    pub mask: [u64; BRICK],
    /// Coefficient of slot `(x, y, z)` at `64x + 8y + z`.
    pub values: Box<[T; BRICK_LEN]>,
}

impl<T: Real> DenseCorrections<T> {
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

    /// Coefficient of slot number `64x + 8y + z`, if it is active.
    #[inline]
    pub(super) fn get(&self, slot: usize) -> Option<T> {
        (self.mask[slot / 64] >> (slot % 64) & 1 == 1).then(|| self.values[slot])
    }

    /// Gives slot number `64x + 8y + z` a coefficient, or makes it inactive.
    #[inline]
    pub(super) fn put(&mut self, slot: usize, value: Option<T>) {
        let bit = 1 << (slot % 64);
        self.mask[slot / 64] &= !bit;
        self.mask[slot / 64] |= if value.is_some() { bit } else { 0 };
        self.values[slot] = value.unwrap_or(T::zero());
    }

    /// The active functions alone.
    pub fn pack(&self) -> Corrections<T> {
        let count: u32 = self.mask.iter().map(|w| w.count_ones()).sum();
        let mut values = Vec::with_capacity(count as usize);
        for (word, row) in self.mask.iter().zip(self.values.as_chunks::<64>().0) {
            match *word {
                u64::MAX => values.extend_from_slice(row),
                word => values.extend(bits(word).map(|bit| row[bit])),
            }
        }
        Corrections::new(self.mask, values)
    }
}

impl<T: Real> From<&Corrections<T>> for DenseCorrections<T> {
    fn from(packed: &Corrections<T>) -> Self {
        let mut dense = Self::empty();
        dense.mask = packed.mask;
        packed.iter().for_each(|(slot, value)| dense.values[slot] = value);
        dense
    }
}

/// Numbers of the slots of a mask, in order.
pub fn active_slots(mask: &[u64; BRICK]) -> impl Iterator<Item = usize> {
    let words = mask.iter().enumerate();
    words.flat_map(|(x, &word)| bits(word).map(move |bit| 64 * x + bit))
}

/// Numbers of the bits that are set, in order.
fn bits(word: u64) -> impl Iterator<Item = usize> {
    let next = |word: &u64| Some(word & (word - 1)).filter(|rest| *rest != 0);
    std::iter::successors(Some(word).filter(|word| *word != 0), next)
        .map(|word| word.trailing_zeros() as usize)
}

/// Slots that are active in one of two bricks alone, or with another coefficient.
pub(super) fn differing<T: Real>(a: Option<&Corrections<T>>, b: Option<&Corrections<T>>) -> [u64; BRICK] {
    let [mask_a, mask_b] = [a, b].map(|c| c.map_or([0; BRICK], |c| c.mask));
    let [mut a, mut b] = [a, b].map(|c| c.map_or(&[][..], |c| &c.values));
    std::array::from_fn(|x| {
        let (here, there) = (mask_a[x], mask_b[x]);
        let (values_a, values_b);
        (values_a, a) = a.split_at(here.count_ones() as usize);
        (values_b, b) = b.split_at(there.count_ones() as usize);
        if here == there && values_a == values_b {
            return 0;
        }
        let (mut values_a, mut values_b) = (values_a.iter(), values_b.iter());
        bits(here | there).fold(here ^ there, |changed, slot| {
            let a = (here >> slot & 1 == 1).then(|| values_a.next());
            let b = (there >> slot & 1 == 1).then(|| values_b.next());
            changed | u64::from(a != b) << slot
        })
    })
}

/// Slots of a brick that the one `back` bricks behind on each axis (0 or 1) reads: 0, 1 and 2 where it is behind.
pub(super) fn read_slots(back: [usize; 3]) -> [u64; BRICK] {
    const Y_LOW: u64 = 0x00ff_ffff;
    const Z_LOW: u64 = 0x0707_0707_0707_0707;
    let rows = if back[1] == 1 { Y_LOW } else { !0 } & if back[2] == 1 { Z_LOW } else { !0 };
    std::array::from_fn(|x| {
        if back[0] == 1 && x >= HALO - BRICK {
            0
        } else {
            rows
        }
    })
}

/// The stored part of a level: bricks with active functions, in key order.
pub type LevelCorrections<T> = BTreeMap<BrickKey, Arc<Corrections<T>>>;
