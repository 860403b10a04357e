//! A sound bound of the Hessian over a box: second differences of control coefficients.

use std::ops::Range;

use glam::{DMat3, DVec3};

use super::bounds::{corners, lanes, local_box, octants_met, onto_knots, own_part, shared};
use super::brick::{BRICK, HALO};
use super::node::Node;
use super::spline::HierarchicalSpline;
use crate::{Aabb, Real, vectorized};

/// Largest magnitudes of `xx, yy, zz, xy, xz, yz`, by lattice coordinates.
type Second = [f64; 6];

/// Bound of `‖∇²f‖` over a world box; infinite if the box leaves the lattice's own, where the gradient jumps.
pub(super) fn over_world_box<T: Real>(spline: &HierarchicalSpline<T>, b: &Aabb) -> f64 {
    let local = b.transformed(spline.lattice_from_world());
    if !(local.min.is_finite() && local.max.is_finite()) {
        return f64::INFINITY;
    }
    let extent = spline.lattice().extent();
    // Boxes that end at the lattice's own miss it by a rounding.
    let slack = 1e-9 * extent;
    if (local.min + slack).min_element() < 0.0 || !local.max.cmple(extent + slack).all() {
        return f64::INFINITY;
    }
    let inside = Aabb {
        min: local.min.clamp(DVec3::ZERO, extent),
        max: local.max.clamp(DVec3::ZERO, extent),
    };
    let (snapped, moved) = onto_knots(spline.level_count() - 1, &inside);
    let most = over_node(spline, &spline.root, &snapped);
    // Second derivatives are continuous and, cell by cell, linear along each axis: a move of `d` cells changes them by
    // at most `4d` of the largest second difference in reach; over a million times what `moved` can be.
    most * (1.0 + 1e-6 + 4.0 * moved)
}

/// Frobenius norm of `Mᵀ H M` for the largest that `H` can be.
fn in_world(m: DMat3, [xx, yy, zz, xy, xz, yz]: Second) -> f64 {
    let m = DMat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs());
    let h = DMat3::from_cols(
        DVec3::new(xx, xy, xz),
        DVec3::new(xy, yy, yz),
        DVec3::new(xz, yz, zz),
    );
    let world = m.transpose() * h * m;
    world.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Bound over the part of `b` in a node.
fn over_node<T: Real>(spline: &HierarchicalSpline<T>, node: &Node<T>, b: &Aabb) -> f64 {
    let (corner, end) = corners(node, &spline.lattice().extent());
    let Some(part) = shared(b, corner, end) else {
        return 0.0;
    };
    if part.min == corner && part.max == end {
        return *node.bend.get_or_init(|| over_parts(spline, node, &part));
    }
    over_parts(spline, node, &part)
}

fn over_parts<T: Real>(spline: &HierarchicalSpline<T>, node: &Node<T>, part: &Aabb) -> f64 {
    let own = |part: &Aabb| in_world(spline.lattice_from_world().matrix3, of_part(node, part));
    if !node.has_children() {
        return own(part);
    }
    let extent = spline.lattice().extent();
    let mut most = 0f64;
    for octant in octants_met(node, &extent, part) {
        if let Some(child) = node.child(octant) {
            most = most.max(over_node(spline, child, part));
        } else if let Some(part) = own_part(node, octant, &extent, part) {
            most = most.max(own(&part));
        }
    }
    most
}

/// Second derivatives are convex combinations of the second differences of the coefficients that the box reads.
fn of_part<T: Real>(brick: &Node<T>, part: &Aabb) -> Second {
    let [x, y, z] = local_box(brick, part).map(|[a, b]| {
        let first = (a as usize).min(BRICK - 1);
        first..(b.ceil() as usize).max(first + 1) + 3
    });
    let (found, largest) = vectorized(
        #[inline(always)]
        || {
            if z.len() <= 8 {
                second_differences::<T, 8>(brick, &x, &y, &z)
            } else {
                second_differences::<T, 16>(brick, &x, &y, &z)
            }
        },
    );
    // Rounding of the differences here and of the evaluation, whose weights sum to 4 in magnitude.
    let rounding = 128.0 * T::UNIT_ROUND_OFF * largest.as_f64();
    let scale = brick.scale().powi(2);
    found.map(|d| (d.as_f64() + rounding) * scale)
}

#[inline(always)]
fn minus<T: Real, const L: usize>(a: &[T; L], b: &[T; L]) -> [T; L] {
    std::array::from_fn(|k| a[k] - b[k])
}

#[inline(always)]
fn raise<T: Real, const L: usize>(most: &mut [T; L], by: &[T; L]) {
    for k in 0..L {
        let d = by[k].abs();
        most[k] = if d > most[k] { d } else { most[k] };
    }
}

/// Largest second differences, and the largest coefficient, among those of the ranges, `z` no longer than `L`.
///
/// A lane for each coefficient along `z`. What the lanes beyond the range find nobody looks at.
#[inline(always)]
fn second_differences<T: Real, const L: usize>(
    brick: &Node<T>,
    x: &Range<usize>,
    y: &Range<usize>,
    z: &Range<usize>,
) -> ([T; 6], T) {
    let zero = [T::zero(); L];
    let [mut xx, mut yy, mut zz, mut xy, mut xz, mut yz, mut largest] = [zero; 7];
    for j in y.clone() {
        let mut last_rise = zero;
        for i in x.clone() {
            let at = |i: usize, j: usize, k: usize| {
                lanes::<T, L>(brick.own_totals(), (i * HALO + j) * HALO + z.start + k)
            };
            let (own, up) = (at(i, j, 0), at(i, j, 1));
            let along = minus(&up, &own);
            raise(&mut largest, &own);
            raise(&mut zz, &minus(&minus(&at(i, j, 2), &up), &along));
            let ahead = (i + 1 < x.end).then(|| at(i + 1, j, 0));
            if let Some(ahead) = &ahead {
                let rise = minus(ahead, &own);
                if i > x.start {
                    raise(&mut xx, &minus(&rise, &last_rise));
                }
                raise(&mut xz, &minus(&minus(&at(i + 1, j, 1), ahead), &along));
                last_rise = rise;
            }
            if j + 1 < y.end {
                let beside = at(i, j + 1, 0);
                let rise = minus(&beside, &own);
                if j > y.start {
                    raise(&mut yy, &minus(&rise, &minus(&own, &at(i, j - 1, 0))));
                }
                raise(&mut yz, &minus(&minus(&at(i, j + 1, 1), &beside), &along));
                if let Some(ahead) = &ahead {
                    raise(&mut xy, &minus(&minus(&at(i + 1, j + 1, 0), ahead), &rise));
                }
            }
        }
    }
    let most = |lanes: &[T; L], short: usize| {
        let lanes = &lanes[..z.len() - short];
        lanes.iter().fold(T::zero(), |m, d| if *d > m { *d } else { m })
    };
    (
        [
            most(&xx, 0),
            most(&yy, 0),
            most(&zz, 2),
            most(&xy, 0),
            most(&xz, 1),
            most(&yz, 1),
        ],
        most(&largest, 0),
    )
}
