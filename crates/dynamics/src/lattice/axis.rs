use bspline::knots::KnotError;
use bspline::{Basis, KnotVector};
use nalgebra::{Cholesky, DMatrix};
use serde::{Deserialize, Serialize};

use super::banded::Banded;
use super::dense::transposed_product;

/// Which coefficients at the ends of an axis keep their values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Rim {
    /// All coefficients may move.
    Free,
    /// The outer `degree` coefficients at both ends are fixed: the change, and all its continuous derivatives,
    /// vanish at the ends of the axis, so that a cubic patch stays C² with what surrounds it.
    Fixed,
}

/// Why a lattice cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LatticeError {
    /// The knots are no knot vector.
    #[error(transparent)]
    Knots(#[from] KnotError),
    /// Fewer samples than free coefficients, or too few for a spring.
    #[error(
        "axis {axis}: {found} samples for {coefficients} free coefficients; \
         at least {needed} are needed: sample more finely or use fewer coefficients"
    )]
    TooFewSamples {
        /// Which axis.
        axis: usize,
        /// Samples asked for.
        found: usize,
        /// Coefficients that may move.
        coefficients: usize,
        /// The least number of samples.
        needed: usize,
    },
    /// Nothing may move.
    #[error("axis {axis}: none of {coefficients} coefficients is free; at least {needed} are needed")]
    NothingFree {
        /// Which axis.
        axis: usize,
        /// All coefficients of the axis.
        coefficients: usize,
        /// The least number that leaves one free.
        needed: usize,
    },
    /// Some free coefficient, or some combination of them, moves no sample.
    #[error(
        "axis {axis}: the samples do not determine the free coefficients (pivot {pivot:.1e} at {index}); \
         put a sample into the support of each, or widen the knot spacing there"
    )]
    Undetermined {
        /// Which axis.
        axis: usize,
        /// First free coefficient that depends on the earlier ones.
        index: usize,
        /// Its pivot relative to its diagonal element.
        pivot: f64,
    },
    /// A distance that is not positive and finite.
    #[error(
        "axis {axis}: the samples would lie {spacing} apart; their distance has to be positive and finite"
    )]
    Spacing {
        /// Which axis.
        axis: usize,
        /// The spacing in world units.
        spacing: f64,
    },
}

/// One axis of a dynamic patch: its knots, its free coefficients, and equally spaced samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    knots: KnotVector,
    rim: Rim,
    samples: usize,
    spacing: f64,
}

impl Axis {
    /// `samples` equally spaced mass-points over the domain of `knots`, both ends included; the domain has the
    /// length `world_length`.
    ///
    /// # Errors
    /// Any [`LatticeError`] but `Knots`; they name axis `axis`.
    pub fn new(
        axis: usize,
        knots: KnotVector,
        rim: Rim,
        samples: usize,
        world_length: f64,
    ) -> Result<Self, LatticeError> {
        let spacing = world_length / samples.saturating_sub(1).max(1) as f64;
        Self::with_spacing(axis, knots, rim, samples, spacing)
    }

