//! Two samples of a band at once, with the bits of [`stencil`](super::stencil).

use std::any::Any;

use bspline::pair::{Avx2, CubicPair, single};
use bspline::{Real, vectorized};

use super::band::{HALO_LEN, STRIDES};
use super::band_problem::BandSample;

/// Adds what `f` makes of value and gradient at a sample to the halo `out`, for as many samples as fill pairs. Returns the
/// others: all of them in double precision, or where the processor has no AVX2.
#[inline(always)]
pub(crate) fn in_pairs<'s, T: Real>(
    samples: &'s [BandSample<T>],
    values: &[T; HALO_LEN],
    out: &mut [T; HALO_LEN],
    f: &impl Fn(&BandSample<T>, T, [T; 3]) -> (T, [T; 3]),
) -> &'s [BandSample<T>] {
    let values = (values as &dyn Any).downcast_ref::<[f32; HALO_LEN]>();
    let out = (out as &mut dyn Any).downcast_mut::<[f32; HALO_LEN]>();
    let (Some(values), Some(out), Some(avx2)) = (values, out, Avx2::new()) else {
        return samples;
    };
    vectorized(
        #[inline(always)]
        || {
            for pair in samples.chunks_exact(2) {
                let (a, b) = (&pair[0], &pair[1]);
                let start = [a.spot.start, b.spot.start];
                let pair = CubicPair::new(avx2, [single(a.spot.t), single(b.spot.t)]);
                let [at_a, at_b] = pair.gather([&values[start[0]..], &values[start[1]..]], STRIDES);
                let amounts = [answer(a, at_a, f), answer(b, at_b, f)];
                pair.scatter(out, start, STRIDES, amounts);
            }
        },
    );
    &samples[samples.len() & !1..]
}

/// `f` of value and gradient at a sample.
#[inline(always)]
fn answer<T: Real>(
    sample: &BandSample<T>,
    (v, [x, y, z]): (f32, [f32; 3]),
    f: &impl Fn(&BandSample<T>, T, [T; 3]) -> (T, [T; 3]),
) -> (f32, [f32; 3]) {
    let wide = |x: f32| T::from_f64(f64::from(x));
    let (v, g) = f(sample, wide(v), [wide(x), wide(y), wide(z)]);
    (v.as_f64() as f32, single(g))
}

#[cfg(test)]
mod tests {
    use super::super::stencil::{Spot, gather, scatter};
    use super::*;
    use crate::phantoms::SplitMix64;

    fn answer(sample: &BandSample<f32>, v: f32, g: [f32; 3]) -> (f32, [f32; 3]) {
        (
            sample.weight * (v - sample.target),
            sample.normal.map(|n| n * g[0] - g[1] * g[2]),
        )
    }

    /// Neighbours in the list read the same coefficients, or some of them, or none; the last of an odd number is left.
    #[test]
    fn pairs_have_the_bits_of_samples_one_by_one() {
        let mut generator = SplitMix64::new(1);
        let mut random = || generator.uniform() as f32;
        let values: [f32; HALO_LEN] = std::array::from_fn(|_| random() - 0.5);
        let samples: Vec<_> = (0..301)
            .map(|i| {
                let cell = if i % 3 == 0 {
                    [i % 4, i / 5 % 4, i / 7 % 4]
                } else {
                    [i / 9 % 4, 1, 2]
                };
                BandSample {
                    spot: Spot {
                        start: cell[0] * STRIDES[0] + cell[1] * STRIDES[1] + cell[2],
                        t: [random(), random(), random()],
                    },
                    weight: random(),
                    gradient_weight: random(),
                    tangential: random(),
                    target: random() - 0.5,
                    normal: [random(), random(), random()],
                }
            })
            .collect();
        let mut alone = [0.0; HALO_LEN];
        for sample in &samples {
            let (v, g) = gather(&values, sample.spot, STRIDES);
            let (v, g) = answer(sample, v, g);
            scatter(&mut alone, sample.spot, STRIDES, v, g);
        }
        let mut found = [0.0; HALO_LEN];
        let rest = in_pairs(&samples, &values, &mut found, &answer);
        if Avx2::new().is_some() {
            assert_eq!(rest.len(), 1);
        }
        for sample in rest {
            let (v, g) = gather(&values, sample.spot, STRIDES);
            let (v, g) = answer(sample, v, g);
            scatter(&mut found, sample.spot, STRIDES, v, g);
        }
        assert_eq!(alone.map(f32::to_bits), found.map(f32::to_bits));
    }
}
