//! A sound interval along a segment: the mean value form.

use glam::DVec3;

use crate::{Aabb, Field, Interval};

/// Longest piece that a mean value is taken over, in finest knot intervals: the bounds of the gradient are restricted
/// to boxes up to this size, see `slopes`.
const PIECE: f64 = 4.0;
/// Most pieces; longer segments have longer ones.
const PIECES: f64 = 8.0;

/// `f(m) + ½[-1, 1] (b - a)·∇f`, piece by piece; `spacing` is the finest knot interval, `rounding` what one value may be
/// off by.
pub(super) fn over_segment(
    field: &dyn Field,
    from: DVec3,
    to: DVec3,
    spacing: f64,
    rounding: f64,
) -> Interval {
    if !(from.is_finite() && to.is_finite()) {
        return Interval::EVERYTHING;
    }
    let pieces = ((to - from).length() / (PIECE * spacing))
        .ceil()
        .clamp(1.0, PIECES);
    let at = |i: f64| from.lerp(to, i / pieces);
    let piece = |i: f64| {
        let (a, b) = (at(i), at(i + 1.0));
        // The middle and the ends are rounded; the box holds them all.
        let slack = 4.0 * f64::EPSILON * a.abs().max(b.abs());
        let slopes = field.gradient_bounds(&Aabb {
            min: a.min(b) - slack,
            max: a.max(b) + slack,
        });
        let reach = (0..3).fold(Interval::point(0.0), |sum, axis| {
            let step = b[axis] - a[axis];
            sum + slopes[axis] * Interval::new(step - slack[axis], step + slack[axis])
        });
        let middle = Interval::point(field.value(a.midpoint(b))).widened(rounding);
        middle + reach * Interval::new(-0.5, 0.5)
    };
    (1..pieces as usize).fold(piece(0.0), |hull, i| hull.hull(piece(i as f64)))
}
