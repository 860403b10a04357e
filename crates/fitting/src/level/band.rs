//! One surface level: bricks of coefficients near the samples, and nothing elsewhere.

use bspline::Real;
use rustc_hash::{FxHashMap, FxHashSet};

pub(crate) use super::brick::{BRICK, BRICK_LEN, HALO, HALO_LEN, Key, STRIDES, halo_start, key_of, slot_of};
use super::full_grid::FullGrid;
use super::prolong::{PARENTS, SPAN, prolonged};

/// How far the penalty of an active function reaches.
pub(crate) const REACH: u32 = 2;
/// No brick there.
pub(crate) const NONE: u32 = u32::MAX;

/// Bricks of a level with their totals and active functions.
///
/// Slot `s` of an axis holds function `s - 1`, as in [`bspline::hierarchical`]. Bricks are in key order.
#[derive(Debug)]
pub(crate) struct Band<T> {
    /// Cells along the box: `2^depth`.
    pub depth: usize,
    pub keys: Vec<Key>,
    index: FxHashMap<Key, u32>,
    /// Bricks 0 or 1 ahead on each axis, octant `4x + 2y + z`; the first is the brick itself.
    pub ahead: Vec<[u32; 8]>,
    /// The same behind.
    pub behind: Vec<[u32; 8]>,
    /// Active slots, one bit each.
    pub masks: Vec<u64>,
    /// `C_ℓ`: prolonged from the coarser level, corrected on active slots by the solve.
    pub totals: Vec<T>,
    /// Number of active functions in the bricks before each, and in all.
    pub offsets: Vec<usize>,
}

/// Coefficients of the level below, to prolong from.
pub(crate) enum Coarser<'a, T> {
    Full(&'a FullGrid<f64>),
    Band(&'a Band<T>),
}

impl<T: Real> Coarser<'_, T> {
    /// The 4³ totals from slot `first` on. A function whose parents are not in the coarser band is of no use to the next
    /// one and gets whatever zeros give.
    fn read(&self, first: [usize; 3], out: &mut [T; PARENTS]) {
        match self {
            Coarser::Full(grid) => {
                let m = grid.width();
                for (i, value) in out.iter_mut().enumerate() {
                    let at = [i / SPAN / SPAN, i / SPAN % SPAN, i % SPAN];
                    let s: [usize; 3] = std::array::from_fn(|a| first[a] + at[a]);
                    *value = match s.iter().all(|&s| s < m) {
                        true => T::from_f64(grid.values[(s[0] * m + s[1]) * m + s[2]]),
                        false => T::zero(),
                    };
                }
            }
            Coarser::Band(band) => gather_span(band, first, out),
        }
    }
}

impl<T: Real> Band<T> {
    /// A band whose active functions are the eight central ones of each of `cells` (sorted or not), with
    /// bricks for all functions within two of an active one, and totals prolonged from `coarser`.
    pub fn around(depth: usize, cells: &[[u32; 3]], coarser: &Coarser<'_, T>) -> Self {
        Self::around_reaching(depth, cells, REACH, coarser)
    }

    /// [`Band::around`], with bricks for all functions within `reach` of an active one.
    pub fn around_reaching(depth: usize, cells: &[[u32; 3]], reach: u32, coarser: &Coarser<'_, T>) -> Self {
        let active = active_bricks(cells);
        let (keys, index) = bricks_round(depth, &active, reach);
        let mut masks = vec![0u64; keys.len()];
        for (key, mask) in active {
            masks[index[&key] as usize] = mask;
        }
        let (mut ahead, mut behind) = (vec![[NONE; 8]; keys.len()], vec![[NONE; 8]; keys.len()]);
        for (i, key) in keys.iter().enumerate() {
            for octant in 0..8usize {
                let d = [octant >> 2, octant >> 1 & 1, octant & 1];
                if let Some(&j) = index.get(&std::array::from_fn(|a| key[a] + d[a] as u32)) {
                    ahead[i][octant] = j;
                    behind[j as usize][octant] = i as u32;
                }
            }
        }
        let mut offsets = vec![0];
        for m in &masks {
            offsets.push(offsets[offsets.len() - 1] + m.count_ones() as usize);
        }
        let totals = prolonged(&keys, |first, parents| coarser.read(first, parents));
        Self {
            depth,
            keys,
            index,
            ahead,
            behind,
            masks,
            totals,
            offsets,
        }
    }

    /// Active functions.
    pub fn active_count(&self) -> usize {
        self.offsets[self.keys.len()]
    }

    /// Index of the brick with `key`.
    pub fn find(&self, key: Key) -> Option<usize> {
        self.index.get(&key).map(|&i| i as usize)
    }

