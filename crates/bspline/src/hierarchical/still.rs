//! Cells near the surface where the gradient may vanish: every small closed piece of it lies round an extremum.

use rayon::prelude::*;

use super::brick::{BRICK, Brick, HALO, HALO_LEN, NONE};
use super::spline::HierarchicalSpline;
use crate::{Real, vectorized};

/// Cells of an octant on an axis, and the coefficients that they read.
const CELLS: usize = BRICK / 2;
const READ: usize = CELLS + 3;
/// Lanes of a row: what it reads, and one that nobody looks at.
const LANES: usize = READ + 1;
/// Coefficients of an octant, or their differences: row `7x + y`, lane `z`.
type Block<T> = [[T; LANES]; READ * READ];

impl<T: Real> HierarchicalSpline<T> {
    /// Cells, each as its level and its place on it, that hold every point where the gradient vanishes and `f` is within
    /// `reach` of `iso`; `reach` in knot spacings of the level that evaluates there, times the [`slope`](Self::slope).
    ///
    /// Sound, and few where the surface is smooth: values and derivatives are convex combinations of the coefficients
    /// that a cell reads and of their differences. In the order of levels and bricks. Costs a few passes over the
    /// bricks that the surface comes near.
    pub fn still_cells(&self, iso: f64, reach: f64) -> Vec<(usize, [u32; 3])> {
        let mut found = Vec::new();
        for (level, bricks) in self.levels.iter().enumerate() {
            let reach = reach * self.lattice().spacing(level).min_element() * self.slope();
            let band = [iso - reach, iso + reach].map(T::from_f64);
            let limit = self.lattice().cells_at(level);
            found.par_extend(bricks.par_iter().with_min_len(64).flat_map_iter(|brick| {
                let mut cells = Vec::new();
                if brick.hull[0] <= band[1] && brick.hull[1] >= band[0] {
                    for octant in (0..8usize).filter(|&o| brick.children[o] == NONE) {
                        let first = [octant >> 2, octant >> 1 & 1, octant & 1].map(|o| o * CELLS);
                        let may_be = vectorized(
                            #[inline(always)]
                            || still_in(brick, first, band),
                        );
                        for i in (0..CELLS.pow(3)).filter(|i| may_be[i / CELLS][i % CELLS]) {
                            let at = [i / CELLS / CELLS, i / CELLS % CELLS, i % CELLS];
                            cells.push(std::array::from_fn(|a| {
                                brick.key.0[a] * BRICK as u32 + (first[a] + at[a]) as u32
                            }));
                        }
                    }
                }
                cells.retain(|cell: &[u32; 3]| (0..3).all(|a| cell[a] < limit[a]));
                cells.into_iter().map(move |cell| (level, cell))
            }));
        }
        found
    }
}

/// For row `4x + y` and cell `z` of the octant that begins at cell `first`: whether it may reach the band without a slope.
#[inline(always)]
fn still_in<T: Real>(brick: &Brick<T>, first: [usize; 3], band: [T; 2]) -> [[bool; CELLS]; CELLS * CELLS] {
    let mut may_be = [[false; CELLS]; CELLS * CELLS];
    let values = block(&brick.totals, first);
    let [lo, hi] = extremes(&values, [READ; 3]);
    // The evaluation's rounding, as for the bounds of the gradient.
    let rounding = T::from_f64(64.0 * T::UNIT_ROUND_OFF) * if -lo > hi { -lo } else { hi };
    let band = [band[0] - rounding, band[1] + rounding];
    let slopes = [0, 1, 2].map(|axis| differences(&values, axis));
    let counts = [0, 1, 2].map(|axis| [0, 1, 2].map(|a| READ - usize::from(a == axis)));
    let overlaps = |[lo, hi]: [T; 2], [from, to]: [T; 2]| lo <= to && hi >= from;
    if !overlaps([lo, hi], band)
        || !(0..3).all(|a| overlaps(extremes(&slopes[a], counts[a]), [-rounding, rounding]))
    {
        return may_be;
    }
    may_be = [[true; CELLS]; CELLS * CELLS];
    let mut keep = |of: &Block<T>, windows: [usize; 3], [from, to]: [T; 2]| {
        let [lo, hi] = hulls(of, windows);
        for (row, may) in may_be.iter_mut().enumerate() {
            let at = row / CELLS * READ + row % CELLS;
            for z in 0..CELLS {
                may[z] &= lo[at][z] <= to && hi[at][z] >= from;
            }
        }
    };
    for axis in 0..3 {
        let windows = [0, 1, 2].map(|a| 4 - usize::from(a == axis));
        keep(&slopes[axis], windows, [-rounding, rounding]);
    }
    keep(&values, [4; 3], band);
    may_be
}

