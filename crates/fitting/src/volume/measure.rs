//! Residuals of the finished field, measured in double precision from the stored coefficients.

use bspline::Real;
use bspline::vectorized;
use rayon::prelude::*;

use super::active::{ActiveSet, Packed};
use super::domain::{Domain, SLAB, Samples};
use super::leaves::{LeafGrid, LeafResidual, LeafSums};
use super::quantile::quantiles;
use super::refinement::{TotalRows, coarse_totals};
use super::residual::residual_slab;

/// Residuals of a field at its voxels, in the scale of the samples.
#[derive(Clone, Debug)]
pub(crate) struct Measured {
    pub grid: LeafGrid,
    /// x fastest.
    pub leaves: Vec<LeafResidual>,
    pub rms: f64,
    pub p95: f64,
    pub max: f64,
    /// Never below `|f(x_k) - d_k|` at any voxel, in whichever order and of the stored precision `f` is evaluated.
    pub bound: f64,
}

/// Rounding errors, in units of round-off times the largest sum of coefficients, that a value can collect.
///
/// A total passes three refinements of at most 3 roundings per level and one addition; a value takes three weighted sums
/// of 4 with weights of at most 8 roundings: `10 levels + 3·(8 + 4)`, doubled to cover the second-order terms.
fn rounding_factor(levels: usize) -> f64 {
    2.0 * (10 * levels + 36) as f64
}

/// Measures `Σ c B - d` at every voxel. `stored` are the coefficients as the field stores them.
pub(crate) fn measure<T: Real>(
    samples: &Samples<T>,
    domain: &Domain<T>,
    active: &[ActiveSet],
    stored: &Packed<T>,
) -> Measured {
    let exact: Packed<f64> = stored
        .iter()
        .map(|l| l.iter().map(|&c| c.as_f64()).collect())
        .collect();
    let domain = Domain::<f64>::new(domain.samples(), domain.levels());
    let samples = Samples {
        values: samples.values,
        dims: samples.dims,
        scale: samples.scale.as_f64(),
    };
    let finest = domain.finest();
    let [nx, ny, _] = domain.samples();
    let grid = LeafGrid::new(&domain);
    let totals = coarse_totals(&domain, active, &exact);
    let mut magnitudes = vec![0.0_f32; samples.values.len()];
    let parts: Vec<(LeafSums, f64)> = magnitudes
        .par_chunks_mut(nx * ny * SLAB)
        .enumerate()
        .map(|(i, slab)| {
            vectorized(
                #[inline(always)]
                || {
                    let planes = i * SLAB..i * SLAB + slab.len() / (nx * ny);
                    let rows = TotalRows::new(
                        &domain,
                        finest,
                        &totals[finest - 1],
                        &active[finest],
                        &exact[finest],
                    );
                    let mut sums = LeafSums::new(grid, &planes);
                    let mut targets = slab.chunks_mut(nx);
                    let mut max = 0.0_f64;
                    residual_slab(&domain, &samples, rows, planes, |y, z, row| {
                        if y < ny {
                            let row = &row[..nx];
                            sums.add_row(y, z, row);
                            for (t, &v) in targets.next().expect("one target per row").iter_mut().zip(row) {
                                let a = v.abs();
                                max = if a > max { a } else { max };
                                *t = a as f32;
                            }
                        }
                    });
                    (sums, max)
                },
            )
        })
        .collect();
    let max = parts.iter().fold(0.0, |m: f64, p| m.max(p.1));
    let leaves = LeafSums::merge(grid, parts.into_iter().map(|p| p.0));
    let sum: f64 = leaves.iter().map(|l| l.sum_of_squares).sum();
    let [p95] = quantiles(&magnitudes, [0.95]);
    let largest_sum: f64 = exact
        .iter()
        .map(|l| l.iter().fold(0.0, |m: f64, c| m.max(c.abs())))
        .sum();
    let rounding = rounding_factor(domain.levels()) * (T::UNIT_ROUND_OFF + f64::EPSILON) * largest_sum;
    Measured {
        grid,
        leaves,
        rms: (sum / samples.values.len() as f64).sqrt(),
        // Magnitudes were rounded to f32 for it.
        p95: f64::from(p95).min(max),
        max,
        bound: (max + rounding).next_up(),
    }
}
