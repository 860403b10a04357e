//! Sound intervals of the gradient over a box: differences of control coefficients.

use glam::DVec3;

use super::bounds::{Roots, corners, local_box, octants_met, own_part, shared};
use super::brick::{BRICK, HALO};
use super::node::Node;
use crate::restrict::{RestrictedAxis, slope_ranges};
use crate::{Aabb, Interval, Real, vectors};

/// Boxes up to this many cells on an axis are restricted; for larger ones the differences of the coefficients as they
/// are cost a tenth and say nearly as much.
const RESTRICTED: f64 = 4.0;

/// Interval of each component of the gradient over a world box.
pub(super) fn over_world_box<'a, T: Real>(
    roots: Roots<'a, impl Iterator<Item = &'a Node<T>>>,
    b: &Aabb,
) -> [Interval; 3] {
    let place = roots.place;
    let local = b.transformed(&place.local_from_world);
    if !(local.min.is_finite() && local.max.is_finite()) {
        return [Interval::EVERYTHING; 3];
    }
    let extent = place.max;
    let inside = Aabb {
        min: local.min.clamp(DVec3::ZERO, extent),
        max: local.max.clamp(DVec3::ZERO, extent),
    };
    let mut hull: Option<[Interval; 3]> = None;
    for node in roots.nodes {
        visit(node, &extent, &inside, &mut hull);
    }
    let slopes = hull.expect("a box has a part in some brick");
    let world = vectors::transformed(place.local_from_world.matrix3.transpose(), slopes);
    place.extend_slopes(world, &local, &inside)
}

/// Adds the slopes of a node over the part of `b` in it.
fn visit<T: Real>(node: &Node<T>, extent: &DVec3, b: &Aabb, hull: &mut Option<[Interval; 3]>) {
    let (corner, end) = corners(node, extent);
    let Some(part) = shared(b, corner, end) else {
        return;
    };
    let mut add = |part: &Aabb| {
        let slopes = of_part(node, part);
        *hull = Some(match *hull {
            Some(known) => std::array::from_fn(|a| known[a].hull(slopes[a])),
            None => slopes,
        });
    };
    if !node.has_children() {
        return add(&part);
    }
    let octants = || octants_met(node, extent, b);
    for octant in octants() {
        if let (None, Some(part)) = (node.child(octant), own_part(node, octant, extent, b)) {
            add(&part);
        }
    }
    for child in octants().filter_map(|octant| node.child(octant)) {
        visit(child, extent, b, hull);
    }
}

/// Slopes by lattice coordinates over a part of a brick.
fn of_part<T: Real>(brick: &Node<T>, part: &Aabb) -> [Interval; 3] {
    let within = local_box(brick, part);
    let scale = Interval::point(brick.scale());
    let is_small = within.iter().all(|[a, b]| b - a <= RESTRICTED);
    if !is_small {
        return differences(brick, &within).map(|s| s * scale);
    }
    let found = slope_ranges(brick.own_totals(), &within);
    let share = 64.0 * T::UNIT_ROUND_OFF + 7.0 * RestrictedAxis::<T>::axis_error();
    let rounding = share * found.largest.as_f64();
    found
        .ranges
        .map(|(lo, hi)| Interval::new(lo.as_f64(), hi.as_f64()).widened(rounding) * scale)
}

/// Least and largest difference of neighbouring coefficients among those that the cells of a box read: the derivative
/// by cells is a convex combination of them.
fn differences<T: Real>(brick: &Node<T>, within: &[[f64; 2]; 3]) -> [Interval; 3] {
    let [x, y, z] = within.map(|[a, b]| {
        let first = (a as usize).min(BRICK - 1);
        first..(b.ceil() as usize).max(first + 1) + 3
    });
    let (mut lo, mut hi) = ([T::infinity(); 3], [T::neg_infinity(); 3]);
    let mut largest = T::zero();
    let totals = brick.own_totals();
    let at = |i: usize, j: usize, k: usize| totals[(i * HALO + j) * HALO + k];
    for i in x.clone() {
        for j in y.clone() {
            for k in z.clone() {
                let c = at(i, j, k);
                largest = if c.abs() > largest { c.abs() } else { largest };
                let mut see = |axis: usize, next: T| {
                    let d = next - c;
                    lo[axis] = if d < lo[axis] { d } else { lo[axis] };
                    hi[axis] = if d > hi[axis] { d } else { hi[axis] };
                };
                if i + 1 < x.end {
                    see(0, at(i + 1, j, k));
                }
                if j + 1 < y.end {
                    see(1, at(i, j + 1, k));
                }
                if k + 1 < z.end {
                    see(2, at(i, j, k + 1));
                }
            }
        }
    }
    // The evaluation's rounding: 4 + 4 + 4 products and sums of weights that sum to 2 in magnitude, and their own.
    let rounding = 64.0 * T::UNIT_ROUND_OFF * largest.as_f64();
    std::array::from_fn(|a| Interval::new(lo[a].as_f64(), hi[a].as_f64()).widened(rounding))
}
