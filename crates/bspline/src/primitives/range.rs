//! Ranges of simple functions over a box, and the rounding that has to be added to them.

use glam::DVec3;

use crate::{Aabb, Interval};

/// `[lo, hi]` widened by what rounding can add, here and in the evaluation of the field itself.
///
/// `size` is the largest length in play besides the box's own coordinates. Every formula of these solids loses
/// less than 30 units of the coordinates that enter it (differences of points, one projection on an axis, two
/// square roots); 64 covers the bounds' own arithmetic as well. NaN, which only boxes near the largest number
/// give, becomes the infinite end.
pub(super) fn outward(b: &Aabb, size: f64, lo: f64, hi: f64) -> Interval {
    let reach = b.min.abs().max(b.max.abs()).element_sum() + size;
    let slack = 64.0 * f64::EPSILON * reach;
    let (lo, hi) = ((lo - slack).next_down(), (hi + slack).next_up());
    Interval {
        lo: if lo.is_nan() { f64::NEG_INFINITY } else { lo },
        hi: if hi.is_nan() { f64::INFINITY } else { hi },
    }
}

/// Range of `a·(x - origin)` over the box.
pub(super) fn linear(b: &Aabb, origin: DVec3, a: DVec3) -> [f64; 2] {
    let (low, high) = (b.min - origin, b.max - origin);
    let (at_low, at_high) = (a * low, a * high);
    [
        at_low.min(at_high).element_sum(),
        at_low.max(at_high).element_sum(),
    ]
}

/// Range of `|x|` for `x` in `[lo, hi]`.
pub(super) fn absolute([lo, hi]: [f64; 2]) -> [f64; 2] {
    [lo.max(-hi).max(0.0), hi.max(-lo)]
}

/// Range of a convex function over the box: exact above, below the best of four tangent planes.
///
/// `jet` gives the value and a subgradient. A convex function is largest at a corner, and above all its
/// tangent planes; they are taken at the centre and then, since the function is a distance wherever it is
/// positive, at the feet of alternating projections on its zero set and the box.
pub(super) fn convex(b: &Aabb, jet: impl Fn(DVec3) -> (f64, DVec3)) -> [f64; 2] {
    let mut high = f64::NEG_INFINITY;
    for corner in 0..8 {
        let pick = |a: usize| if corner >> a & 1 == 0 { b.min[a] } else { b.max[a] };
        high = high.max(jet(DVec3::new(pick(0), pick(1), pick(2))).0);
    }
    let mut low = f64::NEG_INFINITY;
    let mut at = b.center();
    for _ in 0..4 {
        let (value, slope) = jet(at);
        low = low.max(value + linear(b, at, slope)[0]);
        if value <= 0.0 {
            break;
        }
        at = (at - slope * value).clamp(b.min, b.max);
    }
    [low, high]
}
