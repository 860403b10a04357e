//! Cells near the surface that an extremum may lie in: every small closed piece of the surface goes round one.

use bspline::{Jet, Real};
use glam::{DMat3, DVec3};
use rayon::prelude::*;

use crate::level::BASE_DEPTH;
use crate::level::band::{BRICK, Band, HALO, HALO_LEN, Key, active_slots, key_of, slot_of};
use crate::level::full_grid::FullGrid;

/// Distance from the surface, in cells, within which an extremum is looked for; larger pieces are seen by the grid over the
/// whole box.
const REACH: f64 = 2.0;
/// Slope, and distance from the surface in cells, up to which steps are tried although the field bends the other way.
const GENTLE: f64 = 0.5;
/// Depth in cells beyond zero that the parabola at the middle of a cell may be wrong by.
const SLACK: f64 = 0.1;
/// Way from the middle of a cell, in cells on an axis, after which another is closer.
pub(crate) const FARTHEST: f64 = 1.5;
/// Values and first and second derivatives of the four functions of an axis in the middle of a cell.
const MIDDLE: [[f64; 4]; 3] = [
    [1.0 / 48.0, 23.0 / 48.0, 23.0 / 48.0, 1.0 / 48.0],
    [-0.125, -0.625, 0.625, 0.125],
    [0.5, -0.5, -0.5, 0.5],
];
/// Strides of a brick with halo.
const STRIDES: [usize; 3] = [HALO * HALO, HALO, 1];

/// A cell in which the gradient may vanish near the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct StillCell {
    pub depth: usize,
    pub at: [u32; 3],
    /// Whether the way from its middle may lead to a maximum of `f` above zero, and to a minimum below.
    pub leads_up: bool,
    pub leads_down: bool,
}

impl StillCell {
    /// A cell whose ways are not known.
    pub fn unsure(depth: usize, at: [u32; 3]) -> Self {
        Self {
            depth,
            at,
            leads_up: true,
            leads_down: true,
        }
    }

    /// Whether there is a way.
    pub fn leads(&self) -> bool {
        self.leads_up || self.leads_down
    }
}

/// Still cells of the full level.
pub(crate) fn still_cells_of_base(base: &FullGrid<f64>) -> Vec<StillCell> {
    let m = base.width();
    let bricks = base.n / BRICK;
    let mut found = Vec::new();
    for brick in 0..bricks.pow(3) {
        let key = [brick / bricks / bricks, brick / bricks % bricks, brick % bricks];
        let halo: [f64; HALO_LEN] = std::array::from_fn(|i| {
            let s = [i / HALO / HALO, i / HALO % HALO, i % HALO];
            let [x, y, z] = [0, 1, 2].map(|a| key[a] * BRICK + s[a]);
            base.values[(x * m + y) * m + z]
        });
        still_cells_of_brick(&halo, !0, key.map(|k| k as u32), BASE_DEPTH, &mut found);
    }
    found
}

/// Replaces the cells of the level above `band` that it refines by the still ones of its own.
///
/// Of the band's cells it takes those of which one of the eight central functions is active: all that these read is in the
/// band. Cells of the level above beside them, that a function of the band still reaches, are unsure. Other cells from which no
/// way leads are dropped.
pub(crate) fn replace_refined<T: Real>(still: &mut Vec<StillCell>, band: &Band<T>) {
    let inner: Vec<u64> = (0..band.keys.len())
        .map(|brick| band.inner_cells(brick))
        .collect();
    still.retain_mut(|cell| {
        if cell.depth + 1 < band.depth {
            return true;
        }
        let (mut all_inner, mut any_touched) = (true, false);
        for corner in 0..8u32 {
            let child = std::array::from_fn(|a| 2 * cell.at[a] + (corner >> a & 1));
            let brick = band.find(key_of(child));
            all_inner &= brick.is_some_and(|brick| inner[brick] >> slot_of(child) & 1 == 1);
            any_touched |= brick.is_some_and(|brick| band.is_touched(brick, child));
        }
        if any_touched {
            *cell = StillCell::unsure(cell.depth, cell.at);
        }
        cell.leads() && !all_inner
    });
    let bricks = (0..band.keys.len()).into_par_iter().with_min_len(256);
    still.par_extend(bricks.flat_map_iter(|brick| {
        let mut found = Vec::new();
        if inner[brick] != 0 {
            let mut halo = [T::zero(); HALO_LEN];
            band.halo(&band.totals, brick, &mut halo);
            still_cells_of_brick(&halo, inner[brick], band.keys[brick], band.depth, &mut found);
        }
        found
    }));
}