    /// Calls `f(slot in the brick, index among all active)` for the active slots of `brick`.
    #[inline]
    pub fn for_active(&self, brick: usize, mut f: impl FnMut(usize, usize)) {
        for (i, slot) in active_slots(self.masks[brick]).enumerate() {
            f(slot, self.offsets[brick] + i);
        }
    }

    /// Adds a vector over active functions to the totals.
    pub fn add_active(&mut self, x: &[T]) {
        for (brick, totals) in self.totals.chunks_exact_mut(BRICK_LEN).enumerate() {
            for (slot, c) in active_slots(self.masks[brick]).zip(&x[self.offsets[brick]..]) {
                totals[slot] += *c;
            }
        }
    }

    /// Whether one of the 64 functions of a cell of `brick` is active.
    pub fn is_touched(&self, brick: usize, cell: [u32; 3]) -> bool {
        let at = cell.map(|c| c as usize % BRICK);
        (0..8usize).any(|octant| {
            let slots = (0..3).fold(!0, |slots, a| {
                // Of the slots `at .. at + 4` of an axis the first lie in this brick, the others in the next.
                let below = BELOW[a][at[a]];
                slots & if octant >> (2 - a) & 1 == 1 { below } else { !below }
            });
            let source = self.ahead[brick][octant];
            source != NONE && self.masks[source as usize] & slots != 0
        })
    }

    /// The cells of `brick`, one bit each, of whose eight central functions one is active.
    pub fn inner_cells(&self, brick: usize) -> u64 {
        let mut masks = self.ahead[brick].map(|b| if b == NONE { 0 } else { self.masks[b as usize] });
        // Cell `at` of an axis has its central functions in slots `at + 1` and `at + 2`, of this brick or the next.
        for axis in 0..3 {
            let stride = BRICK.pow(2 - axis as u32);
            let half = 1 << (2 - axis);
            for octant in 0..half {
                let [own, next] = [masks[octant], masks[octant + half]];
                let shifted = |by: usize| {
                    let own = own >> (by * stride) & BELOW[axis][BRICK - by];
                    own | next << ((BRICK - by) * stride) & !BELOW[axis][BRICK - by]
                };
                masks[octant] = shifted(1) | shifted(2);
            }
        }
        masks[0]
    }

    /// The 7³ coefficients that the cells of `brick` read, from an array of bricks; absent ones are 0.
    #[inline]
    pub fn halo(&self, values: &[T], brick: usize, out: &mut [T; HALO_LEN]) {
        const REST: usize = HALO - BRICK;
        let nothing = [T::zero(); BRICK_LEN];
        for octant in [0, 2, 4, 6] {
            let [own, next] = [octant, octant + 1].map(|o| match self.ahead[brick][o] {
                NONE => &nothing[..],
                b => &values[b as usize * BRICK_LEN..][..BRICK_LEN],
            });
            let d = [octant >> 2, octant >> 1 & 1];
            let count = d.map(|d| if d == 1 { REST } else { BRICK });
            for x in 0..count[0] {
                for y in 0..count[1] {
                    let from = (x * BRICK + y) * BRICK;
                    let row = ((x + BRICK * d[0]) * HALO + y + BRICK * d[1]) * HALO;
                    // Of fixed length, so that no copy is a call.
                    out[row..row + BRICK].copy_from_slice(&own[from..from + BRICK]);
                    out[row + BRICK..row + HALO].copy_from_slice(&next[from..from + REST]);
                }
            }
        }
    }

    /// Transpose of [`Band::halo`] for the whole band: each brick collects its own slots from its own halo
    /// and those of the bricks behind it, in a fixed order. `place_of[b]` says which halo belongs to brick
    /// `b`, if any.
    pub fn collect_halos(&self, halos: &[T], place_of: &[u32], brick: usize, out: &mut [T; BRICK_LEN]) {
        const REST: usize = HALO - BRICK;
        out.fill(T::zero());
        for octant in 0..8usize {
            let source = self.behind[brick][octant];
            if source == NONE || place_of[source as usize] == NONE {
                continue;
            }
            let halo = &halos[place_of[source as usize] as usize * HALO_LEN..][..HALO_LEN];
            let d = [octant >> 2, octant >> 1 & 1, octant & 1];
            let count = d.map(|d| if d == 1 { REST } else { BRICK });
            for x in 0..count[0] {
                for y in 0..count[1] {
                    let from = ((x + BRICK * d[0]) * HALO + y + BRICK * d[1]) * HALO + BRICK * d[2];
                    let to = (x * BRICK + y) * BRICK;
                    if d[2] == 0 {
                        add_row::<T, BRICK>(&halo[from..], &mut out[to..]);
                    } else {
                        add_row::<T, REST>(&halo[from..], &mut out[to..]);
                    }
                }
            }
        }
    }
}

