//! What functions leave where they stop taking part, on the finest level.

use bspline::Real;

use super::level::{LevelFit, QUASI, SAMPLES};
use super::masks::{Mask, Rows, between, is_none};
use super::room::Room;
use super::tiles::{Tiles, Values};

/// How often more functions take part in what is left where they stop. A third time would look beyond the tiles beside a slab.
const ROUNDS: usize = 2;

impl<T: Real> LevelFit<'_, T> {
    /// Where functions stop taking part, those that do may leave more than is allowed, and no finer level makes up for it: there more
    /// take part, up to two knots further, and what is `left` goes into all that do.
    pub fn refine(
        &self,
        tiles: &Tiles,
        rest: &[Values],
        (spread, takes_part): (&mut [Mask], &mut Vec<Mask>),
        coefficients: &mut Room,
        left: &mut Room,
    ) {
        let (first, last) = self.region.sampled();
        let rows = |i: usize| Rows::of(&between(tiles.keys[i], first, last));
        for _ in 0..ROUNDS {
            tiles.change(coefficients, |i, values| cut(&takes_part[i], values));
            tiles.change(left, |i, out| {
                out.copy_from_slice(&rest[i]);
                if tiles.is_any_near(i, takes_part) {
                    tiles.convolved(i, &rows(i), coefficients, SAMPLES, out, |to, _, value| {
                        *to -= value
                    });
                }
            });
            let (judge, (lo, hi)) = (self.judge(), self.region.judged());
            let over = tiles.map(|i| judge.over(&between(tiles.keys[i], lo, hi), &left[i]));
            for (i, spread) in spread.iter_mut().enumerate() {
                let more = tiles.spread(i, &over, 1);
                *spread = std::array::from_fn(|x| spread[x] | more[x]);
            }
            *takes_part = self.taking_part(tiles, spread);
            tiles.change(coefficients, |i, out| {
                if !is_none(&takes_part[i]) {
                    let rows = Rows::of(&takes_part[i]);
                    tiles.convolved(i, &rows, left, QUASI, out, |to, _, value| *to += value);
                }
            });
        }
    }
}

/// Zeros beside the places of a mask.
fn cut(mask: &Mask, values: &mut Values) {
    for (place, value) in values.iter_mut().enumerate() {
        if mask[place / 64] >> (place % 64) & 1 == 0 {
            *value = 0.0;
        }
    }
}
