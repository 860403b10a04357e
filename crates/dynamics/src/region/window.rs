//! The box of a region that is awake.

use bspline::Real;
use serde::{Deserialize, Serialize};

use crate::lattice::{Lattice, SampleBox};

/// Coefficients beyond those that move, on each side, of a part that is kept.
const LEAST_MARGIN: usize = 2;

/// A box of knot intervals whose ends are samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Window {
    /// First free coefficient, which is also the first interval, and intervals.
    pub first: [usize; 3],
    pub cells: [usize; 3],
    pub first_sample: [usize; 3],
    pub samples: [usize; 3],
}

impl Window {
    pub fn coefficients(&self) -> [usize; 3] {
        self.cells.map(|c| c - 3)
    }

    pub fn sample_count(&self) -> usize {
        self.samples.iter().product()
    }

    /// Whether it holds the coefficients `low ..= high` of `all` on each axis, and a margin that ends where those do.
    pub fn holds(&self, [low, high]: [[usize; 3]; 2], all: [usize; 3]) -> bool {
        (0..3).all(|k| {
            let end = self.first[k] + self.cells[k] - 3;
            let before = low[k].saturating_sub(LEAST_MARGIN) >= self.first[k];
            before && (high[k] + LEAST_MARGIN).min(all[k] - 1) < end
        })
    }

    /// Whether it is one of `whole`, and `part` lies on it.
    pub fn fits<T: Real>(&self, whole: &Lattice<T>, part: &Lattice<T>) -> bool {
        let (n, m) = (whole.coefficient_dims(), whole.sample_dims());
        let lies = |k: usize| {
            let cells = self.first[k].checked_add(self.cells[k]);
            let samples = self.first_sample[k].checked_add(self.samples[k]);
            self.cells[k] > 3
                && cells.is_some_and(|end| end <= n[k] + 3)
                && samples.is_some_and(|end| end <= m[k])
        };
        (0..3).all(lies)
            && part.coefficient_dims() == self.coefficients()
            && part.sample_dims() == self.samples
    }

    /// Whether a sample lies in it.
    pub fn has_sample(&self, at: [usize; 3]) -> bool {
        (0..3).all(|k| (self.first_sample[k]..self.first_sample[k] + self.samples[k]).contains(&at[k]))
    }
}

/// A box of a list, z fastest.
pub(super) fn crop<V: Copy>(from: &[V], dims: [usize; 3], first: [usize; 3], count: [usize; 3]) -> Vec<V> {
    SampleBox { first, count }.crop(from, dims)
}

pub(super) fn paste<V: Copy>(
    into: &mut [V],
    dims: [usize; 3],
    first: [usize; 3],
    count: [usize; 3],
    from: &[V],
) {
    SampleBox { first, count }.paste(into, dims, from);
}
