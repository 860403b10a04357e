//! Uniform cubic B-splines: the four functions that are not zero on one cell.
//!
//! On the cell `[k, k+1]` of integer knots the spline is `Σ_j w_j(t) c_{k+j}`, `t = x - k`, where `c_{k+j}`
//! belongs to the function that is centred on knot `k - 1 + j`. Derivatives are per cell: divide by the
//! spacing once for each order.
//!
//! Value weights are non-negative for `t` in `[0, 1]`. Nothing is clamped: outside they continue the cell's
//! polynomial.

use crate::Real;

/// Values `w_j(t)`; they sum to 1.
///
/// `6w = ((1-t)³, 3t³-6t²+4, -3t³+3t²+3t+1, t³)`
#[inline(always)]
pub fn values<T: Real>(t: T) -> [T; 4] {
    let c = T::from_f64;
    let s = T::one() - t;
    let (t2, s2) = (t * t, s * s);
    // The inner two in the variable that is small at their own far end, so that mirrored arguments give
    // mirrored weights: 3t³-6t²+4 = 1 + 3s + 3s² - 3s³.
    let sixth = c(1.0 / 6.0);
    let inner = |u: T, u2: T| (T::one() + c(3.0) * (u + u2 - u2 * u)) * sixth;
    [s2 * s * sixth, inner(s, s2), inner(t, t2), t2 * t * sixth]
}

/// First derivatives `w_j'(t)`; they sum to 0.
#[inline(always)]
pub fn first<T: Real>(t: T) -> [T; 4] {
    let c = T::from_f64;
    let s = T::one() - t;
    let half = c(0.5);
    let inner = |u: T| half + u - c(1.5) * (u * u);
    [-(half * (s * s)), -inner(s), inner(t), half * (t * t)]
}

/// Second derivatives `w_j''(t)`; they sum to 0.
#[inline(always)]
pub fn second<T: Real>(t: T) -> [T; 4] {
    let s = T::one() - t;
    let inner = |u: T| T::one() - T::from_f64(3.0) * u;
    [s, inner(s), inner(t), t]
}

/// Third derivatives, constant on a cell.
#[inline(always)]
pub fn third<T: Real>() -> [T; 4] {
    [-1.0, 3.0, -3.0, 1.0].map(T::from_f64)
}
