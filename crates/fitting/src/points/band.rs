//! One surface level: bricks of coefficients near the samples, and nothing elsewhere.

use bspline::Real;
use bspline::hierarchical::{BRICK, BRICK_LEN, BrickKey, HALO, HALO_LEN, refine_block};
use rustc_hash::FxHashMap;

use super::full_grid::FullGrid;

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
    pub keys: Vec<BrickKey>,
    index: FxHashMap<BrickKey, u32>,
    /// Neighbours `(dx, dy, dz)`, each -1, 0 or 1, at `9(dx+1) + 3(dy+1) + dz+1`.
    pub neighbours: Vec<[u32; 27]>,
    /// Active slots, as in [`bspline::hierarchical::Corrections`].
    pub masks: Vec<[u64; BRICK]>,
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

impl<T: Real> Band<T> {
    /// A band whose active functions are the eight central ones of each of `cells` (sorted or not), with
    /// bricks for all functions within two of an active one, and totals prolonged from `coarser`.
    pub fn around(depth: usize, cells: &[[u32; 3]], coarser: &Coarser<'_, T>) -> Self {
        Self::around_reaching(depth, cells, REACH, coarser)
    }

    /// [`Band::around`], with bricks for all functions within `reach` of an active one.
    pub fn around_reaching(depth: usize, cells: &[[u32; 3]], reach: u32, coarser: &Coarser<'_, T>) -> Self {
        let (keys, index) = bricks_near(depth, cells, reach);
        let mut masks = vec![[0u64; BRICK]; keys.len()];
        for cell in cells {
            for corner in 0..8u32 {
                let s: [u32; 3] = std::array::from_fn(|a| cell[a] + 1 + (corner >> a & 1));
                let brick = index[&BrickKey(s.map(|s| s / BRICK as u32))];
                let [x, y, z] = s.map(|s| s as usize % BRICK);
                masks[brick as usize][x] |= 1 << (BRICK * y + z);
            }
        }
        let neighbours = keys
            .iter()
            .map(|key| {
                std::array::from_fn(|i| {
                    let d = [i / 9, i / 3 % 3, i % 3];
                    let k: [u32; 3] =
                        std::array::from_fn(|a| key.0[a].wrapping_add(d[a] as u32).wrapping_sub(1));
                    index.get(&BrickKey(k)).copied().unwrap_or(NONE)
                })
            })
            .collect();
        let mut offsets = vec![0];
        for m in &masks {
            let count: usize = m.iter().map(|w| w.count_ones() as usize).sum();
            offsets.push(offsets[offsets.len() - 1] + count);
        }
        let totals = prolonged(&keys, coarser);
        Self {
            depth,
            keys,
            index,
            neighbours,
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
    pub fn find(&self, key: BrickKey) -> Option<usize> {
        self.index.get(&key).map(|&i| i as usize)
    }

    /// Calls `f(slot in the brick, index among all active)` for the active slots of `brick`.
    #[inline]
    pub fn for_active(&self, brick: usize, mut f: impl FnMut(usize, usize)) {
        for (i, slot) in active_slots(&self.masks[brick]).enumerate() {
            f(slot, self.offsets[brick] + i);
        }
    }

    /// Adds a vector over active functions to the totals.
    pub fn add_active(&mut self, x: &[T]) {
        for (brick, totals) in self.totals.chunks_exact_mut(BRICK_LEN).enumerate() {
            for (slot, c) in active_slots(&self.masks[brick]).zip(&x[self.offsets[brick]..]) {
                totals[slot] += *c;
            }
        }
    }

    /// The 11³ coefficients that the cells of `brick` read, from an array of bricks; absent ones are 0.
    #[inline]
    pub fn halo(&self, values: &[T], brick: usize, out: &mut [T; HALO_LEN]) {
        for octant in 0..8usize {
            let d = [octant >> 2, octant >> 1 & 1, octant & 1];
            let count = d.map(|d| if d == 1 { HALO - BRICK } else { BRICK });
            let source = self.neighbours[brick][9 * (d[0] + 1) + 3 * (d[1] + 1) + d[2] + 1];
            for x in 0..count[0] {
                for y in 0..count[1] {
                    let to = ((x + BRICK * d[0]) * HALO + y + BRICK * d[1]) * HALO + BRICK * d[2];
                    let target = &mut out[to..to + count[2]];
                    if source == NONE {
                        target.fill(T::zero());
                    } else {
                        let from = source as usize * BRICK_LEN + (x * BRICK + y) * BRICK;
                        target.copy_from_slice(&values[from..from + count[2]]);
                    }
                }
            }
        }
    }

    /// Transpose of [`Band::halo`] for the whole band: each brick collects its own slots from its own halo
    /// and those of the bricks behind it, in a fixed order. `slot_of[b]` says which halo belongs to brick
    /// `b`, if any.
    pub fn collect_halos(&self, halos: &[T], slot_of: &[u32], brick: usize, out: &mut [T]) {
        out.fill(T::zero());
        for octant in 0..8usize {
            let d = [octant >> 2, octant >> 1 & 1, octant & 1];
            let source = self.neighbours[brick][9 * (1 - d[0]) + 3 * (1 - d[1]) + 1 - d[2]];
            if source == NONE || slot_of[source as usize] == NONE {
                continue;
            }
            let halo = &halos[slot_of[source as usize] as usize * HALO_LEN..][..HALO_LEN];
            let count = d.map(|d| if d == 1 { HALO - BRICK } else { BRICK });
            for x in 0..count[0] {
                for y in 0..count[1] {
                    let from = ((x + BRICK * d[0]) * HALO + y + BRICK * d[1]) * HALO + BRICK * d[2];
                    let to = (x * BRICK + y) * BRICK;
                    for z in 0..count[2] {
                        out[to + z] += halo[from + z];
                    }
                }
            }
        }
    }
}

/// Slots whose bit is set, in order.
#[inline]
pub(crate) fn active_slots(mask: &[u64; BRICK]) -> impl Iterator<Item = usize> {
    mask.iter().enumerate().flat_map(|(x, &word)| {
        let mut rest = word;
        std::iter::from_fn(move || {
            (rest != 0).then(|| {
                let bit = rest.trailing_zeros() as usize;
                rest &= rest - 1;
                64 * x + bit
            })
        })
    })
}

/// Number of different central functions of `cells`.
pub(crate) fn active_count(cells: &[[u32; 3]]) -> usize {
    let mut masks: FxHashMap<[u32; 3], [u64; BRICK]> = FxHashMap::default();
    for cell in cells {
        for corner in 0..8u32 {
            let s: [u32; 3] = std::array::from_fn(|a| cell[a] + 1 + (corner >> a & 1));
            let [x, y, z] = s.map(|s| s as usize % BRICK);
            masks.entry(s.map(|s| s / BRICK as u32)).or_default()[x] |= 1 << (BRICK * y + z);
        }
    }
    // A sum of whole numbers is the same in any order.
    masks.values().flatten().map(|w| w.count_ones() as usize).sum()
}

/// Keys of the bricks that hold a function within `reach` of a central function of a cell, in key order.
pub(crate) fn bricks_near(
    depth: usize,
    cells: &[[u32; 3]],
    reach: u32,
) -> (Vec<BrickKey>, FxHashMap<BrickKey, u32>) {
    // Cell c has central functions c and c+1, slots c+1 and c+2.
    let last = ((1u32 << depth) + 2) / BRICK as u32;
    let mut keys: Vec<BrickKey> = Vec::new();
    let mut previous = [[u32::MAX; 2]; 3];
    for cell in cells {
        let range: [[u32; 2]; 3] = std::array::from_fn(|a| {
            [
                (cell[a] + 1).saturating_sub(reach) / BRICK as u32,
                ((cell[a] + 2 + reach) / BRICK as u32).min(last),
            ]
        });
        if range == previous {
            continue;
        }
        previous = range;
        for x in range[0][0]..=range[0][1] {
            for y in range[1][0]..=range[1][1] {
                keys.extend((range[2][0]..=range[2][1]).map(|z| BrickKey([x, y, z])));
            }
        }
    }
    keys.sort_unstable();
    keys.dedup();
    let index = keys.iter().enumerate().map(|(i, k)| (*k, i as u32)).collect();
    (keys, index)
}

/// Totals of the bricks `keys` by the two-scale relation. A function whose parents are not in the coarser
/// band is of no use to this one and gets whatever zeros give.
fn prolonged<T: Real>(keys: &[BrickKey], coarser: &Coarser<'_, T>) -> Vec<T> {
    const SPAN: usize = BRICK / 2 + 2;
    let mut totals = vec![T::zero(); keys.len() * BRICK_LEN];
    let mut source = [T::zero(); SPAN * SPAN * SPAN];
    let mut work = [T::zero(); SPAN * SPAN * BRICK + SPAN * BRICK * BRICK];
    for (key, target) in keys.iter().zip(totals.chunks_exact_mut(BRICK_LEN)) {
        // Slots 8b .. 8b+7 have parents in slots 4b .. 4b+5.
        let first = key.0.map(|b| BRICK / 2 * b as usize);
        match coarser {
            Coarser::Full(grid) => {
                let m = grid.width();
                for x in 0..SPAN {
                    for y in 0..SPAN {
                        for z in 0..SPAN {
                            let s = [first[0] + x, first[1] + y, first[2] + z];
                            source[(x * SPAN + y) * SPAN + z] = if s.iter().all(|&s| s < m) {
                                T::from_f64(grid.values[(s[0] * m + s[1]) * m + s[2]])
                            } else {
                                T::zero()
                            };
                        }
                    }
                }
            }
            Coarser::Band(band) => gather_span(band, first, &mut source),
        }
        refine_block::<T, SPAN, BRICK>(&source, &mut work, target);
    }
    totals
}

/// The 6³ totals from slot `first` on, from up to eight bricks.
fn gather_span<T: Real>(band: &Band<T>, first: [usize; 3], source: &mut [T]) {
    const SPAN: usize = BRICK / 2 + 2;
    let own = band.find(BrickKey(first.map(|s| (s / BRICK) as u32)));
    let brick_at = |d: [usize; 3]| -> Option<usize> {
        match own {
            Some(b) => match band.neighbours[b][9 * (d[0] + 1) + 3 * (d[1] + 1) + d[2] + 1] {
                NONE => None,
                n => Some(n as usize),
            },
            None => band.find(BrickKey(std::array::from_fn(|a| {
                (first[a] / BRICK + d[a]) as u32
            }))),
        }
    };
    let mut bricks = [None; 8];
    for (octant, slot) in bricks.iter_mut().enumerate() {
        *slot = brick_at([octant >> 2, octant >> 1 & 1, octant & 1]);
    }
    for x in 0..SPAN {
        for y in 0..SPAN {
            for z in 0..SPAN {
                let s = [first[0] % BRICK + x, first[1] % BRICK + y, first[2] % BRICK + z];
                let octant = 4 * (s[0] / BRICK) + 2 * (s[1] / BRICK) + s[2] / BRICK;
                let at = ((s[0] % BRICK) * BRICK + s[1] % BRICK) * BRICK + s[2] % BRICK;
                source[(x * SPAN + y) * SPAN + z] =
                    bricks[octant].map_or(T::zero(), |b| band.totals[b * BRICK_LEN + at]);
            }
        }
    }
}
