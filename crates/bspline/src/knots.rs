//! Knot vectors: where the pieces of a spline meet, and how smoothly.

use std::ops::Range;

/// Largest degree that [`crate::basis`] evaluates.
pub const MAX_DEGREE: usize = 5;
/// Most cells that a uniform knot vector is made with (the knots take 128 MiB then).
pub const MAX_CELLS: usize = 1 << 24;

/// A non-decreasing sequence of knots `u_0 … u_{n+p}` for `n` B-splines of degree `p`.
///
/// Function `i` has its support on `[u_i, u_{i+p+1}]`; the domain, on which the functions sum to 1, is
/// `[u_p, u_n]`. The ends may be clamped (`p + 1` equal knots) or not. A knot of multiplicity `m` leaves
/// `p - m` continuous derivatives; with `m = p + 1` the spline may jump.
#[derive(Clone, Debug, PartialEq)]
pub struct KnotVector {
    degree: usize,
    knots: Vec<f64>,
}

/// Why a sequence of numbers is no knot vector.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum KnotError {
    /// The degree is not supported.
    #[error("degree {degree} is not between 1 and {MAX_DEGREE}")]
    Degree {
        /// Degree asked for.
        degree: usize,
    },
    /// Not even one span.
    #[error("{found} knots, but degree {degree} needs at least {needed}")]
    TooFew {
        /// Knots given.
        found: usize,
        /// Knots needed, `2(degree + 1)`.
        needed: usize,
        /// Degree asked for.
        degree: usize,
    },
    /// A knot is NaN or infinite.
    #[error("knot {index} is {value}; knots have to be finite")]
    NotFinite {
        /// Place of the knot.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// A knot lies before the one in front of it.
    #[error("knot {index} is {after}, less than the knot before it, {before}")]
    Decreasing {
        /// Place of the smaller knot.
        index: usize,
        /// The knot in front of it.
        before: f64,
        /// Its value.
        after: f64,
    },
    /// A knot is repeated until a function vanishes.
    #[error("the knot {value} occurs {found} times; degree {degree} allows {} times", degree + 1)]
    Multiplicity {
        /// Value of the knot.
        value: f64,
        /// How often it occurs.
        found: usize,
        /// Degree asked for.
        degree: usize,
    },
    /// There is no length on which the functions sum to 1, or it is too large for a number.
    #[error("the domain is from {start} to {end}; it needs a positive, finite length")]
    Domain {
        /// First knot of the domain.
        start: f64,
        /// Last knot of the domain.
        end: f64,
    },
    /// No cells, too many, or cells so small that successive knots coincide.
    #[error(
        "{cells} cells from {start} to {end}: between 1 and {MAX_CELLS} cells with distinct knots are needed"
    )]
    Cells {
        /// Cells asked for.
        cells: usize,
        /// Start of the domain.
        start: f64,
        /// End of the domain.
        end: f64,
    },
}

impl KnotVector {
    /// Checks a sequence of knots.
    ///
    /// # Errors
    /// Any [`KnotError`] but `Cells`.
    pub fn new(degree: usize, knots: Vec<f64>) -> Result<Self, KnotError> {
        if !(1..=MAX_DEGREE).contains(&degree) {
            return Err(KnotError::Degree { degree });
        }
        let (found, needed) = (knots.len(), 2 * (degree + 1));
        if found < needed {
            return Err(KnotError::TooFew {
                found,
                needed,
                degree,
            });
        }
        if let Some((index, &value)) = knots.iter().enumerate().find(|(_, u)| !u.is_finite()) {
            return Err(KnotError::NotFinite { index, value });
        }
        if let Some(index) = (1..found).find(|&i| knots[i] < knots[i - 1]) {
            let (before, after) = (knots[index - 1], knots[index]);
            return Err(KnotError::Decreasing { index, before, after });
        }
        for run in knots.chunk_by(|a, b| a == b) {
            let (value, found) = (run[0], run.len());
            if found > degree + 1 {
                return Err(KnotError::Multiplicity { value, found, degree });
            }
        }
        let (start, end) = (knots[degree], knots[found - 1 - degree]);
        if !(start < end && (end - start).is_finite()) {
            return Err(KnotError::Domain { start, end });
        }
        Ok(Self { degree, knots })
    }

    /// `cells` equal cells on `[start, end]`, and `degree` more knots at the same distance on either side.
    ///
    /// # Errors
    /// [`KnotError::Degree`], [`KnotError::Domain`], or [`KnotError::Cells`].
    pub fn uniform(degree: usize, cells: usize, start: f64, end: f64) -> Result<Self, KnotError> {
        let p = degree as i64;
        let knots = equal_knots(degree, cells, start, end, -p..cells as i64 + p + 1)?;
        Self::new(degree, knots)
    }

