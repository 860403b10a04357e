//! Nodes between which the surface passes.

use glam::DVec3;

use super::grid::Grid;
use super::samples::Samples;

/// Whether all nodes of a row and of the rows next to it are on one side.
pub fn is_alike(grid: &Grid, samples: &Samples, at: [usize; 3], slots: std::ops::Range<usize>) -> bool {
    // Also of those before and behind it.
    let from = slots.start - usize::from(at[2] > 0);
    let to = slots.end + usize::from(at[2] + slots.len() < grid.count[2]);
    let inside = &samples.inside;
    let own = &inside[from..to];
    let strides = grid.strides();
    let is_same = |from: usize, to: usize| inside[from..to] == *own;
    own.iter().all(|s| *s == own[0])
        && (0..2).all(|a| {
            (at[a] == 0 || is_same(from - strides[a], to - strides[a]))
                && (at[a] + 1 == grid.count[a] || is_same(from + strides[a], to + strides[a]))
        })
}

/// Where the surface is met, about, on the way to the neighbour that it is nearest on, and that neighbour; none if all neighbours
/// are on the same side.
pub fn crossing(grid: &Grid, samples: &Samples, at: [usize; 3], slot: usize) -> Option<[DVec3; 2]> {
    let strides = grid.strides();
    let Samples { values, inside } = samples;
    let mut best: Option<(f64, usize, f64)> = None;
    for axis in 0..3 {
        for (sign, is_there) in [(-1.0, at[axis] > 0), (1.0, at[axis] + 1 < grid.count[axis])] {
            if !is_there {
                continue;
            }
            let other = slot.wrapping_add_signed(sign as isize * strides[axis] as isize);
            if inside[other] == inside[slot] {
                continue;
            }
            let share = f64::from(values[slot] / (values[slot] - values[other]));
            // Where a block beside is known only as a whole.
            let share = if share.is_finite() {
                share.clamp(0.0, 1.0)
            } else {
                0.5
            };
            if best.is_none_or(|(least, ..)| share < least) {
                best = Some((share, axis, sign));
            }
        }
    }
    best.map(|(share, axis, sign)| {
        let [mut place, mut other] = [grid.place(at); 2];
        place[axis] += sign * share * grid.spacing;
        other[axis] += sign * grid.spacing;
        [place, other]
    })
}
