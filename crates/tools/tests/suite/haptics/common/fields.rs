//! Fields as scans have them: splines whose numbers are no distances.

use bspline::{Aabb, Field, KnotVector, TensorSpline};
use glam::{DAffine3, DVec3};

/// A cubic spline with coefficients from a formula at their places, so close to it, on cubes of an edge, mm, over a box.
pub fn spline(within: &Aabb, cell: f64, formula: impl Fn(DVec3) -> f64) -> TensorSpline<f64> {
    let knots = std::array::from_fn(|a| {
        let (start, end) = (within.min[a], within.max[a]);
        let cells = ((end - start) / cell).round() as usize;
        KnotVector::clamped_uniform(3, cells, start, end).expect("a box with cells")
    });
    let places = TensorSpline::<f64>::indices(&knots);
    let coefficients = places
        .map(|ijk| formula(TensorSpline::<f64>::greville(&knots, ijk)))
        .collect();
    TensorSpline::new(knots, coefficients, DAffine3::IDENTITY, 1.0).expect("a spline of finite numbers")
}

/// Where a field has a value on the way from a place inside to one outside.
pub fn surface_between(field: &dyn Field, iso: f64, mut inside: DVec3, mut outside: DVec3) -> DVec3 {
    assert!(field.value(inside) > iso && field.value(outside) < iso);
    for _ in 0..60 {
        let middle = 0.5 * (inside + outside);
        if field.value(middle) > iso {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    inside
}
