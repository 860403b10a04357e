//! What a level's functions would add: exact least-squares coefficients of a residual, and their energies.

use bspline::Real;
use rayon::prelude::*;

use super::active::ActiveSet;
use super::axis::Axis;
use super::banded::BandCholesky;
use super::domain::Domain;
use super::select::Cutoff;
use crate::lines::solve_all_axes;
use crate::prefilter::{LineEnds, Prefilter};

/// Exact least-squares coefficients of a level above the finest, all its functions taken, in place of the
/// correlations of the residual with them: `(GxⓍGyⓍGz)⁻¹`, one banded factor per axis.
pub(crate) fn least_squares<T: Real>(domain: &Domain<T>, level: usize, correlations: &mut [T]) {
    let factors = domain.axes.map(|a| BandCholesky::of_level(&a, level));
    solve_all_axes(
        [&factors[0], &factors[1], &factors[2]],
        correlations,
        domain.functions(level),
    );
}

/// Coefficients of the finest level that pass through the residual at every sample, in place of it. Coefficient
/// `i` takes the place of sample `i`; those beyond the samples are zero.
pub(crate) fn interpolation<T: Real>(domain: &Domain<T>, residual: &mut [T]) {
    let size = domain.padded();
    let filters = size.map(|n| Prefilter::<T>::new(n, LineEnds::Zero));
    solve_all_axes([&filters[0], &filters[1], &filters[2]], residual, size);
}

/// An array of coefficients of one level, x fastest, and where it lies among the level's functions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DetailLayout {
    pub level: usize,
    /// Extent of the array.
    pub size: [usize; 3],
    /// Index of the function at the array's start, on each axis.
    pub first: usize,
}

impl DetailLayout {
    pub fn of_level<T: Real>(domain: &Domain<T>, level: usize) -> Self {
        if level == domain.finest() {
            Self {
                level,
                size: domain.padded(),
                first: 1,
            }
        } else {
            Self {
                level,
                size: domain.functions(level),
                first: 0,
            }
        }
    }

    /// Per axis: `‖B‖` of each entry, 0 where the function may not carry detail.
    fn norms<T: Real>(self, domain: &Domain<T>) -> [Vec<T>; 3] {
        let of = |axis: &Axis, n: usize| {
            let norms = axis.norms(self.level);
            (0..n)
                .map(|i| {
                    let s = i + self.first;
                    if axis.is_candidate(self.level, s) {
                        T::from_f64(norms[s])
                    } else {
                        T::zero()
                    }
                })
                .collect()
        };
        std::array::from_fn(|a| of(&domain.axes[a], self.size[a]))
    }

    /// Turns coefficients into scores `weight |c| ‖B‖`, for weight 1 the square root of the energy a function
    /// carries; 0 where a function may not carry detail.
    pub fn score<T: Real>(self, domain: &Domain<T>, weight: T, coefficients: &mut [T]) {
        let [nx, ny, _] = self.size;
        let norms = self.norms(domain);
        coefficients
            .par_chunks_mut(nx * ny)
            .enumerate()
            .for_each(|(z, plane)| {
                for (y, row) in plane.chunks_mut(nx).enumerate() {
                    let yz = weight * (norms[1][y] * norms[2][z]);
                    for (c, &n) in row.iter_mut().zip(&norms[0]) {
                        *c = c.abs() * (yz * n);
                    }
                }
            });
    }

    /// Function index (dense, in the level's own size) of an entry.
    #[inline(always)]
    pub fn function(self, functions: [usize; 3], x: usize, y: usize, z: usize) -> usize {
        ((z + self.first) * functions[1] + y + self.first) * functions[0] + x + self.first
    }

    /// The functions whose score is kept; the array's scores are counted from `offset`.
    pub fn select<T: Real>(
        self,
        domain: &Domain<T>,
        scores: &[T],
        cutoff: Cutoff,
        offset: usize,
    ) -> ActiveSet {
        let functions = domain.functions(self.level);
        let [nx, ny, nz] = self.size;
        let mut picked = Vec::new();
        for z in 0..nz {
            for y in 0..ny {
                let start = (z * ny + y) * nx;
                for (x, &s) in scores[start..start + nx].iter().enumerate() {
                    if cutoff.keeps(s, offset + start + x) {
                        picked.push(self.function(functions, x, y, z));
                    }
                }
            }
        }
        ActiveSet::from_indices(functions, picked.into_iter())
    }

    /// Visits every active function with its entry in the array, in packed order.
    pub fn for_each_active(self, set: &ActiveSet, mut visit: impl FnMut(usize, usize)) {
        let [nx, ny, nz] = self.size;
        for z in 0..nz {
            for y in 0..ny {
                let range = set.row(y + self.first, z + self.first);
                let start = (z * ny + y) * nx;
                for (packed, &x) in range.clone().zip(set.x(range)) {
                    visit(packed, start + x as usize - self.first);
                }
            }
        }
    }
}