/// Adds those of the cells `asked` of a brick, one bit each, in which the gradient may vanish where `|f|` is below `REACH`
/// cells.
fn still_cells_of_brick<T: Real>(
    halo: &[T; HALO_LEN],
    asked: u64,
    key: Key,
    depth: usize,
    found: &mut Vec<StillCell>,
) {
    let h = 0.5f64.powi(depth as i32);
    for slot in active_slots(asked) {
        let within = [slot / BRICK / BRICK, slot / BRICK % BRICK, slot % BRICK];
        let read = &halo[(0..3).map(|a| within[a] * STRIDES[a]).sum()..];
        if !is_still(read, T::from_f64(REACH * h)) {
            continue;
        }
        let at: [u32; 3] = std::array::from_fn(|a| key[a] * BRICK as u32 + within[a] as u32);
        if at.iter().all(|c| c >> depth == 0) {
            let jet = in_the_middle(read, h);
            found.push(StillCell {
                depth,
                at,
                leads_up: may_lead_to_peak(&jet, 1.0),
                leads_down: may_lead_to_peak(&jet, -1.0),
            });
        }
    }
}

/// The field in the middle of the cell that reads the 4³ coefficients from the first of `halo` on; lengths and values in cells
/// of width `h`.
fn in_the_middle<T: Real>(halo: &[T], h: f64) -> Jet {
    // By derivatives along x, y and z.
    let mut all = [[[0.0; 3]; 3]; 3];
    for x in 0..4 {
        let mut plane = [[0.0; 3]; 3];
        for y in 0..4 {
            let row: [f64; 4] = std::array::from_fn(|z| halo[x * STRIDES[0] + y * STRIDES[1] + z].as_f64());
            for c in 0..3 {
                let along: f64 = (0..4).map(|z| MIDDLE[c][z] * row[z]).sum();
                for b in 0..3 - c {
                    plane[b][c] += MIDDLE[b][y] * along;
                }
            }
        }
        for b in 0..3 {
            for c in 0..3 - b {
                for a in 0..3 - b - c {
                    all[a][b][c] += MIDDLE[a][x] * plane[b][c];
                }
            }
        }
    }
    let [xy, xz, yz] = [all[1][1][0], all[1][0][1], all[0][1][1]];
    Jet {
        value: all[0][0][0] / h,
        gradient: DVec3::new(all[1][0][0], all[0][1][0], all[0][0][1]) / h,
        hessian: DMat3::from_cols(
            DVec3::new(all[2][0][0], xy, xz),
            DVec3::new(xy, all[0][2][0], yz),
            DVec3::new(xz, yz, all[0][0][2]),
        ) * (1.0 / h),
    }
}

/// Whether a maximum of `sign · f` above zero may lie within reach of where `jet` was taken, by the parabola there; in cells.
pub(crate) fn may_lead_to_peak(jet: &Jet, sign: f64) -> bool {
    let Some(step) = to_maximum(jet, sign) else {
        let slope = jet.gradient.length();
        return slope < GENTLE && jet.value.abs() < GENTLE && sign * jet.value > -slope;
    };
    // Twice what the parabola rises.
    let height = sign * (jet.value + jet.gradient.dot(step));
    step.abs().max_element() < FARTHEST && height > -SLACK
}

/// Newton's step to the maximum of `sign · f`, if the field bends that way.
pub(crate) fn to_maximum(jet: &Jet, sign: f64) -> Option<DVec3> {
    let bend = -sign * jet.hessian;
    let is_peaked = bend.x_axis.x > 0.0
        && bend.x_axis.x * bend.y_axis.y > bend.x_axis.y * bend.x_axis.y
        && bend.determinant() > 0.0;
    let step = is_peaked.then(|| bend.inverse() * (sign * jet.gradient));
    step.filter(|s| s.is_finite())
}

