//! A level's totals from those of the level above it.

use bspline::Real;
use bspline::hierarchical::refine_block;

use super::band::{BRICK, BRICK_LEN, Band, Coarser, Key, NONE};

/// Totals of the bricks `keys` by the two-scale relation. A function whose parents are not in the coarser
/// band is of no use to this one and gets whatever zeros give.
pub(super) fn prolonged<T: Real>(keys: &[Key], coarser: &Coarser<'_, T>) -> Vec<T> {
    const SPAN: usize = BRICK / 2 + 2;
    let mut totals = vec![T::zero(); keys.len() * BRICK_LEN];
    let mut source = [T::zero(); SPAN * SPAN * SPAN];
    let mut work = [T::zero(); SPAN * SPAN * BRICK + SPAN * BRICK * BRICK];
    for (key, target) in keys.iter().zip(totals.chunks_exact_mut(BRICK_LEN)) {
        // Slots 4b .. 4b+3 have parents in slots 2b .. 2b+3.
        let first = key.map(|b| BRICK / 2 * b as usize);
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

/// The 4³ totals from slot `first` on, from up to eight bricks.
fn gather_span<T: Real>(band: &Band<T>, first: [usize; 3], source: &mut [T]) {
    const SPAN: usize = BRICK / 2 + 2;
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