#[inline(always)]
fn block<T: Real>(totals: &[T; HALO_LEN], first: [usize; 3]) -> Block<T> {
    let mut out = [[T::zero(); LANES]; READ * READ];
    for (i, row) in out.iter_mut().enumerate() {
        let start = ((first[0] + i / READ) * HALO + first[1] + i % READ) * HALO + first[2];
        row[..READ].copy_from_slice(&totals[start..start + READ]);
    }
    out
}

/// Differences of neighbours along an axis, at the first of the two.
#[inline(always)]
fn differences<T: Real>(of: &Block<T>, axis: usize) -> Block<T> {
    let mut out = [[T::zero(); LANES]; READ * READ];
    for (i, row) in out.iter_mut().enumerate() {
        let ahead = match axis {
            0 => of.get(i + READ),
            1 => of.get(i + 1),
            _ => Some(&of[i]),
        };
        let Some(ahead) = ahead else { continue };
        let shift = usize::from(axis == 2);
        for z in 0..LANES - shift {
            row[z] = ahead[z + shift] - of[i][z];
        }
    }
    out
}

/// Least and largest of the first `counts` on each axis.
#[inline(always)]
fn extremes<T: Real>(of: &Block<T>, counts: [usize; 3]) -> [T; 2] {
    let (mut lo, mut hi) = ([T::infinity(); LANES], [T::neg_infinity(); LANES]);
    for i in 0..counts[0] {
        for j in 0..counts[1] {
            lower(&mut lo, &of[i * READ + j]);
            raise(&mut hi, &of[i * READ + j]);
        }
    }
    (0..counts[2]).fold([lo[0], hi[0]], |[l, h], z| {
        [
            if lo[z] < l { lo[z] } else { l },
            if hi[z] > h { hi[z] } else { h },
        ]
    })
}

/// Least and largest over windows that begin at each cell, axis by axis.
#[inline(always)]
fn hulls<T: Real>(of: &Block<T>, windows: [usize; 3]) -> [Block<T>; 2] {
    let (mut lo, mut hi) = (*of, *of);
    for (axis, ends) in [[CELLS, READ], [CELLS, CELLS]].into_iter().enumerate() {
        let stride = if axis == 0 { READ } else { 1 };
        for i in 0..ends[0] {
            for j in 0..ends[1] {
                let at = i * READ + j;
                for w in 1..windows[axis] {
                    // Rows ahead are still as they were.
                    let (l, h) = (lo[at + w * stride], hi[at + w * stride]);
                    lower(&mut lo[at], &l);
                    raise(&mut hi[at], &h);
                }
            }
        }
    }
    for i in 0..CELLS {
        for j in 0..CELLS {
            let at = i * READ + j;
            let (l, h) = (lo[at], hi[at]);
            for w in 1..windows[2] {
                for z in 0..CELLS {
                    lo[at][z] = if l[z + w] < lo[at][z] { l[z + w] } else { lo[at][z] };
                    hi[at][z] = if h[z + w] > hi[at][z] { h[z + w] } else { hi[at][z] };
                }
            }
        }
    }
    [lo, hi]
}

#[inline(always)]
fn lower<T: Real>(to: &mut [T; LANES], by: &[T; LANES]) {
    for z in 0..LANES {
        to[z] = if by[z] < to[z] { by[z] } else { to[z] };
    }
}

#[inline(always)]
fn raise<T: Real>(to: &mut [T; LANES], by: &[T; LANES]) {
    for z in 0..LANES {
        to[z] = if by[z] > to[z] { by[z] } else { to[z] };
    }
}
