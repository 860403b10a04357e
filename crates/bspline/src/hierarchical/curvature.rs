//! A sound bound of the Hessian over a box: second differences of control coefficients.

use glam::{DMat3, DVec3};

use super::bounds::{local_box, onto_knots, shared};
use super::brick::{BRICK, Brick, HALO, NONE};
use super::spline::HierarchicalSpline;
use crate::{Aabb, Real};

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
    let (snapped, moved) = onto_knots(spline, &inside);
    let counts = spline.lattice().cells.map(|n| n.div_ceil(BRICK as u32));
    let range = |a: usize| {
        let brick = |q: f64| (q as u32 / BRICK as u32).min(counts[a] - 1);
        brick(snapped.min[a])..=brick(snapped.max[a])
    };
    let mut most = [0.0; 6];
    for x in range(0) {
        for y in range(1) {
            for z in range(2) {
                let root = ((x * counts[1] + y) * counts[2] + z) as usize;
                visit(spline, 0, root, &snapped, &mut most);
            }
        }
    }
    // Second derivatives are continuous and, cell by cell, linear along each axis: a move of `d` cells changes them by
    // at most `4d` of the largest second difference in reach; over a million times what `moved` can be.
    in_world(spline.lattice_from_world().matrix3, most) * (1.0 + 1e-6 + 4.0 * moved)
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

/// Adds the second derivatives of brick `index` of `level` over the part of `b` in it.
fn visit<T: Real>(spline: &HierarchicalSpline<T>, level: usize, index: usize, b: &Aabb, most: &mut Second) {
    let brick = &spline.levels[level][index];
    let width = BRICK as f64 / (1u64 << level) as f64;
    let corner = DVec3::from_array(brick.key.0.map(|k| k as f64 * width));
    let end = (corner + width).min(spline.lattice().extent());
    let Some(part) = shared(b, corner, end) else {
        return;
    };
    if !brick.has_children() {
        return add_part(brick, level, &part, most);
    }
    for octant in 0..8usize {
        match brick.children[octant] {
            NONE => {
                let half = |a: usize| (octant >> (2 - a) & 1) as f64 * width / 2.0;
                let low = corner + DVec3::from_array(std::array::from_fn(half));
                if let Some(part) = shared(b, low, (low + width / 2.0).min(end)) {
                    add_part(brick, level, &part, most);
                }
            }
            child => visit(spline, level + 1, child as usize, b, most),
        }
    }
}

/// Second derivatives are convex combinations of the second differences of the coefficients that the box reads.
fn add_part<T: Real>(brick: &Brick<T>, level: usize, part: &Aabb, most: &mut Second) {
    let [x, y, z] = local_box(brick, level, part).map(|[a, b]| {
        let first = (a as usize).min(BRICK - 1);
        first..(b.ceil() as usize).max(first + 1) + 3
    });
    let zero = T::zero();
    let mut found = [zero; 6];
    let mut largest = zero;
    let raise = |m: &mut T, d: T| {
        let d = d.abs();
        *m = if d > *m { d } else { *m };
    };
    let two = T::from_f64(2.0);
    for i in x.clone() {
        let (ahead, between) = (i + 1 < x.end, i > x.start && i + 1 < x.end);
        for j in y.clone() {
            let (beside, amid) = (j + 1 < y.end, j > y.start && j + 1 < y.end);
            let row = |di: usize, dj: usize| {
                let at = ((i + di) * HALO + j + dj) * HALO;
                &brick.totals[at + z.start..at + z.end]
            };
            let back = |di: usize, dj: usize| {
                let at = ((i - di) * HALO + j - dj) * HALO;
                &brick.totals[at + z.start..at + z.end]
            };
            let own = row(0, 0);
            let n = own.len();
            for c in own {
                raise(&mut largest, *c);
            }
            for k in 1..n - 1 {
                raise(&mut found[2], own[k + 1] - two * own[k] + own[k - 1]);
            }
            if between {
                let (a, b) = (back(1, 0), row(1, 0));
                for k in 0..n {
                    raise(&mut found[0], a[k] - two * own[k] + b[k]);
                }
            }
            if amid {
                let (a, b) = (back(0, 1), row(0, 1));
                for k in 0..n {
                    raise(&mut found[1], a[k] - two * own[k] + b[k]);
                }
            }
            if ahead && beside {
                let (a, b, c) = (row(1, 0), row(0, 1), row(1, 1));
                for k in 0..n {
                    raise(&mut found[3], (c[k] - a[k]) - (b[k] - own[k]));
                }
            }
            if ahead {
                let a = row(1, 0);
                for k in 0..n - 1 {
                    raise(&mut found[4], (a[k + 1] - a[k]) - (own[k + 1] - own[k]));
                }
            }
            if beside {
                let a = row(0, 1);
                for k in 0..n - 1 {
                    raise(&mut found[5], (a[k + 1] - a[k]) - (own[k + 1] - own[k]));
                }
            }
        }
    }
    // Rounding of the differences here and of the evaluation, whose weights sum to 4 in magnitude.
    let rounding = 128.0 * T::UNIT_ROUND_OFF * largest.as_f64();
    let scale = ((1u64 << level) as f64).powi(2);
    for (m, d) in most.iter_mut().zip(found) {
        *m = m.max((d.as_f64() + rounding) * scale);
    }
}
