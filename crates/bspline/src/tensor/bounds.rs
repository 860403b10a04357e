//! A sound interval over a box: the spline restricted to the box lies in the hull of its coefficients.

use super::grid::tensor_product;
use super::spline::TensorSpline;
use crate::insertion::{derivative_rows, restriction_rows};
use crate::{Aabb, BandedRows, Interval, KnotVector, Real, vectors};

/// Interval of the field over a box given in parameters.
pub(super) fn over_parameters<T: Real>(spline: &TensorSpline<T>, b: &Aabb) -> Interval {
    if !(b.min.is_finite() && b.max.is_finite()) {
        return Interval::EVERYTHING;
    }
    let place = &spline.place;
    let inside = Aabb {
        min: b.min.clamp(place.min, place.max),
        max: b.max.clamp(place.min, place.max),
    };
    let rows = restricted_axes(spline, &inside);
    let (mut lo, mut hi) = (T::infinity(), T::neg_infinity());
    tensor_product(&spline.coefficients, spline.shape(), &rows, |c| {
        lo = if c < lo { c } else { lo };
        hi = if c > hi { c } else { hi };
    });
    let largest = largest_read(&spline.coefficients, spline.shape(), &rows);
    let rounding = rounding_share::<T>(&spline.knots) * largest;
    Interval::new(lo.as_f64(), hi.as_f64()).widened(rounding) - place.fall(b, &inside)
}

/// Interval of each component of the gradient over a world box.
pub(super) fn of_gradient<T: Real>(spline: &TensorSpline<T>, b: &Aabb) -> [Interval; 3] {
    let place = &spline.place;
    let local = b.transformed(&place.local_from_world);
    if !(local.min.is_finite() && local.max.is_finite()) {
        return [Interval::EVERYTHING; 3];
    }
    let inside = Aabb {
        min: local.min.clamp(place.min, place.max),
        max: local.max.clamp(place.min, place.max),
    };
    let slopes = slopes(&spline.coefficients, &spline.knots, &inside);
    let world = vectors::transformed(place.local_from_world.matrix3.transpose(), slopes);
    place.extend_slopes(world, &local, &inside)
}

/// Interval of each derivative by parameters over a box of the domain.
fn slopes<T: Real>(coefficients: &[T], knots: &[KnotVector; 3], inside: &Aabb) -> [Interval; 3] {
    let shape = knots.each_ref().map(KnotVector::coefficient_count);
    let values: [BandedRows<T>; 3] =
        std::array::from_fn(|a| restriction_rows(&knots[a], inside.min[a], inside.max[a]).1);
    let largest = largest_read(coefficients, shape, &values);
    std::array::from_fn(|axis| {
        let mut rows = values.clone();
        rows[axis] = derivative_rows(&knots[axis], inside.min[axis], inside.max[axis]);
        let (mut lo, mut hi) = (T::infinity(), T::neg_infinity());
        tensor_product(coefficients, shape, &rows, |c| {
            lo = if c < lo { c } else { lo };
            hi = if c > hi { c } else { hi };
        });
        // The weights of a derivative sum to 0; what rounding does to them is a share of their magnitudes, and so it is
        // in the evaluation, whose weights are no larger in sum.
        let steepness = (0..rows[axis].row_count())
            .map(|r| rows[axis].row(r).1.iter().map(|w| w.as_f64().abs()).sum::<f64>())
            .fold(0.0, f64::max);
        let rounding = 4.0
            * rounding_share::<T>(knots)
            * steepness
            * largest.max(largest_read(coefficients, shape, &rows));
        Interval::new(lo.as_f64(), hi.as_f64()).widened(rounding)
    })
}

fn restricted_axes<T: Real>(spline: &TensorSpline<T>, inside: &Aabb) -> [BandedRows<T>; 3] {
    std::array::from_fn(|a| restriction_rows(&spline.knots[a], inside.min[a], inside.max[a]).1)
}

/// Largest `|c|` of the coefficients that the rows read.
fn largest_read<T: Real>(coefficients: &[T], [_, ny, nz]: [usize; 3], rows: &[BandedRows<T>; 3]) -> f64 {
    let [x, y, z] = rows.each_ref().map(BandedRows::reads);
    let mut most = T::zero();
    for i in x {
        for j in y.clone() {
            let row = &coefficients[(i * ny + j) * nz..][z.clone()];
            most = row
                .iter()
                .fold(most, |m, c| if c.abs() > m { c.abs() } else { m });
        }
    }
    most.as_f64()
}

/// Bound on the rounding of the restriction and of one evaluation together, as a share of the largest coefficient.
///
/// On each axis weights are sums of non-negative products of `p` shares of three operations each and the additions
/// between, so right to `4p` units of double precision, the table of the evaluation to `5p`; rounding them to `T` and
/// the sum of `p + 1` products add `p + 3` units of `T`. Both sides over three axes, 5 % for products of errors.
fn rounding_share<T: Real>(knots: &[KnotVector; 3]) -> f64 {
    let p = knots.iter().map(|k| k.degree()).max().expect("three axes") as f64;
    1.05 * 3.0 * (2.0 * (p + 3.0) * T::UNIT_ROUND_OFF + 9.0 * p * f64::UNIT_ROUND_OFF)
}
