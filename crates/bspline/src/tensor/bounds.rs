//! A sound interval over a box: the spline restricted to the box lies in the hull of its coefficients.

use super::grid::tensor_product;
use super::spline::TensorSpline;
use crate::insertion::restriction_rows;
use crate::{Aabb, BandedRows, Interval, Real};

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
    let rounding = rounding_share::<T>(spline) * largest_read(spline, &rows);
    Interval::new(lo.as_f64(), hi.as_f64()).widened(rounding) - place.fall(b, &inside)
}

fn restricted_axes<T: Real>(spline: &TensorSpline<T>, inside: &Aabb) -> [BandedRows<T>; 3] {
    std::array::from_fn(|a| restriction_rows(&spline.knots[a], inside.min[a], inside.max[a]).1)
}

/// Largest `|c|` of the coefficients that the rows read.
fn largest_read<T: Real>(spline: &TensorSpline<T>, rows: &[BandedRows<T>; 3]) -> f64 {
    let [_, ny, nz] = spline.shape();
    let [x, y, z] = rows.each_ref().map(BandedRows::reads);
    let mut most = T::zero();
    for i in x {
        for j in y.clone() {
            let row = &spline.coefficients[(i * ny + j) * nz..][z.clone()];
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
fn rounding_share<T: Real>(spline: &TensorSpline<T>) -> f64 {
    let p = spline.knots.iter().map(|k| k.degree()).max().expect("three axes") as f64;
    1.05 * 3.0 * (2.0 * (p + 3.0) * T::UNIT_ROUND_OFF + 9.0 * p * f64::UNIT_ROUND_OFF)
}
