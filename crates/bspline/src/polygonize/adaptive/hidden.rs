//! Pieces of the surface that touch no corner of a cell.

use glam::{DVec3, Vec3};

use super::sample::Judge;

/// Whether a cell whose corners `v` lie on one side may hold a largest or least value on the other, if `‖∇²f‖ <= bend`.
///
/// Between the corners the field differs by `(|f_xx| + |f_yy| + |f_zz|) h²/8 <= √3 bend h²/8` at most from the function
/// that is linear along each axis, which keeps to one side. And the gradient, which vanishes at such a value, differs
/// by `1.1 bend h` at most from the mean slope of the edges along each axis: no point is farther from those on average.
/// And the field rises from there to a corner `d` away by `bend d²/2` at most.
pub(super) fn may_peak(v: &[f32; 8], bend: f64, size: DVec3) -> bool {
    let h = size.max_element();
    let least = v.iter().fold(f32::INFINITY, |m, v| m.min(v.abs()));
    if f64::from(least) > 0.2166 * bend * h * h {
        return false;
    }
    let is_steep = f64::from(slopes(v, size.as_vec3()).abs().max_element()) > 1.1 * bend * h;
    // Not where one of them is not a number.
    !is_steep && (0..8).any(|eighth| may_peak_in(eighth, v, bend, size))
}

/// Whether none of the corners `v` lies higher than a peak in that eighth of the cell allows.
fn may_peak_in(eighth: usize, v: &[f32; 8], bend: f64, size: DVec3) -> bool {
    let square = size * size;
    !(0..8).any(|corner: usize| {
        let far = corner ^ eighth;
        let share = |bit: usize| if far & bit == 0 { 0.25 } else { 1.0 };
        let reach = share(4) * square.x + share(2) * square.y + share(1) * square.z;
        f64::from(v[corner].abs()) > 0.5 * bend * reach
    })
}

/// How often a cell is halved to see whether a piece of the surface hides in it.
pub(super) const SEARCH: usize = 3;

/// Whether a piece of the surface may lie in a cell without touching its corners, which are on the side `inside`.
///
/// A closed piece has a largest or a least value within, where the gradient vanishes.
pub(super) fn may_hide(judge: &Judge, level: usize, cell: [i32; 3], inside: bool, search: usize) -> bool {
    let bounds = judge.bounds(level, cell, 1);
    if bounds.hi <= judge.iso || bounds.lo > judge.iso {
        return (bounds.lo > judge.iso) != inside;
    }
    let around = judge.grids.world_box(level, cell, 1);
    let reach = 0.5 * around.size().length();
    let (value, slope) = judge.field.value_gradient(around.center());
    if (value > judge.iso) != inside {
        return true;
    }
    let bend = judge.field.hessian_bound(&around);
    let (steepness, height) = (slope.length(), (value - judge.iso).abs());
    // Neither a vanishing gradient nor the surface is within reach.
    if steepness > bend * reach || height > (steepness + 0.5 * bend * reach) * reach {
        return false;
    }
    if search > 0 && level < judge.grids.depth() {
        return (0..8).any(|o| {
            let child = std::array::from_fn(|a| 2 * cell[a] + (o >> a & 1));
            may_hide(judge, level + 1, child, inside, search - 1)
        });
    }
    let slopes = judge.field.gradient_bounds(&around);
    slopes.iter().all(|g| !(g.lo > 0.0 || g.hi < 0.0))
}

/// Mean slopes of a cell's edges along each axis.
pub(super) fn slopes(v: &[f32; 8], size: Vec3) -> Vec3 {
    0.25 * Vec3::new(
        v[4] - v[0] + v[5] - v[1] + v[6] - v[2] + v[7] - v[3],
        v[2] - v[0] + v[3] - v[1] + v[6] - v[4] + v[7] - v[5],
        v[1] - v[0] + v[3] - v[2] + v[5] - v[4] + v[7] - v[6],
    ) / size
}
