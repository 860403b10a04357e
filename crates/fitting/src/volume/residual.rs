//! Residuals at the samples, and their correlation with the functions of every level.

use bspline::vectorized;
use std::ops::Range;

use bspline::Real;
use rayon::prelude::*;

use super::active::{ActiveSet, Packed};
use super::domain::{Domain, SLAB, Samples};
use super::refinement::{Restriction, TotalRows, coarse_totals, restrict};
use super::rows::one_four_one;

/// `r = d - f` at all samples, padding included, x fastest.
pub(crate) fn residual<T: Real>(
    domain: &Domain<T>,
    samples: &Samples<T>,
    active: &[ActiveSet],
    packed: &Packed<T>,
    out: &mut [T],
) {
    let finest = domain.finest();
    let [nx, ny, _] = domain.padded();
    let totals = coarse_totals(domain, active, packed);
    let coarse = &totals[finest - 1];
    out.par_chunks_mut(nx * ny * SLAB)
        .enumerate()
        .for_each(|(i, slab)| {
            vectorized(
                #[inline(always)]
                || {
                    let rows = TotalRows::new(domain, finest, coarse, &active[finest], &packed[finest]);
                    let planes = i * SLAB..i * SLAB + slab.len() / (nx * ny);
                    let mut targets = slab.chunks_mut(nx);
                    residual_slab(domain, samples, rows, planes, |_, _, row| {
                        targets
                            .next()
                            .expect("as many rows as asked for")
                            .copy_from_slice(row);
                    });
                },
            );
        });
}

/// Hands rows `(y, z, d - f)` of the sample planes `planes` to `emit`, in order of z then y.
#[inline(always)]
pub(crate) fn residual_slab<T: Real>(
    domain: &Domain<T>,
    samples: &Samples<T>,
    mut totals: TotalRows<T>,
    planes: Range<usize>,
    mut emit: impl FnMut(usize, usize, &[T]),
) {
    let [nx, ny, _] = domain.padded();
    let phases = domain.phases(domain.finest());
    let width = phases.len();
    let scale = T::from_f64(1.0 / 216.0);
    let mut total = vec![T::zero(); width];
    let mut value = vec![T::zero(); width];
    let mut natural = vec![T::zero(); nx];
    let mut data = vec![T::zero(); nx];
    let mut rows: [Vec<T>; 3] = std::array::from_fn(|_| vec![T::zero(); width]);
    let mut ring: [Vec<T>; 3] = std::array::from_fn(|_| vec![T::zero(); width * ny]);
    // Sample plane k lies under the function planes k, k+1, k+2; rows alike.
    for s in planes.start..planes.end + 2 {
        totals.start_plane(s);
        let plane = &mut ring[s % 3];
        for t in 0..ny + 2 {
            totals.row(t, &mut total);
            phases.interpolate(&total, &mut rows[t % 3]);
            if t >= 2 {
                let k = t - 2;
                let [a, b, c] = [k % 3, (k + 1) % 3, t % 3].map(|j| &rows[j][..]);
                one_four_one(a, b, c, &mut plane[k * width..(k + 1) * width]);
            }
        }
        if s < planes.start + 2 {
            continue;
        }
        let z = s - 2;
        let [a, b, c] = [z % 3, (z + 1) % 3, s % 3].map(|j| &ring[j][..]);
        for y in 0..ny {
            let at = y * width..(y + 1) * width;
            one_four_one(&a[at.clone()], &b[at.clone()], &c[at], &mut value);
            phases.join(&value, &mut natural);
            samples.row(y, z, &mut data);
            for (d, &f) in data.iter_mut().zip(&natural) {
                *d -= f * scale;
            }
            emit(y, z, &data);
        }
    }
}

/// Correlation `Σ_k w_k B_s(k) r(k)` of a residual with the functions of every level.
///
/// Entry `ℓ` holds the dense correlations of level `ℓ`; the finest level's are kept for its active functions
/// only, in packed order, as the last entry.
pub(crate) fn correlations<T: Real>(
    domain: &Domain<T>,
    residual: &[T],
    finest_active: &ActiveSet,
) -> Vec<Vec<T>> {
    let finest = domain.finest();
    let planes = domain.functions(finest)[2];
    let mut packed = vec![T::zero(); finest_active.len()];
    let slabs: Vec<Restriction<T>> = finest_active
        .split_planes_mut(&mut packed, SLAB)
        .into_par_iter()
        .enumerate()
        .map(|(i, out)| {
            let (z0, z1) = (i * SLAB, ((i + 1) * SLAB).min(planes));
            vectorized(
                #[inline(always)]
                || correlation_slab(domain, residual, finest_active, out, z0, z1),
            )
        })
        .collect();
    let mut dense = vec![T::zero(); domain.function_count(finest - 1)];
    Restriction::merge(slabs, &mut dense);
    let mut levels = vec![packed];
    for level in (1..finest).rev() {
        let coarser = restrict(domain, level, &dense);
        levels.push(std::mem::replace(&mut dense, coarser));
    }
    levels.push(dense);
    levels.reverse();
    levels
}