#[inline(always)]
fn add_row<T: Real, const N: usize>(from: &[T], to: &mut [T]) {
    for (to, from) in to[..N].iter_mut().zip(&from[..N]) {
        *to += *from;
    }
}

/// `BELOW[axis][end]`: the slots of a brick whose coordinate along `axis` is below `end`.
const BELOW: [[u64; BRICK + 1]; 3] = {
    let mut masks = [[0; BRICK + 1]; 3];
    let mut bit = 0;
    while bit < 3 * (BRICK + 1) * BRICK_LEN {
        let (axis, end, slot) = (
            bit / BRICK_LEN / (BRICK + 1),
            bit / BRICK_LEN % (BRICK + 1),
            bit % BRICK_LEN,
        );
        let at = [slot / BRICK / BRICK, slot / BRICK % BRICK, slot % BRICK];
        if at[axis] < end {
            masks[axis][end] |= 1 << slot;
        }
        bit += 1;
    }
    masks
};

/// Slots whose bit is set, in order.
#[inline]
pub(crate) fn active_slots(mask: u64) -> impl Iterator<Item = usize> {
    let mut rest = mask;
    std::iter::from_fn(move || {
        (rest != 0).then(|| {
            let bit = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            bit
        })
    })
}

/// The bricks of the central functions of `cells`, each with these, in the order met.
fn active_bricks(cells: &[[u32; 3]]) -> Vec<(Key, u64)> {
    let mut place: FxHashMap<Key, usize> = FxHashMap::default();
    let mut bricks: Vec<(Key, u64)> = Vec::new();
    let mut last = ([u32::MAX; 3], 0);
    for cell in cells {
        for corner in 0..8u32 {
            // Cell c has central functions c and c+1, slots c+1 and c+2.
            let s: [u32; 3] = std::array::from_fn(|a| cell[a] + 1 + (corner >> a & 1));
            let key = key_of(s);
            if key != last.0 {
                let at = *place.entry(key).or_insert_with(|| {
                    bricks.push((key, 0));
                    bricks.len() - 1
                });
                last = (key, at);
            }
            bricks[last.1].1 |= 1 << slot_of(s);
        }
    }
    bricks
}

/// Number of different central functions of `cells`.
pub(crate) fn active_count(cells: &[[u32; 3]]) -> usize {
    active_bricks(cells)
        .iter()
        .map(|(_, mask)| mask.count_ones() as usize)
        .sum()
}

/// Number of bricks that hold a function within `reach` of a central function of a cell.
pub(crate) fn count_bricks_near(depth: usize, cells: &[[u32; 3]], reach: u32) -> usize {
    bricks_round(depth, &active_bricks(cells), reach).0.len()
}

/// Keys of the bricks that hold a slot within `reach`, at most a brick, of an active one, in key order.
fn bricks_round(depth: usize, active: &[(Key, u64)], reach: u32) -> (Vec<Key>, FxHashMap<Key, u32>) {
    let last = ((1u32 << depth) + 2) / BRICK as u32;
    let reach = reach as usize;
    // Slots from which a brick behind, the brick itself, or one ahead is within reach.
    let near = [0, 1, 2].map(|a| [BELOW[a][reach], !0, !BELOW[a][BRICK - reach]]);
    let mut found: FxHashSet<Key> = FxHashSet::default();
    for (key, mask) in active {
        for d in 0..27usize {
            let d = [d / 9, d / 3 % 3, d % 3];
            let k: Key = std::array::from_fn(|a| (key[a] + d[a] as u32).wrapping_sub(1));
            if mask & near[0][d[0]] & near[1][d[1]] & near[2][d[2]] != 0 && k.iter().all(|&k| k <= last) {
                found.insert(k);
            }
        }
    }
    let mut keys: Vec<Key> = found.into_iter().collect();
    keys.sort_unstable();
    let index = keys.iter().enumerate().map(|(i, k)| (*k, i as u32)).collect();
    (keys, index)
}