    /// The same with samples at the distance `spacing`.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub(crate) fn with_spacing(
        axis: usize,
        knots: KnotVector,
        rim: Rim,
        samples: usize,
        spacing: f64,
    ) -> Result<Self, LatticeError> {
        if !(spacing.is_finite() && spacing > 0.0) {
            return Err(LatticeError::Spacing { axis, spacing });
        }
        let out = Self {
            knots,
            rim,
            samples,
            spacing,
        };
        let (all, fixed) = (out.knots.coefficient_count(), 2 * out.first_free());
        if all <= fixed {
            return Err(LatticeError::NothingFree {
                axis,
                coefficients: all,
                needed: fixed + 1,
            });
        }
        let needed = (all - fixed).max(2);
        if samples < needed {
            return Err(LatticeError::TooFewSamples {
                axis,
                found: samples,
                coefficients: all - fixed,
                needed,
            });
        }
        out.check_rank(axis)?;
        Ok(out)
    }

    /// Refuses collocation matrices whose columns are dependent, exactly or to within a few units of rounding.
    fn check_rank(&self, axis: usize) -> Result<(), LatticeError> {
        let a = self.collocation().to_dense();
        // Each function needs a sample of its own, in order, where it does not vanish [Schoenberg53]. Elimination alone
        // may find a last pivot of rounding.
        let mut free = 0..a.nrows();
        for index in 0..a.ncols() {
            if !free.any(|s| a[(s, index)] > 1e-9) {
                let pivot = 0.0;
                return Err(LatticeError::Undetermined { axis, index, pivot });
            }
        }
        let mut gram = transposed_product(&a, &a);
        let n = gram.nrows();
        let diagonal: Vec<f64> = (0..n).map(|i| gram[(i, i)]).collect();
        for j in 0..n {
            let pivot = gram[(j, j)] / diagonal[j];
            // NaN comes from an empty column.
            if pivot.is_nan() || pivot <= 1e-12 {
                return Err(LatticeError::Undetermined {
                    axis,
                    index: j,
                    pivot: if pivot.is_nan() { 0.0 } else { pivot },
                });
            }
            for i in j + 1..n {
                let factor = gram[(i, j)] / gram[(j, j)];
                for k in j + 1..n {
                    gram[(i, k)] -= factor * gram[(j, k)];
                }
            }
        }
        Ok(())
    }

    /// The knots.
    pub fn knots(&self) -> &KnotVector {
        &self.knots
    }

    /// What the ends do.
    pub fn rim(&self) -> Rim {
        self.rim
    }

    /// Number `m` of samples.
    pub fn sample_count(&self) -> usize {
        self.samples
    }

    /// Distance `h` between samples, in world units.
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Index of the first coefficient that may move.
    pub fn first_free(&self) -> usize {
        match self.rim {
            Rim::Free => 0,
            Rim::Fixed => self.knots.degree(),
        }
    }

    /// Number `n` of coefficients that may move.
    pub fn free_count(&self) -> usize {
        self.knots.coefficient_count() - 2 * self.first_free()
    }

    /// Parameter of sample `s`.
    pub fn parameter(&self, s: usize) -> f64 {
        let [start, end] = self.knots.domain();
        if s + 1 == self.samples {
            end
        } else {
            start + (end - start) * (s as f64 / (self.samples - 1) as f64)
        }
    }

    /// The collocation matrix: sample `s` is `Σ_c row_s[c] p_c` over the free coefficients [Hua04 eq. 5, one axis].
    pub fn collocation(&self) -> Banded<f64> {
        let (first, n) = (self.first_free(), self.free_count());
        let rows = (0..self.samples).map(|s| {
            let basis: Basis<f64> = Basis::at(&self.knots, self.parameter(s), 0);
            let terms = basis.values().iter().enumerate();
            let free = terms.filter_map(|(j, &w)| Some(((basis.first() + j).checked_sub(first)?, w)));
            free.filter(|&(c, w)| c < n && w != 0.0).collect::<Vec<_>>()
        });
        Banded::from_rows(n, rows)
    }

    /// The axis with about half the knots: every other inner breakpoint is left out, so that each spline on it is
    /// one on this axis. `None` if nothing would be left out or nothing would stay free.
    pub fn half(&self) -> Option<Self> {
        let u = self.knots.knots();
        let (p, n) = (self.knots.degree(), self.knots.coefficient_count());
        let [start, end] = self.knots.domain();
        let mut keep: Vec<f64> = u[..=p].to_vec();
        let inner: Vec<&[f64]> = u[p + 1..n].chunk_by(|a, b| a == b).collect();
        for (i, run) in inner.iter().enumerate() {
            if i % 2 == 1 && start < run[0] && run[0] < end {
                keep.extend_from_slice(run);
            }
        }
        if keep.len() + p + 1 == u.len() {
            return None;
        }
        // Unclamped ends have knots beyond the domain, whose spacing has to follow: clamp them. With a fixed rim the
        // free functions are the same, with a free one the spline on the domain is the same space.
        keep[..=p].fill(start);
        keep.extend(std::iter::repeat_n(end, p + 1));
        let knots = KnotVector::new(p, keep).ok()?;
        let out = Self {
            knots,
            ..self.clone()
        };
        (out.knots.coefficient_count() > 2 * out.first_free()).then_some(out)
    }

    /// The matrix of knot insertion from `coarse`, whose breakpoints are among those of this axis: free coefficients
    /// here of a spline there.
    ///
    /// By least squares at `degree + 1` points of each span, which is exact for splines of this axis.
    pub(super) fn prolongation(&self, coarse: &Self) -> Banded<f64> {
        let (p, n) = (self.knots.degree(), self.knots.coefficient_count());
        let u = self.knots.knots();
        let inside = |i: usize| (0..=p).map(move |j| (i, (j as f64 + 0.5) / (p as f64 + 1.0)));
        let points: Vec<f64> = (p..n)
            .filter(|&i| u[i] < u[i + 1])
            .flat_map(inside)
            .map(|(i, t)| u[i] + t * (u[i + 1] - u[i]))
            .collect();
        let matrix = |knots: &KnotVector| {
            let mut a = DMatrix::zeros(points.len(), knots.coefficient_count());
            for (r, &t) in points.iter().enumerate() {
                let basis: Basis<f64> = Basis::at(knots, t, 0);
                for (j, &w) in basis.values().iter().enumerate() {
                    a[(r, basis.first() + j)] = w;
                }
            }
            a
        };
        let (fine, target) = (matrix(&self.knots), matrix(&coarse.knots));
        let gram = Cholesky::new(transposed_product(&fine, &fine))
            .expect("functions on their own spans are independent");
        let all = gram.solve(&transposed_product(&fine, &target));
        let (rows, columns) = (self.first_free(), coarse.first_free());
        let row = |i: usize| {
            let weights = (0..coarse.free_count()).map(move |c| (c, i + rows, c + columns));
            let weights = weights.map(|(c, i, j)| (c, all[(i, j)]));
            weights.filter(|(_, w)| w.abs() > 1e-11).collect::<Vec<_>>()
        };
        Banded::from_rows(coarse.free_count(), (0..self.free_count()).map(row))
    }
}