#[inline(always)]
fn correlation_slab<T: Real>(
    domain: &Domain<T>,
    residual: &[T],
    active: &ActiveSet,
    out: &mut [T],
    z0: usize,
    z1: usize,
) -> Restriction<T> {
    let [nx, ny, nz] = domain.padded();
    let [wx, wy, wz] = domain.axes;
    let phases = domain.phases(domain.finest());
    let width = phases.len();
    let scale = T::from_f64(1.0 / 216.0);
    let start = active.planes(z0..z1).start;
    let mut sum = Restriction::new(domain, domain.finest(), z0, z1);
    let mut weighted = vec![T::zero(); nx];
    let mut split = vec![T::zero(); width];
    let mut row = vec![T::zero(); width];
    let zero_row = vec![T::zero(); width];
    let zero_plane = vec![T::zero(); width * (ny + 2)];
    let mut rows: [Vec<T>; 3] = std::array::from_fn(|_| vec![T::zero(); width]);
    let mut ring: [Vec<T>; 3] = std::array::from_fn(|_| vec![T::zero(); width * (ny + 2)]);
    // Function plane s collects the sample planes s-2, s-1, s; rows alike.
    for z in z0.saturating_sub(2)..z1 {
        if z < nz {
            let plane = &mut ring[z % 3];
            for t in 0..ny + 2 {
                if t < ny {
                    let at = (z * ny + t) * nx;
                    let weight = wy.weight(t) * wz.weight(z);
                    let row_weight = T::from_f64(weight) * scale;
                    for (w, &r) in weighted.iter_mut().zip(&residual[at..at + nx]) {
                        *w = r * row_weight;
                    }
                    for k in wx.samples..nx {
                        weighted[k] *= T::from_f64(wx.weight(k));
                    }
                    phases.split(&weighted, &mut split);
                    phases.correlate(&split, &mut rows[t % 3]);
                }
                let at = |k: Option<usize>| match k {
                    Some(k) if k < ny => &rows[k % 3][..],
                    _ => &zero_row[..],
                };
                let [a, b, c] = [t.checked_sub(2), t.checked_sub(1), Some(t)].map(at);
                one_four_one(a, b, c, &mut plane[t * width..(t + 1) * width]);
            }
        }
        if z < z0 {
            continue;
        }
        let at = |k: Option<usize>| match k {
            Some(k) if k < nz => &ring[k % 3][..],
            _ => &zero_plane[..],
        };
        let [a, b, c] = [z.checked_sub(2), z.checked_sub(1), Some(z)].map(at);
        for y in 0..ny + 2 {
            let at = y * width..(y + 1) * width;
            one_four_one(&a[at.clone()], &b[at.clone()], &c[at], &mut row);
            let range = active.row(y, z);
            let packed = &mut out[range.start - start..range.end - start];
            for (&x, o) in active.x(range).iter().zip(packed) {
                *o = row[phases.slot(x as usize)];
            }
            sum.add_row(y, &row);
        }
        sum.end_plane(z);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantoms::SplitMix64;
    use bspline::cubic;

    /// Value of function `s` of `level` of an axis at sample `k`, from the definition.
    fn basis(domain: &Domain<f64>, axis: usize, level: usize, s: usize, k: usize) -> f64 {
        let h = domain.axes[axis].spacing(level);
        let w = cubic::values((k % h) as f64 / h as f64);
        // Cell k/h is under the functions s = k/h ..= k/h + 3.
        s.checked_sub(k / h)
            .and_then(|j| w.get(j))
            .copied()
            .unwrap_or(0.0)
    }

    #[test]
    fn residual_and_correlation_are_those_of_the_definition() {
        let dims = [6, 5, 10];
        let domain = Domain::<f64>::new(dims, 3);
        let mut random = SplitMix64::new(2);
        let values: Vec<f32> = (0..dims.iter().product())
            .map(|_| random.normal() as f32)
            .collect();
        let samples = Samples {
            values: (&values).into(),
            dims,
            scale: 1.0,
        };
        // One function of each level: its whole column of the matrix.
        for (level, picked) in [
            (0, [1, 2, 0]),
            (0, [3, 3, 4]),
            (1, [2, 4, 5]),
            (1, [0, 0, 6]),
            (2, [3, 1, 10]),
        ] {
            let size = domain.functions(level);
            let index = (picked[2] * size[1] + picked[1]) * size[0] + picked[0];
            let active: Vec<ActiveSet> = (0..3)
                .map(|l| match l == level {
                    true => ActiveSet::from_indices(size, std::iter::once(index)),
                    false => ActiveSet::empty(domain.functions(l)),
                })
                .collect();
            let packed: Packed<f64> = active.iter().map(|a| vec![1.5; a.len()]).collect();
            let [nx, ny, nz] = domain.padded();
            let mut r = vec![0.0; nx * ny * nz];
            residual(&domain, &samples, &active, &packed, &mut r);
            let mut correlation = 0.0;
            for (i, &r) in r.iter().enumerate() {
                let k = [i % nx, i / nx % ny, i / (nx * ny)];
                let b: f64 = (0..3)
                    .map(|a| basis(&domain, a, level, picked[a], k[a]))
                    .product();
                let inside: [usize; 3] = std::array::from_fn(|a| k[a].min(dims[a] - 1));
                let d = f64::from(values[(inside[2] * dims[1] + inside[1]) * dims[0] + inside[0]]);
                assert!((r - (d - 1.5 * b)).abs() < 1e-14, "level {level}, sample {k:?}");
                let weight: f64 = (0..3).map(|a| domain.axes[a].weight(k[a])).product();
                correlation += weight * b * r;
            }
            let all = correlations(&domain, &r, &active[2]);
            let got = if level == 2 { all[2][0] } else { all[level][index] };
            assert!(
                (got - correlation).abs() < 1e-13,
                "level {level}: {got}, {correlation}"
            );
        }
    }
}