/// The 4³ totals from slot `first` on, from up to eight bricks.
fn gather_span<T: Real>(band: &Band<T>, first: [usize; 3], source: &mut [T]) {
    let nothing = [T::zero(); BRICK_LEN];
    let key = first.map(|s| (s / BRICK) as u32);
    let own = band.find(key);
    let blocks: [&[T]; 8] = std::array::from_fn(|octant| {
        let d = [octant >> 2, octant >> 1 & 1, octant & 1];
        let brick = match own {
            Some(b) => Some(band.ahead[b][octant]).filter(|&b| b != NONE),
            None => band
                .find(std::array::from_fn(|a| key[a] + d[a] as u32))
                .map(|b| b as u32),
        };
        brick.map_or(&nothing[..], |b| {
            &band.totals[b as usize * BRICK_LEN..][..BRICK_LEN]
        })
    });
    let first = first.map(|s| s % BRICK);
    for x in 0..SPAN {
        for y in 0..SPAN {
            for z in 0..SPAN {
                let s = [first[0] + x, first[1] + y, first[2] + z];
                let octant = 4 * (s[0] / BRICK) + 2 * (s[1] / BRICK) + s[2] / BRICK;
                let at = ((s[0] % BRICK) * BRICK + s[1] % BRICK) * BRICK + s[2] % BRICK;
                source[(x * SPAN + y) * SPAN + z] = blocks[octant][at];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Deep levels are refined in few places far apart: what each of them costs decides how deep a fit can go.
    #[test]
    fn lone_cells_hold_few_slots_and_all_that_they_read() {
        let base = FullGrid::zeros(32);
        for (i, at) in [[17, 200, 63], [128, 100, 35], [0, 255, 255]]
            .into_iter()
            .enumerate()
        {
            let band = Band::<f32>::around(8, &[at], &Coarser::Full(&base));
            assert_eq!(band.active_count(), 8);
            assert!(band.totals.len() <= 27 * 64, "{i}: {} slots", band.totals.len());
            let own = band.find(key_of(at)).expect("the brick of the cell");
            assert!(band.is_touched(own, at));
            let last = (1 << 8) + 2;
            for d in 0..216u32 {
                let d = [d / 36, d / 6 % 6, d % 6];
                // Slots within two of the central ones, at + 1 and at + 2.
                let slot: [i64; 3] = std::array::from_fn(|a| i64::from(at[a] + d[a]) - 1);
                if slot.iter().all(|s| (0..=last).contains(s)) {
                    assert!(band.find(key_of(slot.map(|s| s as u32))).is_some(), "{slot:?}");
                }
            }
        }
    }

    #[test]
    fn inner_cells_are_those_with_an_active_central_function() {
        let base = FullGrid::zeros(32);
        let cells: Vec<[u32; 3]> = (0..40).map(|i| [20 + i % 7, 30 + i % 11, 40 + i % 5]).collect();
        let band = Band::<f64>::around(6, &cells, &Coarser::Full(&base));
        let is_active = |s: [u32; 3]| {
            let brick = band.find(key_of(s));
            brick.is_some_and(|b| band.masks[b] >> slot_of(s) & 1 == 1)
        };
        for (brick, key) in band.keys.iter().enumerate() {
            let inner = band.inner_cells(brick);
            for slot in 0..BRICK_LEN {
                let at = [slot / 16, slot / 4 % 4, slot % 4];
                let cell: [u32; 3] = std::array::from_fn(|a| key[a] * BRICK as u32 + at[a] as u32);
                let any = (0..8u32).any(|o| is_active(std::array::from_fn(|a| cell[a] + 1 + (o >> a & 1))));
                assert_eq!(inner >> slot & 1 == 1, any, "{cell:?}");
            }
        }
    }

    /// Every slot lies in the halos of the bricks round it as often as `collect_halos` adds it up.
    #[test]
    fn collecting_halos_is_the_transpose_of_reading_them() {
        let base = FullGrid::zeros(32);
        let cells: Vec<[u32; 3]> = (0..40).map(|i| [20 + i % 7, 30 + i % 11, 40 + i % 5]).collect();
        let band = Band::<f64>::around(6, &cells, &Coarser::Full(&base));
        let numbers =
            |n: usize, k: usize| -> Vec<f64> { (0..n).map(|i| ((i * k) % 101) as f64 - 50.0).collect() };
        let values = numbers(band.totals.len(), 37);
        let halos = numbers(band.keys.len() * HALO_LEN, 53);
        let place_of: Vec<u32> = (0..band.keys.len() as u32).collect();
        let (mut read, mut collected) = (0.0, 0.0);
        let (mut halo, mut own) = ([0.0; HALO_LEN], [0.0; BRICK_LEN]);
        for brick in 0..band.keys.len() {
            band.halo(&values, brick, &mut halo);
            read += dot(&halo, &halos[brick * HALO_LEN..][..HALO_LEN]);
            band.collect_halos(&halos, &place_of, brick, &mut own);
            collected += dot(&own, &values[brick * BRICK_LEN..][..BRICK_LEN]);
        }
        assert_eq!(read, collected);
    }

    fn dot(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| a * b).sum()
    }
}
