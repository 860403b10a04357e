//! Knot insertion: the same spline on more knots, and on a part of its domain.
//!
//! One knot by Boehm's rule \[Boehm80\], many at once by the Oslo
//! algorithm 1 \[Cohen80\]. Every new
//! coefficient is a convex combination of at most `p + 1` old ones, whose weights are sums of non-negative products
//! and so right to a few units in the last place each.

use crate::knots::{KnotVector, MAX_CELLS, MAX_DEGREE};
use crate::{BandedRows, Real};

/// Why knots cannot be inserted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum InsertionError {
    /// The knot is not in the domain, or NaN.
    #[error("the knot {knot} is outside the domain from {start} to {end}")]
    Outside {
        /// Knot asked for.
        knot: f64,
        /// Start of the domain.
        start: f64,
        /// End of the domain.
        end: f64,
    },
    /// One repetition more and the spline could jump.
    #[error(
        "the knot {knot} would occur {wanted} times; degree {degree} allows {degree}, with one more the field could jump there"
    )]
    Multiplicity {
        /// Knot asked for.
        knot: f64,
        /// How often it would occur.
        wanted: usize,
        /// Degree of the spline.
        degree: usize,
    },
    /// There is no number, or too few, between two knots.
    #[error("the span from {start} to {end} is too short to be split in {parts}")]
    SpanTooShort {
        /// First knot of the span.
        start: f64,
        /// Second knot of the span.
        end: f64,
        /// Parts asked for.
        parts: usize,
    },
    /// Spans are split in one part at least.
    #[error("a span cannot be split in 0 parts; 1 leaves it as it is")]
    NoParts,
    /// More coefficients than are handled.
    #[error("{count} coefficients along the axis; at most {MAX_CELLS} are handled: insert fewer knots")]
    TooMany {
        /// Coefficients there would be.
        count: usize,
    },
    /// An interval that is not a part of the domain.
    #[error("[{from}, {to}] is no interval of positive length in the domain from {start} to {end}")]
    Interval {
        /// Start asked for.
        from: f64,
        /// End asked for.
        to: f64,
        /// Start of the domain.
        start: f64,
        /// End of the domain.
        end: f64,
    },
}

const ORDER: usize = MAX_DEGREE + 1;

impl KnotVector {
    /// How often `u` occurs.
    pub fn multiplicity(&self, u: f64) -> usize {
        occurrences(self.knots(), u)
    }

    /// The knots with `new` ones among them, given in any order, repeated to insert them more than once.
    ///
    /// # Errors
    /// [`InsertionError::Outside`], [`InsertionError::Multiplicity`], [`InsertionError::TooMany`].
    pub fn with_inserted(&self, new: &[f64]) -> Result<Self, InsertionError> {
        let [start, end] = self.domain();
        if let Some(&knot) = new.iter().find(|u| !(start <= **u && **u <= end)) {
            return Err(InsertionError::Outside { knot, start, end });
        }
        let count = self.coefficient_count() + new.len();
        if count > MAX_CELLS {
            return Err(InsertionError::TooMany { count });
        }
        let degree = self.degree();
        let mut knots: Vec<f64> = self.knots().iter().chain(new).copied().collect();
        knots.sort_by(|a, b| a.partial_cmp(b).expect("checked to be numbers"));
        for &knot in new {
            let wanted = occurrences(&knots, knot);
            if wanted > degree {
                return Err(InsertionError::Multiplicity { knot, wanted, degree });
            }
        }
        Ok(Self::new(degree, knots).expect("a checked insertion keeps a knot vector valid"))
    }

