//! The B-splines that are not zero at a parameter, with their derivatives.

use crate::Real;
use crate::knots::{KnotVector, MAX_DEGREE};

/// Highest derivative that is computed.
pub const MAX_DERIVATIVE: usize = 3;

const ORDER: usize = MAX_DEGREE + 1;

/// Values and derivatives of the `p + 1` functions `first() ..= span` at one parameter.
///
/// `N_{i,p}^{(k)}(t)` [Hua04 eq. 1's `B`, `C`, `D`; Piegl97 eqs. 2.5 and 2.9], per unit of the parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Basis<T> {
    span: usize,
    degree: usize,
    rows: [[T; ORDER]; MAX_DERIVATIVE + 1],
}

impl<T: Real> Basis<T> {
    /// Evaluates at `t` the values and the derivatives up to `order <= 3`; higher ones than asked for are 0.
    ///
    /// At a knot the right-hand limits, at the end of the domain the left-hand ones; outside the domain the
    /// polynomials of the first and last span. All arithmetic is in double precision, rounded to `T` once:
    /// knots that differ in `f64` may coincide in `f32`, and the recurrence divides by their differences.
    ///
    /// # Panics
    /// If `order > 3`.
    pub fn at(knots: &KnotVector, t: f64, order: usize) -> Self {
        Self::on_span(knots, knots.span(t), t, order)
    }

    /// [`Self::at`] another parameter, soonest found if it is of the same span.
    pub(crate) fn moved_to(&self, knots: &KnotVector, t: f64, order: usize) -> Self {
        Self::on_span(knots, knots.span_near(t, self.span), t, order)
    }

    fn on_span(knots: &KnotVector, span: usize, t: f64, order: usize) -> Self {
        assert!(
            order <= MAX_DERIVATIVE,
            "derivative {order} of at most {MAX_DERIVATIVE}"
        );
        match (knots.degree(), order) {
            // Loops of known lengths, in the same arithmetic.
            (3, 0) => Self::of_degree(knots, span, 3, t, 0),
            (3, 1) => Self::of_degree(knots, span, 3, t, 1),
            (3, 2) => Self::of_degree(knots, span, 3, t, 2),
            (p, order) => Self::of_degree(knots, span, p, t, order),
        }
    }

    #[inline(always)]
    fn of_degree(knots: &KnotVector, span: usize, p: usize, t: f64, order: usize) -> Self {
        let table = Table::new(&knots.knots()[span + 1 - p..=span + p], p, t);
        let mut rows = [[T::zero(); ORDER]; MAX_DERIVATIVE + 1];
        for r in 0..=p {
            rows[0][r] = T::from_f64(table.ndu[r][p]);
        }
        if order == 1 {
            rows[1] = table.slopes(p).map(T::from_f64);
        } else if order > 0 {
            let derivatives = table.derivatives(p, order.min(p));
            for k in 1..=order.min(p) {
                rows[k] = derivatives[k].map(T::from_f64);
            }
        }
        Self {
            span,
            degree: p,
            rows,
        }
    }

    /// Knot span in which the parameter lies.
    pub fn span(&self) -> usize {
        self.span
    }

    /// Index of the first function that is not zero.
    pub fn first(&self) -> usize {
        self.span - self.degree
    }

    /// Values of the functions `first() ..= span()`; they sum to 1.
    pub fn values(&self) -> &[T] {
        self.derivative(0)
    }

    /// Derivatives of order `k` of the same functions; for `k > 0` they sum to 0.
    ///
    /// # Panics
    /// If `k > 3`.
    pub fn derivative(&self, k: usize) -> &[T] {
        &self.rows[k][..=self.degree]
    }
}

/// The triangle of all lower degrees, [Piegl97 A2.2]: `ndu[r][j]` is function `r` of degree `j`, and
/// `ndu[j][r]`, `r < j`, the knot difference that stands under it.
struct Table {
    ndu: [[f64; ORDER]; ORDER],
}

