//! Functions of a surface that is gone, taken out again: a field that is carved, or filled, also shrinks.

use bspline::hierarchical::{BRICK, BlockEdit, BrickKey, Change};
use bspline::{HierarchicalSpline, Real};

use super::region::Region;

/// Finest intervals about the new surface, and those that their functions reach, in which everything stays.
const KEPT: f64 = 5.0;

/// Edits that take functions finer than level `first` out of `field` where the surface of `old` passed and the one at
/// `iso` no longer does. `region` says which functions of a level may change; taken out change the field by no more than `density`.
///
/// The hulls of the coefficients decide, so no sign changes: what a level's functions weigh at a point is no more than the
/// largest of them there, and each is less than a half, a quarter, … of the way to the iso-value, from the finest on.
pub(super) fn dead_functions<'a, T: Real>(
    old: &HierarchicalSpline<T>,
    field: &HierarchicalSpline<T>,
    (iso, density): (f64, f64),
    first: usize,
    region: impl Fn(usize) -> Region<'a>,
) -> Vec<BlockEdit<T>> {
    let mut dead = Vec::new();
    let finest = old.level_count();
    for level in first + 1..finest {
        let region = region(level);
        let kept = KEPT * region.world_spacing(region.finest) * old.slope();
        let share = 0.5f64.powi((finest - level) as i32);
        for key in keys(&region) {
            let Some(functions) = old.brick(level, key).and_then(|b| b.corrections()) else {
                continue;
            };
            if functions.count() == 0 || clearance(old, level, key, iso).is_some() {
                continue;
            }
            let Some(clearance) = clearance(field, level, key, iso) else {
                continue;
            };
            let now = field.brick(level, key).and_then(|b| b.corrections());
            let values = now.map_or(&[][..], |c| c.values()).iter();
            let most = values.fold(0.0f64, |most, c| most.max(c.as_f64().abs()));
            if most < share * (clearance - kept).min(density) {
                dead.extend(deactivated(&region, key));
            }
        }
    }
    dead
}

/// Bricks of functions that may change.
fn keys(region: &Region) -> impl Iterator<Item = BrickKey> + use<> {
    let (lo, hi) = region.allowed();
    let is_empty = (0..3).any(|a| lo[a] > hi[a]);
    let range = move |a: usize| {
        let [first, last] = [lo[a], hi[a]].map(|knot| (knot + 1).max(0) as u32 / BRICK as u32);
        first..if is_empty { first } else { last + 1 }
    };
    range(0).flat_map(move |x| range(1).flat_map(move |y| range(2).map(move |z| BrickKey([x, y, z]))))
}

/// Distance of `field` from `iso` at least where the functions of a brick reach; none if it may be 0, or if that is
/// evaluated by coarser bricks.
fn clearance<T: Real>(field: &HierarchicalSpline<T>, level: usize, key: BrickKey, iso: f64) -> Option<f64> {
    let mut hull = [f64::INFINITY, f64::NEG_INFINITY];
    for octant in 0..8u32 {
        let back = [octant >> 2, octant >> 1 & 1, octant & 1];
        if (0..3).any(|a| key.0[a] < back[a]) {
            continue;
        }
        let key = BrickKey(std::array::from_fn(|a| key.0[a] - back[a]));
        if let Some(brick) = field.brick(level, key) {
            let [lo, hi] = brick.hull().map(|c| c.as_f64());
            hull = [hull[0].min(lo), hull[1].max(hi)];
        }
    }
    let clearance = (hull[0] - iso).max(iso - hull[1]);
    (clearance > 0.0 && hull[0] <= hull[1]).then_some(clearance)
}

/// Takes out the functions of a brick that may change.
fn deactivated<T: Real>(region: &Region, key: BrickKey) -> Option<BlockEdit<T>> {
    let (lo, hi) = region.allowed();
    // Function `k + 1` is centred on knot `k`.
    let first: [i64; 3] = std::array::from_fn(|a| (lo[a] + 1).max(i64::from(key.0[a]) * BRICK as i64));
    let last: [i64; 3] = std::array::from_fn(|a| (hi[a] + 1).min(i64::from(key.0[a]) * BRICK as i64 + 7));
    let is_any = (0..3).all(|a| first[a] <= last[a]);
    let are_free = is_any && region.are_free(first.map(|f| f - 1), last.map(|l| l - 1));
    are_free.then(|| BlockEdit {
        level: region.level,
        first: first.map(|f| f as u32),
        shape: std::array::from_fn(|a| (last[a] - first[a] + 1) as usize),
        change: Change::Deactivate,
    })
}