    /// What to insert so that every span of the domain falls into `parts` equal ones.
    ///
    /// # Errors
    /// [`InsertionError::NoParts`], [`InsertionError::SpanTooShort`], [`InsertionError::TooMany`].
    pub fn splits(&self, parts: usize) -> Result<Vec<f64>, InsertionError> {
        if parts == 0 {
            return Err(InsertionError::NoParts);
        }
        let domain = &self.knots()[self.degree()..=self.coefficient_count()];
        let spans: Vec<[f64; 2]> = domain
            .windows(2)
            .filter(|s| s[0] < s[1])
            .map(|s| [s[0], s[1]])
            .collect();
        let count = spans.len().saturating_mul(parts);
        if count > MAX_CELLS {
            return Err(InsertionError::TooMany { count });
        }
        let mut new = Vec::with_capacity(count);
        for [start, end] in spans {
            let mut last = start;
            for i in 1..parts {
                let u = start + (end - start) * (i as f64 / parts as f64);
                if !(last < u && u < end) {
                    return Err(InsertionError::SpanTooShort { start, end, parts });
                }
                new.push(u);
                last = u;
            }
        }
        Ok(new)
    }
}

/// How often `u` is among sorted `knots`.
fn occurrences(knots: &[f64], u: f64) -> usize {
    knots.partition_point(|k| *k <= u) - knots.partition_point(|k| *k < u)
}

/// Inserts `u` once: the new knots, and the matrix from old to new coefficients.
///
/// `Q_i = α_i P_i + (1 - α_i) P_{i-1}`, `α_i = (u - u_i)/(u_{i+p} - u_i)` between `k-p+1` and `k-s`, where
/// `u_k <= u < u_{k+1}` and `u` occurs `s` times already [Boehm80; Piegl97 eq. 5.15].
///
/// # Errors
/// [`InsertionError::Outside`], [`InsertionError::Multiplicity`], [`InsertionError::TooMany`].
pub fn boehm<T: Real>(knots: &KnotVector, u: f64) -> Result<(KnotVector, BandedRows<T>), InsertionError> {
    let finer = knots.with_inserted(&[u])?;
    let (p, t) = (knots.degree(), knots.knots());
    let k = t.partition_point(|x| *x <= u) - 1;
    let s = knots.multiplicity(u);
    let mut rows = BandedRows::with_capacity(knots.coefficient_count(), 2, finer.coefficient_count());
    for i in 0..finer.coefficient_count() {
        let weights = if i + p <= k {
            [0.0, 1.0]
        } else if i + s > k {
            [1.0, 0.0]
        } else {
            let length = t[i + p] - t[i];
            [(t[i + p] - u) / length, (u - t[i]) / length]
        };
        rows.push(i as isize - 1, &weights);
    }
    Ok((finer, rows))
}

/// Inserts all of `new`: the new knots, and the matrix from old to new coefficients.
///
/// # Errors
/// [`InsertionError::Outside`], [`InsertionError::Multiplicity`], [`InsertionError::TooMany`].
pub fn oslo<T: Real>(knots: &KnotVector, new: &[f64]) -> Result<(KnotVector, BandedRows<T>), InsertionError> {
    let finer = knots.with_inserted(new)?;
    let rows = discrete_splines(knots.degree(), knots.knots(), finer.knots());
    Ok((finer, rows))
}

/// The part of the domain from `a` to `b`: its clamped knots, and the matrix from the coefficients to those of
/// the part.
///
/// # Errors
/// [`InsertionError::Interval`].
pub fn restriction<T: Real>(
    knots: &KnotVector,
    a: f64,
    b: f64,
) -> Result<(KnotVector, BandedRows<T>), InsertionError> {
    let [start, end] = knots.domain();
    let refused = InsertionError::Interval {
        from: a,
        to: b,
        start,
        end,
    };
    if !(start <= a && a < b && b <= end) {
        return Err(refused);
    }
    let (part, rows) = restriction_rows(knots, a, b);
    KnotVector::new(knots.degree(), part)
        .map(|part| (part, rows))
        .map_err(|_| refused)
}

/// The knots `a … a, those strictly between, b … b` and the rows to their coefficients, for `a <= b` in the domain;
/// for `a = b` the one row that gives the value there.
pub(crate) fn restriction_rows<T: Real>(knots: &KnotVector, a: f64, b: f64) -> (Vec<f64>, BandedRows<T>) {
    if a == b {
        return (Vec::new(), BandedRows::collocation(knots, [a], 0));
    }
    let ends = |u: f64| std::iter::repeat_n(u, knots.order());
    let inner = knots.knots();
    let inner = &inner[inner.partition_point(|u| *u <= a)..inner.partition_point(|u| *u < b)];
    let part: Vec<f64> = ends(a).chain(inner.iter().copied()).chain(ends(b)).collect();
    let rows = discrete_splines(knots.degree(), knots.knots(), &part);
    (part, rows)
}

