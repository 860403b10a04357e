use bspline::{BandedRows, Field, KnotVector, TensorSpline};
use glam::{DAffine3, DVec3};

use crate::geometric::{GeometricError, ROOM, check_lengths, rounded};

/// Degree on every axis: force tools leave what they move smooth to the second derivative.
const DEGREE: usize = 3;
/// Most coefficients, and most along an axis.
const MOST: usize = 1 << 24;
const MOST_ON_AXIS: usize = 1 << 12;
/// Rounds in which the coefficients are corrected by what the field is off by.
const ROUNDS: usize = 8;

/// A block to start from on knots of one's choice: a box about the origin with edges `size`. Its field is about the distance
/// to its faces, positive inside, with the edges rounded by one and a half of `spacing`.
///
/// `knots` are ascending places on each axis, all world lengths. Where they do not reach, half the longest edge beyond the
/// block, knots follow a `spacing` apart; an axis without any has these alone.
///
/// # Errors
/// [`GeometricError::Shape`], which names the axis, the value and a remedy.
pub fn block(size: DVec3, spacing: f64, knots: [&[f64]; 3]) -> Result<TensorSpline<f32>, GeometricError> {
    check_lengths(size, spacing)?;
    let reach = 0.5 * size + ROOM * size.max_element();
    let axis = |a: usize| on_axis(["x", "y", "z"][a], knots[a], reach[a], spacing);
    let knots = [axis(0)?, axis(1)?, axis(2)?];
    let shape = knots.each_ref().map(KnotVector::coefficient_count);
    let count = shape.iter().fold(1usize, |n, m| n.saturating_mul(*m));
    if count > MOST {
        return Err(GeometricError::Shape(format!(
            "a block of {shape:?} coefficients is more than the {MOST} that are handled; give fewer knots, or a larger spacing"
        )));
    }
    let solid = rounded(size, spacing)?;
    let places = TensorSpline::<f64>::indices(&knots).map(|ijk| TensorSpline::<f64>::greville(&knots, ijk));
    let wanted: Vec<f64> = places.map(|p| solid.value(p)).collect();
    let coefficients = interpolating(&knots, shape, &wanted);
    let single = coefficients.into_iter().map(|c| c as f32).collect();
    let block = TensorSpline::new(knots, single, DAffine3::IDENTITY, 1.0).map_err(GeometricError::shape)?;
    match block.value(DVec3::ZERO) > 0.0 {
        true => Ok(block),
        false => Err(GeometricError::Shape(
            "the block is too thin for knots so far apart: no solid is left; give more knots within it"
                .into(),
        )),
    }
}

/// The knots of an axis: those given, and more on both sides until they reach `reach`.
fn on_axis(name: &str, given: &[f64], reach: f64, spacing: f64) -> Result<KnotVector, GeometricError> {
    let wrong = |why: String| Err(GeometricError::Shape(format!("axis {name}: {why}")));
    if let Some(knot) = given.iter().find(|k| !k.is_finite()) {
        return wrong(format!("the knot {knot} is no place; write numbers"));
    }
    if let Some([a, b]) = given.windows(2).map(|w| [w[0], w[1]]).find(|[a, b]| b <= a) {
        return wrong(format!(
            "the knot {b} follows {a}; write each once, in ascending order"
        ));
    }
    let ends = match given {
        [] => [-reach, -reach],
        [first, .., last] => [*first, *last],
        [only] => [*only; 2],
    };
    let is_beside = !given.is_empty() && (ends[0] >= reach || ends[1] <= -reach);
    if given.len() == 1 || is_beside {
        return wrong(format!(
            "its knots run from {} to {}, and the block's box from {} to {reach}; give two at least, and some within",
            ends[0], ends[1], -reach
        ));
    }
    let before = (ends[0] + reach).max(0.0);
    let behind = (reach - ends[1]).max(0.0);
    let spans = |length: f64| (length / spacing - 1e-9).ceil().max(0.0);
    let count = spans(before) + spans(behind) + given.len() as f64;
    if count > MOST_ON_AXIS as f64 {
        return wrong(format!(
            "{count} knots are more than the {MOST_ON_AXIS} that are handled; give fewer, or a larger --spacing"
        ));
    }
    let mut all: Vec<f64> = Vec::new();
    let steps = |from: f64, length: f64| {
        let n = spans(length);
        (1..=n as usize).map(move |i| from + length * i as f64 / n)
    };
    let mut low: Vec<f64> = steps(0.0, before).map(|step| ends[0] - step).collect();
    low.reverse();
    all.extend(low);
    all.extend(if given.is_empty() { &ends[..1] } else { given });
    all.extend(steps(ends[1], behind));
    // Both ends of the domain are repeated: the box is then that of the knots.
    let clamped = |u: f64| std::iter::repeat_n(u, DEGREE);
    let (first, last) = (all[0], all[all.len() - 1]);
    let knots = clamped(first).chain(all).chain(clamped(last)).collect();
    KnotVector::new(DEGREE, knots).or_else(|e| wrong(e.to_string()))
}

/// Coefficients of about these values at the Greville abscissae. The values themselves are coefficients of a field that is
/// right where it is linear. What that is off by is added to them some times: waves of many intervals are met at once, those of
/// two, which would ring, hardly.
fn interpolating(knots: &[KnotVector; 3], shape: [usize; 3], wanted: &[f64]) -> Vec<f64> {
    let rows: [BandedRows<f64>; 3] = std::array::from_fn(|a| {
        BandedRows::collocation(&knots[a], knots[a].greville_abscissae().collect::<Vec<_>>(), 0)
    });
    let mut coefficients = wanted.to_vec();
    for _ in 0..ROUNDS {
        let values = (0..3).fold(coefficients.clone(), |values, a| {
            rows[a].apply_along(a, shape, &values)
        });
        for ((c, wanted), value) in coefficients.iter_mut().zip(wanted).zip(values) {
            *c += wanted - value;
        }
    }
    coefficients
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_between_two_knots_is_refused() {
        let wide = [-20.0, 20.0];
        let refused = block(DVec3::splat(4.0), 1.0, [&wide; 3]).unwrap_err().to_string();
        assert!(refused.contains("no solid is left"), "{refused}");
        let within = [-2.0, 0.0, 2.0];
        assert!(block(DVec3::splat(4.0), 1.0, [&within; 3]).is_ok());
    }
}
