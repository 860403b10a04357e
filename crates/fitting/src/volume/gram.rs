//! The normal matrix of the joint least squares, applied in one sweep over the finest level.
//!
//! With `P` the refinement of all coarser levels down to the voxel spacing and `B` the interpolation at the
//! samples, the unknowns of all levels together have the normal matrix `Pᵀ BᵀWB P`. Its middle factor is a
//! five-point filter per axis. A slab of planes is refined, filtered along x, y and z and collected again while
//! its rows are in the cache: what is read and written is the packed vectors and the small coarse levels.

use bspline::Real;
use bspline::vectorized;
use rayon::prelude::*;

use super::active::{ActiveSet, Packed};
use super::domain::{Domain, SLAB};
use super::refinement::{Restriction, TotalRows, coarse_totals, restrict};

/// `q = (A P)ᵀ W (A P) p` over the active functions of all levels.
pub(crate) fn apply_normal_matrix<T: Real>(
    domain: &Domain<T>,
    active: &[ActiveSet],
    p: &Packed<T>,
    q: &mut Packed<T>,
) {
    let finest = domain.finest();
    let totals = coarse_totals(domain, active, p);
    let mut dense = vec![T::zero(); domain.function_count(finest - 1)];
    apply_finest(
        domain,
        &totals[finest - 1],
        &active[finest],
        &p[finest],
        &mut q[finest],
        &mut dense,
    );
    drop(totals);
    for level in (0..finest).rev() {
        q[level] = active[level].gather(&dense);
        if level > 0 {
            dense = restrict(domain, level, &dense);
        }
    }
}

/// The finest level's part: its own rows into `q`, those of the next coarser level, dense, into `collected`.
fn apply_finest<T: Real>(
    domain: &Domain<T>,
    coarse: &[T],
    active: &ActiveSet,
    p: &[T],
    q: &mut [T],
    collected: &mut [T],
) {
    let planes = domain.functions(domain.finest())[2];
    let slabs: Vec<Restriction<T>> = active
        .split_planes_mut(q, SLAB)
        .into_par_iter()
        .enumerate()
        .map(|(i, q)| {
            let (z0, z1) = (i * SLAB, ((i + 1) * SLAB).min(planes));
            vectorized(
                #[inline(always)]
                || slab(domain, coarse, active, p, q, z0, z1),
            )
        })
        .collect();
    Restriction::merge(slabs, collected);
}

#[inline(always)]
fn slab<T: Real>(
    domain: &Domain<T>,
    coarse: &[T],
    active: &ActiveSet,
    p: &[T],
    q: &mut [T],
    z0: usize,
    z1: usize,
) -> Restriction<T> {
    let finest = domain.finest();
    let [_, ny, nz] = domain.functions(finest);
    let phases = domain.phases(finest);
    let width = phases.len();
    let q_start = active.planes(z0..z1).start;
    let mut totals = TotalRows::new(domain, finest, coarse, active, p);
    let mut sum = Restriction::new(domain, finest, z0, z1);
    let mut total = vec![T::zero(); width];
    let mut filtered = vec![T::zero(); width];
    let zero_row = vec![T::zero(); width];
    let zero_plane = vec![T::zero(); width * ny];
    let mut rows: [Vec<T>; 5] = std::array::from_fn(|_| vec![T::zero(); width]);
    let mut ring: [Vec<T>; 5] = std::array::from_fn(|_| vec![T::zero(); width * ny]);

    for z in z0.saturating_sub(2)..(z1 + 2) {
        if z < nz {
            totals.start_plane(z);
            let plane = &mut ring[z % 5];
            for y in 0..ny + 2 {
                if y < ny {
                    totals.row(y, &mut total);
                    phases.gram(&total, &domain.taps[0], &mut rows[y % 5]);
                }
                if y >= 2 {
                    let at = |j: usize| {
                        let r = y + j; // row r - 4, centre y - 2
                        if r >= 4 && r - 4 < ny {
                            &rows[(r - 4) % 5][..]
                        } else {
                            &zero_row[..]
                        }
                    };
                    let out = &mut plane[(y - 2) * width..(y - 1) * width];
                    domain.taps[1].combine(y - 2, std::array::from_fn(at), out);
                }
            }
        }
        if z < z0 + 2 {
            continue;
        }
        let center = z - 2;
        let planes: [&[T]; 5] = std::array::from_fn(|j| {
            let r = z + j; // plane r - 4
            if r >= 4 && r - 4 < nz {
                &ring[(r - 4) % 5][..]
            } else {
                &zero_plane[..]
            }
        });
        for y in 0..ny {
            let at = y * width..(y + 1) * width;
            domain.taps[2].combine(center, planes.map(|p| &p[at.clone()]), &mut filtered);
            let range = active.row(y, center);
            let out = &mut q[range.start - q_start..range.end - q_start];
            for (&x, o) in active.x(range).iter().zip(out) {
                *o = filtered[phases.slot(x as usize)];
            }
            sum.add_row(y, &filtered);
        }
        sum.end_plane(center);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantoms::SplitMix64;
    use crate::volume::domain::Samples;
    use crate::volume::residual::{correlations, residual};

    /// Sizes with and without padding, thinner than a coarse cell, and of more than one slab.
    const SIZES: [[usize; 3]; 4] = [[21, 17, 13], [22, 8, 19], [3, 1, 2], [9, 10, 103]];

    #[test]
    fn normal_matrix_is_synthesis_and_its_transpose() {
        for dims in SIZES {
            let domain = Domain::<f64>::new(dims, 3);
            let mut random = SplitMix64::new(1);
            let active: Vec<ActiveSet> = (0..3)
                .map(|level| {
                    let picked: Vec<usize> = (0..domain.function_count(level))
                        .filter(|_| random.uniform() < 0.3)
                        .collect();
                    ActiveSet::from_indices(domain.functions(level), picked.into_iter())
                })
                .collect();
            let p: Packed<f64> = active
                .iter()
                .map(|a| (0..a.len()).map(|_| random.normal()).collect())
                .collect();
            let mut q: Packed<f64> = active.iter().map(|a| vec![0.0; a.len()]).collect();
            apply_normal_matrix(&domain, &active, &p, &mut q);

            // -f at the samples is the residual of data that are zero.
            let zeros = vec![0.0; dims.iter().product()];
            let samples = Samples {
                values: (&zeros).into(),
                dims,
                scale: 1.0,
            };
            let mut r = vec![0.0; domain.padded().iter().product()];
            residual(&domain, &samples, &active, &p, &mut r);
            let dense = correlations(&domain, &r, &active[2]);
            for level in 0..3 {
                let expected = if level == 2 {
                    dense[2].clone()
                } else {
                    active[level].gather(&dense[level])
                };
                for (got, want) in q[level].iter().zip(expected) {
                    assert!(
                        (got + want).abs() < 1e-12,
                        "{dims:?}, level {level}: {got}, {want}"
                    );
                }
            }
        }
    }
}