/// Rows to the coefficients of the *derivative* on the knots `a … a, those strictly between, b … b`, for `a <= b` in
/// the domain, opened by one unit in the last place, so that at a knot the limits from both sides are among them.
///
/// The derivative has the coefficients `p(c_{i+1} - c_i)/(u_{i+p+1} - u_{i+1})` on the knots without the first and the
/// last, and one degree less [Piegl97 eq. 3.8].
pub(crate) fn derivative_rows<T: Real>(knots: &KnotVector, a: f64, b: f64) -> BandedRows<T> {
    let [start, end] = knots.domain();
    let (a, b) = (a.next_down().max(start), b.next_up().min(end));
    let (p, t) = (knots.degree(), knots.knots());
    let lower = &t[1..t.len() - 1];
    let ends = |u: f64| std::iter::repeat_n(u, p);
    let inner = &lower[lower.partition_point(|u| *u <= a)..lower.partition_point(|u| *u < b)];
    let part: Vec<f64> = ends(a).chain(inner.iter().copied()).chain(ends(b)).collect();
    let of_derivative = discrete_splines::<f64>(p - 1, lower, &part);
    let mut rows = BandedRows::with_capacity(knots.coefficient_count(), p + 1, of_derivative.row_count());
    for r in 0..of_derivative.row_count() {
        let (first, weights) = of_derivative.row(r);
        let mut combined = [0.0; ORDER];
        for (j, w) in weights.iter().enumerate().filter(|(_, w)| **w != 0.0) {
            let i = first + j;
            let share = w * (p as f64 / (t[i + p + 1] - t[i + 1]));
            combined[j] -= share;
            combined[j + 1] += share;
        }
        rows.push(first as isize, &combined[..=p]);
    }
    rows
}

/// The discrete B-splines `α_{i,p+1}(j)` of degree `p` of the knots `t` on `tau`, one row for each `j`; `tau` contains
/// the knots of `t` between its own ends.
///
/// `α_{i,1}(j) = 1` where `t_i <= τ_j < t_{i+1}`,
/// `α_{i,k+1}(j) = (τ_{j+k} - t_i)/(t_{i+k} - t_i) α_{i,k}(j) + (t_{i+k+1} - τ_{j+k})/(t_{i+k+1} - t_{i+1}) α_{i+1,k}(j)`
/// [Cohen80 eq. 3.10; Oslo algorithm 1]. Where a factor would be negative or divide by zero,
/// the `α` beside it is exactly zero.
fn discrete_splines<T: Real>(p: usize, t: &[f64], tau: &[f64]) -> BandedRows<T> {
    let count = tau.len() - p - 1;
    let mut rows = BandedRows::with_capacity(t.len() - p - 1, p + 1, count);
    for j in 0..count {
        let span = t.partition_point(|u| *u <= tau[j]) - 1;
        // Slot r stands for function span - p + r, of which some may not exist: their α stays zero.
        let mut alpha = [0.0; ORDER + 1];
        alpha[p] = 1.0;
        for k in 1..=p {
            let u = tau[j + k];
            for r in p - k..=p {
                let i = span + r;
                let mut sum = 0.0;
                if alpha[r] != 0.0 {
                    sum += (u - t[i - p]) / (t[i + k - p] - t[i - p]) * alpha[r];
                }
                if alpha[r + 1] != 0.0 {
                    sum += (t[i + k + 1 - p] - u) / (t[i + k + 1 - p] - t[i + 1 - p]) * alpha[r + 1];
                }
                debug_assert!(sum >= 0.0, "negative weight {sum} in row {j}");
                alpha[r] = sum;
            }
        }
        rows.push(span as isize - p as isize, &alpha[..=p]);
    }
    rows
}