impl Table {
    /// `u` are the `2p` knots round the span, of which `u[p-1] < u[p]` are its ends.
    #[inline(always)]
    fn new(u: &[f64], p: usize, t: f64) -> Self {
        let mut ndu = [[0.0; ORDER]; ORDER];
        let (mut left, mut right) = ([0.0; ORDER], [0.0; ORDER]);
        ndu[0][0] = 1.0;
        for j in 1..p + 1 {
            left[j] = t - u[p - j];
            right[j] = u[p - 1 + j] - t;
            let mut saved = 0.0;
            for r in 0..j {
                // Difference of the knots themselves, not the sum of the two distances: exact in more cases.
                ndu[j][r] = u[p + r] - u[p + r - j];
                let share = ndu[r][j - 1] / ndu[j][r];
                ndu[r][j] = saved + right[r + 1] * share;
                saved = left[j - r] * share;
            }
            ndu[j][j] = saved;
        }
        Self { ndu }
    }

    /// First derivatives, with the bits of [`Self::derivatives`]: a quotient that two functions share is taken once.
    #[inline(always)]
    fn slopes(&self, p: usize) -> [f64; ORDER] {
        let mut slopes = [0.0; ORDER];
        for s in 0..p {
            let rise = 1.0 / self.ndu[p][s] * self.ndu[s][p - 1];
            slopes[s] -= rise;
            slopes[s + 1] += rise;
        }
        slopes.map(|slope| slope * p as f64)
    }

    /// Derivatives `1 ..= order <= p`, [Piegl97 A2.3].
    #[inline(always)]
    fn derivatives(&self, p: usize, order: usize) -> [[f64; ORDER]; MAX_DERIVATIVE + 1] {
        let ndu = &self.ndu;
        let mut out = [[0.0; ORDER]; MAX_DERIVATIVE + 1];
        for r in 0..p + 1 {
            let mut previous = [0.0; MAX_DERIVATIVE + 1];
            previous[0] = 1.0;
            for k in 1..order + 1 {
                let mut row = [0.0; MAX_DERIVATIVE + 1];
                let low = p - k;
                let mut d = 0.0;
                // Term j takes function r-k+j of degree p-k, which exists for 0 <= r-k+j <= p-k.
                for j in k.saturating_sub(r)..k.min(p - r) + 1 {
                    let s = r + j - k;
                    let from_same = if j < k { previous[j] } else { 0.0 };
                    let from_left = if j > 0 { previous[j - 1] } else { 0.0 };
                    row[j] = (from_same - from_left) / ndu[low + 1][s];
                    d += row[j] * ndu[s][low];
                }
                out[k][r] = d;
                previous = row;
            }
        }
        let mut factor = 1.0;
        for k in 1..=order {
            factor *= (p + 1 - k) as f64;
            out[k].iter_mut().for_each(|d| *d *= factor);
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On every span, on knots, repeated ones among them, at the ends and beyond them.
    #[test]
    fn functions_are_the_same_wherever_one_comes_from() {
        for p in 1..=MAX_DEGREE {
            let inner = [0.1, 0.35, 0.35, 0.7, 0.9];
            let ends = |t: f64| std::iter::repeat_n(t, p + 1);
            let list = ends(0.0).chain(inner).chain(ends(1.0)).collect();
            let knots = KnotVector::new(p, list).unwrap();
            let mut places: Vec<f64> = (-2..=22).map(|i| f64::from(i) / 20.0).collect();
            places.extend(inner);
            for from in &places {
                let basis = Basis::<f64>::at(&knots, *from, 1);
                for to in &places {
                    assert_eq!(basis.moved_to(&knots, *to, 1), Basis::at(&knots, *to, 1));
                }
            }
        }
    }

    #[test]
    fn slopes_have_the_bits_of_first_derivatives() {
        let knots = [0.0, 0.1, 0.1, 0.35, 0.7, 0.72, 0.9, 1.3, 1.3, 2.0];
        for p in 1..=MAX_DEGREE {
            let u = &knots[5 - p..5 + p];
            for i in 0..=20 {
                let t = u[p - 1] + (u[p] - u[p - 1]) * f64::from(i) / 20.0;
                let table = Table::new(u, p, t);
                assert_eq!(
                    table.slopes(p).map(f64::to_bits),
                    table.derivatives(p, 1)[1].map(f64::to_bits)
                );
            }
        }
    }
}
