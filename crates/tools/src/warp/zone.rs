use bspline::{Aabb, Interval};
use glam::{DMat3, DVec3};

use crate::fade::{STEEPEST, fade};

/// Share, 0 to 1, in which a point takes part in a motion; twice continuously differentiable.
#[derive(Clone, Debug)]
pub(super) enum Zone {
    /// 1 within `inner` of a point, 0 beyond `outer`.
    Ball { center: DVec3, inner: f64, outer: f64 },
    /// 0 behind a plane through `start`, 1 from `width` before it on.
    Half { start: DVec3, normal: DVec3, width: f64 },
    /// 1 in a box, 0 from `width` beside it on.
    Box { center: DVec3, half: DVec3, width: f64 },
}

impl Zone {
    /// Fastest change of the share over a length.
    pub fn steepest(&self) -> f64 {
        match self {
            Self::Ball { inner, outer, .. } => STEEPEST / (outer - inner),
            Self::Half { width, .. } => STEEPEST / width,
            // At an edge two or three factors fall together.
            Self::Box { width, .. } => STEEPEST / width * 3f64.sqrt(),
        }
    }

    /// A box outside which the share is 0.
    pub fn reach(&self) -> Aabb {
        let about = |center: DVec3, half: DVec3| Aabb::new(center - half, center + half);
        match self {
            Self::Ball { center, outer, .. } => about(*center, DVec3::splat(*outer)),
            Self::Half { .. } => about(DVec3::ZERO, DVec3::INFINITY),
            Self::Box { center, half, width } => about(*center, *half + *width),
        }
    }

    pub fn value(&self, p: DVec3) -> f64 {
        match self {
            Self::Ball { center, inner, outer } => fade((p.distance(*center) - inner) / (outer - inner))[0],
            Self::Half { start, normal, width } => fade(1.0 - normal.dot(p - start) / width)[0],
            Self::Box { center, half, width } => {
                let t = ((p - center).abs() - half) / *width;
                fade(t.x)[0] * fade(t.y)[0] * fade(t.z)[0]
            }
        }
    }

    /// Share, gradient and Hessian.
    pub fn jet(&self, p: DVec3) -> (f64, DVec3, DMat3) {
        match self {
            Self::Ball { center, inner, outer } => {
                let away = p - center;
                let distance = away.length();
                let width = outer - inner;
                let [value, first, second] = fade((distance - inner) / width);
                if distance == 0.0 {
                    return (value, DVec3::ZERO, DMat3::ZERO);
                }
                let n = away / distance;
                let (first, second) = (first / width, second / (width * width));
                let across = first / distance;
                let hessian = outer_product(n, n) * (second - across) + DMat3::IDENTITY * across;
                (value, n * first, hessian)
            }
            Self::Half { start, normal, width } => {
                let [value, first, second] = fade(1.0 - normal.dot(p - start) / width);
                let hessian = outer_product(*normal, *normal) * (second / (width * width));
                (value, *normal * (-first / width), hessian)
            }
            Self::Box { center, half, width } => {
                let away = p - center;
                let axes: [[f64; 3]; 3] = std::array::from_fn(|a| {
                    let [v, first, second] = fade((away[a].abs() - half[a]) / width);
                    [v, first / width * away[a].signum(), second / (width * width)]
                });
                let product = |order: [usize; 3]| (0..3).map(|a| axes[a][order[a]]).product::<f64>();
                let order =
                    |i: usize, j: usize| std::array::from_fn(|a| usize::from(a == i) + usize::from(a == j));
                let gradient = DVec3::from_array([0, 1, 2].map(|i| product(order(i, 3))));
                let column = |i| DVec3::from_array([0, 1, 2].map(|j| product(order(i, j))));
                (
                    product([0; 3]),
                    gradient,
                    DMat3::from_cols(column(0), column(1), column(2)),
                )
            }
        }
    }

    /// Least and largest share over a box, sound.
    pub fn range(&self, b: &Aabb) -> Interval {
        // Close together, rounding may turn them round.
        let falling = |lo: f64, hi: f64| {
            let (far, near) = (fade(hi)[0], fade(lo)[0]);
            Interval::new(far.min(near), far.max(near))
        };
        // Of a straight coordinate, widened by what rounding may do to it.
        let height = |from: DVec3, along: DVec3| {
            let middle = along.dot(b.center() - from);
            let reach = along.abs().dot(0.5 * b.size());
            let slack = 1e-14 * (b.min.abs().max(b.max.abs()) + from.abs()).element_sum();
            [middle - reach - slack, middle + reach + slack]
        };
        match self {
            Self::Ball { center, inner, outer } => {
                let (low, high) = (b.min - center, b.max - center);
                let near = low.max(-high).max(DVec3::ZERO).length();
                let far = low.abs().max(high.abs()).length();
                let slack = 1e-14 * (far + center.length());
                let width = outer - inner;
                falling((near - slack - inner) / width, (far + slack - inner) / width)
            }
            Self::Half { start, normal, width } => {
                let [lo, hi] = height(*start, *normal);
                falling(1.0 - hi / width, 1.0 - lo / width)
            }
            Self::Box { center, half, width } => {
                let axis = |a: usize| {
                    let [lo, hi] = height(*center, DVec3::AXES[a]);
                    let (near, far) = (lo.max(-hi).max(0.0), lo.abs().max(hi.abs()));
                    falling((near - half[a]) / width, (far - half[a]) / width)
                };
                let all = axis(0) * axis(1) * axis(2);
                Interval::new(all.lo.max(0.0), all.hi.clamp(0.0, 1.0))
            }
        }
    }
}

/// `a bᵀ`.
pub(super) fn outer_product(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}
