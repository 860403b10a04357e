//! The interpolating fit: one coefficient per voxel, exact at every voxel.

use bspline::Real;
use bspline::vectorized;
use rayon::prelude::*;

use super::domain::{Domain, Samples};
use crate::lines::{solve_along_x, solve_along_y, solve_along_z};
use crate::prefilter::{LineEnds, Prefilter};

/// Coefficients of all functions of the finest level, x fastest, whose spline passes through every voxel.
///
/// The ends are [not-a-knot](LineEnds::NotAKnot): any tricubic polynomial is reproduced on the whole box between
/// the outermost voxel centres. Functions beyond (the padding up to the last coarse cell) continue the edge.
/// Planes are filtered along x and y while they are in the cache, then all of them along z.
pub(crate) fn interpolating_coefficients<T: Real>(domain: &Domain<T>, samples: &Samples<T>) -> Vec<T> {
    let [fx, fy, fz] = domain.functions(domain.finest());
    let [nx, ny, nz] = domain.samples();
    let filters = domain
        .samples()
        .map(|n| Prefilter::<T>::new(n, LineEnds::NotAKnot));
    let mut dense = vec![T::zero(); fx * fy * fz];
    // Voxel plane z lies at function plane z + 1; planes and rows that hold no voxel are filled by the filters.
    dense
        .par_chunks_mut(fx * fy)
        .skip(1)
        .take(nz)
        .enumerate()
        .for_each(|(z, plane)| {
            vectorized(
                #[inline(always)]
                || {
                    let rows = &mut plane[fx..(ny + 1) * fx];
                    for (y, row) in rows.chunks_mut(fx).enumerate() {
                        samples.row(y, z, &mut row[1..nx + 1]);
                    }
                    solve_along_x(&filters[0], rows, fx);
                    solve_along_y(&filters[1], plane, fx);
                },
            );
        });
    solve_along_z(&filters[2], &mut dense, fx * fy);
    dense
}

/// [`interpolating_coefficients`] of unscaled voxels, and their number along each axis.
pub(crate) fn interpolate_voxels<T: Real>(dims: [usize; 3], values: &[f32]) -> (Vec<T>, [usize; 3]) {
    let domain = Domain::<T>::new(dims, 3);
    let dense = interpolating_coefficients(
        &domain,
        &Samples {
            values: values.into(),
            dims,
            scale: T::one(),
        },
    );
    (dense, domain.functions(domain.finest()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::active::ActiveSet;
    use crate::volume::measure::measure;

    fn max_residual<T: Real>(dims: [usize; 3], values: &[f32]) -> f64 {
        let domain = Domain::<T>::new(dims, 3);
        let samples = Samples {
            values: values.into(),
            dims,
            scale: T::one(),
        };
        let dense = interpolating_coefficients(&domain, &samples);
        let mut active: Vec<ActiveSet> = (0..3).map(|l| ActiveSet::empty(domain.functions(l))).collect();
        active[2] = ActiveSet::full(domain.functions(2));
        measure(&samples, &domain, &active, &vec![vec![], vec![], dense]).max
    }

    #[test]
    fn passes_through_every_voxel() {
        for dims in [
            [23, 18, 31],
            [1, 1, 1],
            [2, 3, 4],
            [5, 1, 6],
            [7, 2, 3],
            [64, 4, 1],
        ] {
            let n: usize = dims.iter().product();
            let values: Vec<f32> = (0..n).map(|i| (i * 7919 % 4099) as f32 / 4.0 - 500.0).collect();
            // Errors of the filter are amplified by at most 3 per axis inside and 30 at an end.
            assert!(max_residual::<f64>(dims, &values) < 1e-10, "{dims:?} in f64");
            assert!(max_residual::<f32>(dims, &values) < 2e-2, "{dims:?} in f32");
        }
    }
}