/// Whether each slope may vanish in the cell that reads the 4³ coefficients from the first of `halo` on, and `|f|` be below
/// `reach`: they are convex combinations of the differences of the coefficients, and of these.
fn is_still<T: Real>(halo: &[T], reach: T) -> bool {
    // The steepest way from the middle first: it says no to most cells.
    let middle = STRIDES.iter().sum::<usize>();
    let slope = STRIDES.map(|stride| (halo[middle + stride] - halo[middle]).abs());
    let first = if slope[0] >= slope[1] && slope[0] >= slope[2] {
        0
    } else if slope[1] >= slope[2] {
        1
    } else {
        2
    };
    for axis in [first, (first + 1) % 3, (first + 2) % 3] {
        let [lo, hi] = match axis {
            0 => slopes::<T, 3, 4, 4, { STRIDES[0] }>(halo),
            1 => slopes::<T, 4, 3, 4, { STRIDES[1] }>(halo),
            _ => slopes::<T, 4, 4, 3, { STRIDES[2] }>(halo),
        };
        if lo > T::zero() || hi < T::zero() {
            return false;
        }
    }
    let [lo, hi] = range::<T, 4, 4, 4>(|i| halo[i]);
    lo <= reach && hi >= -reach
}

/// Range of the differences along the axis of `STRIDE`, at the first of the two.
#[inline(always)]
fn slopes<T: Real, const X: usize, const Y: usize, const Z: usize, const STRIDE: usize>(
    halo: &[T],
) -> [T; 2] {
    range::<T, X, Y, Z>(|i| halo[i + STRIDE] - halo[i])
}

/// Least and largest over a block of a brick with halo.
#[inline(always)]
fn range<T: Real, const X: usize, const Y: usize, const Z: usize>(f: impl Fn(usize) -> T) -> [T; 2] {
    let (mut lo, mut hi) = ([T::infinity(); Z], [T::neg_infinity(); Z]);
    for x in 0..X {
        for y in 0..Y {
            for z in 0..Z {
                let v = f(x * STRIDES[0] + y * STRIDES[1] + z);
                // Comparisons as written here turn into vector instructions; `Float::min` does not.
                lo[z] = if v < lo[z] { v } else { lo[z] };
                hi[z] = if v > hi[z] { v } else { hi[z] };
            }
        }
    }
    (1..Z).fold([lo[0], hi[0]], |[l, h], z| {
        [
            if lo[z] < l { lo[z] } else { l },
            if hi[z] > h { hi[z] } else { h },
        ]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The distance to a slanted plane, three cells below zero in the middle of the box, with a drop there.
    fn plane_with(drop: f64) -> FullGrid<f64> {
        let mut base = FullGrid::zeros(1 << BASE_DEPTH);
        let (m, h) = (base.width(), 1.0 / (1 << BASE_DEPTH) as f64);
        for (i, value) in base.values.iter_mut().enumerate() {
            let [x, y, z] = [i / m / m, i / m % m, i % m].map(|s| s as f64 - 17.0);
            let d = DVec3::new(x, y, z);
            let bump = 5.0 * libm::exp(-0.3 * d.length_squared());
            *value = h * (d.dot(DVec3::new(0.36, 0.48, 0.8)) - 3.0 + drop * bump);
        }
        base
    }

    #[test]
    fn a_drop_is_told_by_its_cell_and_a_plane_has_none() {
        assert_eq!(still_cells_of_base(&plane_with(0.0)), []);
        let mut found = still_cells_of_base(&plane_with(1.0));
        found.retain(StillCell::leads);
        assert!(!found.is_empty());
        for cell in &found {
            let off = cell.at.map(|c| (f64::from(c) - 15.5).abs());
            assert!(off.iter().all(|d| *d <= 4.0), "{cell:?}");
        }
        assert!(
            found
                .iter()
                .any(|c| c.leads_up && c.at.iter().all(|x| (15..=17).contains(x))),
            "{found:?}"
        );
    }
}