    /// `cells` equal cells on `[start, end]` with both ends repeated `degree + 1` times: the spline takes the
    /// values of its first and last coefficient there.
    ///
    /// # Errors
    /// [`KnotError::Degree`], [`KnotError::Domain`], or [`KnotError::Cells`].
    pub fn clamped_uniform(degree: usize, cells: usize, start: f64, end: f64) -> Result<Self, KnotError> {
        let inner = equal_knots(degree, cells, start, end, 1..cells as i64)?;
        let ends = |u: f64| std::iter::repeat_n(u, degree + 1);
        Self::new(degree, ends(start).chain(inner).chain(ends(end)).collect())
    }

    /// Polynomial degree `p`.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// Order `p + 1`: how many functions are not zero at a point.
    pub fn order(&self) -> usize {
        self.degree + 1
    }

    /// The knots, in order.
    pub fn knots(&self) -> &[f64] {
        &self.knots
    }

    /// Number `n` of B-splines, and so of control coefficients.
    pub fn coefficient_count(&self) -> usize {
        self.knots.len() - self.order()
    }

    /// First and last parameter of the domain.
    pub fn domain(&self) -> [f64; 2] {
        [self.knots[self.degree], self.knots[self.coefficient_count()]]
    }

    /// Whether both ends of the domain are repeated `degree + 1` times.
    pub fn is_clamped(&self) -> bool {
        let [start, end] = self.domain();
        self.knots[0] == start && self.knots[self.knots.len() - 1] == end
    }

    /// The span `k`, `p <= k < n`, with `u_k <= t < u_{k+1}`; its functions are `k-p ..= k`.
    ///
    /// The last span includes the end of the domain. A parameter outside belongs to the nearest span, so that
    /// evaluation continues the polynomial there; NaN to the first one. [Piegl97 A2.1]
    pub fn span(&self, t: f64) -> usize {
        let [start, end] = self.domain();
        // At the end, and beyond it, the last knot below the end opens the last span that has a length.
        let below_or_at = if t >= end {
            self.knots.partition_point(|u| *u < end)
        } else if t > start {
            self.knots.partition_point(|u| *u <= t)
        } else {
            self.knots.partition_point(|u| *u <= start)
        };
        below_or_at - 1
    }

    /// [`Self::span`], without a search if it is that of another parameter.
    pub(crate) fn span_near(&self, t: f64, other: usize) -> usize {
        if self.knots[other] <= t && t < self.knots[other + 1] {
            other
        } else {
            self.span(t)
        }
    }

    /// Parameters on which function `i` is not zero, ends included.
    ///
    /// # Panics
    /// If there is no function `i`.
    pub fn support(&self, i: usize) -> [f64; 2] {
        assert!(
            i < self.coefficient_count(),
            "function {i} of {}",
            self.coefficient_count()
        );
        [self.knots[i], self.knots[i + self.order()]]
    }

    /// Mean `(u_{i+1} + … + u_{i+p})/p` of the inner knots of function `i`: the coefficients of the function
    /// `t` itself, and the natural place of coefficient `i`.
    ///
    /// # Panics
    /// If there is no function `i`.
    pub fn greville(&self, i: usize) -> f64 {
        assert!(
            i < self.coefficient_count(),
            "function {i} of {}",
            self.coefficient_count()
        );
        let inner = &self.knots[i + 1..i + self.order()];
        if inner[0] == inner[inner.len() - 1] {
            // The sum of equal numbers divided by their count need not give the number back.
            return inner[0];
        }
        inner.iter().sum::<f64>() / self.degree as f64
    }

    /// The Greville abscissae of all functions, in order.
    pub fn greville_abscissae(&self) -> impl Iterator<Item = f64> + '_ {
        (0..self.coefficient_count()).map(|i| self.greville(i))
    }
}

/// Knots `range` of the equal cells on `[start, end]`, where knot 0 is `start` and knot `cells` is `end`.
fn equal_knots(
    degree: usize,
    cells: usize,
    start: f64,
    end: f64,
    range: Range<i64>,
) -> Result<Vec<f64>, KnotError> {
    let step = (end - start) / cells as f64;
    if !(1..=MAX_DEGREE).contains(&degree) {
        return Err(KnotError::Degree { degree });
    }
    if !(start.is_finite() && start < end && (end - start).is_finite()) {
        return Err(KnotError::Domain { start, end });
    }
    let largest = start.abs().max(end.abs());
    if cells == 0 || cells > MAX_CELLS || step <= 4.0 * f64::EPSILON * largest {
        return Err(KnotError::Cells { cells, start, end });
    }
    let knot = |i: i64| {
        if i == cells as i64 {
            end
        } else {
            start + (end - start) * (i as f64 / cells as f64)
        }
    };
    Ok(range.map(knot).collect())
}
