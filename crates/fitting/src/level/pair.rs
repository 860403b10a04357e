//! Two samples at once, in the eight lanes of AVX2, with the bits of [`stencil`](super::stencil).
//!
//! A row has four coefficients, so that a compiler left to itself stays at four lanes. A sample takes 15 ns to gather and
//! 17 to scatter, where one by one it takes 34 and 30.

use std::any::Any;

use bspline::{Real, cubic, vectorized};
use pulp::x86::V3;
use pulp::{cast, f32x4, f32x8};

use super::band::{HALO, HALO_LEN};
use super::band_problem::BandSample;
use super::stencil::Spot;

/// Strides of a brick with halo.
const STRIDES: [usize; 2] = [HALO * HALO, HALO];
/// Length of the part of a halo that one sample reads.
const REACH: usize = 3 * (STRIDES[0] + STRIDES[1]) + 4;

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
    let (Some(values), Some(out), Some(simd)) = (values, out, V3::try_new()) else {
        return samples;
    };
    vectorized(
        #[inline(always)]
        || {
            for pair in samples.chunks_exact(2) {
                let (a, b) = (&pair[0], &pair[1]);
                let weights = PairWeights::new(simd, [single(a.spot), single(b.spot)]);
                let [at_a, at_b] = weights.gather(simd, values);
                weights.scatter(simd, out, [answer(a, at_a, f), answer(b, at_b, f)]);
            }
        },
    );
    &samples[samples.len() & !1..]
}

#[inline(always)]
fn single<T: Real>(spot: Spot<T>) -> Spot<f32> {
    let [x, y, z] = spot.t;
    Spot {
        start: spot.start,
        t: [x.as_f64() as f32, y.as_f64() as f32, z.as_f64() as f32],
    }
}

/// `f` of value and gradient at a sample.
#[inline(always)]
fn answer<T: Real>(
    sample: &BandSample<T>,
    (v, [x, y, z]): (f32, [f32; 3]),
    f: &impl Fn(&BandSample<T>, T, [T; 3]) -> (T, [T; 3]),
) -> (f32, [f32; 3]) {
    let wide = |x: f32| T::from_f64(f64::from(x));
    let (v, [x, y, z]) = f(sample, wide(v), [wide(x), wide(y), wide(z)]);
    (
        v.as_f64() as f32,
        [x.as_f64() as f32, y.as_f64() as f32, z.as_f64() as f32],
    )
}

/// The weights of two samples along the three axes: the first one's in the low lanes.
struct PairWeights {
    start: [usize; 2],
    x: [f32x8; 4],
    dx: [f32x8; 4],
    y: [f32x8; 4],
    dy: [f32x8; 4],
    z: f32x8,
    dz: f32x8,
}

/// `low` four times, then `high`.
#[inline(always)]
fn each(simd: V3, [low, high]: [f32; 2]) -> f32x8 {
    joined(simd, [simd.splat_f32x4(low), simd.splat_f32x4(high)])
}

#[inline(always)]
fn joined(simd: V3, [low, high]: [f32x4; 2]) -> f32x8 {
    cast(simd.avx._mm256_set_m128(cast(high), cast(low)))
}

/// Each weight of two samples, in all their lanes.
#[inline(always)]
fn rows(simd: V3, [low, high]: [[f32; 4]; 2]) -> [f32x8; 4] {
    [
        each(simd, [low[0], high[0]]),
        each(simd, [low[1], high[1]]),
        each(simd, [low[2], high[2]]),
        each(simd, [low[3], high[3]]),
    ]
}

#[inline(always)]
fn row(values: &[f32], at: usize) -> f32x4 {
    let row: [f32; 4] = values[at..at + 4].try_into().expect("four of a row");
    cast(row)
}

#[inline(always)]
fn product_added(simd: V3, sum: f32x8, a: f32x8, b: f32x8) -> f32x8 {
    simd.add_f32x8(sum, simd.mul_f32x8(a, b))
}

impl PairWeights {
    #[inline(always)]
    fn new(simd: V3, spots: [Spot<f32>; 2]) -> Self {
        let [low, high] = spots;
        let values = |axis: usize| [cubic::values(low.t[axis]), cubic::values(high.t[axis])];
        let slopes = |axis: usize| [cubic::first(low.t[axis]), cubic::first(high.t[axis])];
        let ([wz, vz], [dz, ez]) = (values(2), slopes(2));
        Self {
            start: [low.start, high.start],
            x: rows(simd, values(0)),
            dx: rows(simd, slopes(0)),
            y: rows(simd, values(1)),
            dy: rows(simd, slopes(1)),
            z: joined(simd, [cast(wz), cast(vz)]),
            dz: joined(simd, [cast(dz), cast(ez)]),
        }
    }

    /// [`gather`](super::stencil::gather) of both: value and gradient of each.
    #[inline(always)]
    fn gather(&self, simd: V3, values: &[f32; HALO_LEN]) -> [(f32, [f32; 3]); 2] {
        let (low, high) = (
            &values[self.start[0]..][..REACH],
            &values[self.start[1]..][..REACH],
        );
        let zero = simd.splat_f32x8(0.0);
        let (mut plane, mut plane_dx, mut plane_dy) = (zero, zero, zero);
        for b in 0..4 {
            let (mut line, mut line_dx) = (zero, zero);
            for a in 0..4 {
                let at = a * STRIDES[0] + b * STRIDES[1];
                let row = joined(simd, [row(low, at), row(high, at)]);
                line = product_added(simd, line, self.x[a], row);
                line_dx = product_added(simd, line_dx, self.dx[a], row);
            }
            plane = product_added(simd, plane, self.y[b], line);
            plane_dx = product_added(simd, plane_dx, self.y[b], line_dx);
            plane_dy = product_added(simd, plane_dy, self.dy[b], line);
        }
        // Neighbours are added first, then the pairs, as `stencil::gather` does.
        let sum = |a: f32x8, b: f32x8| -> f32x8 { cast(simd.avx._mm256_hadd_ps(cast(a), cast(b))) };
        let first = sum(simd.mul_f32x8(self.z, plane), simd.mul_f32x8(self.z, plane_dx));
        let second = sum(simd.mul_f32x8(self.z, plane_dy), simd.mul_f32x8(self.dz, plane));
        let [[v, x, y, z], [w, r, s, t]]: [[f32; 4]; 2] = cast(sum(first, second));
        [(v, [x, y, z]), (w, [r, s, t])]
    }

    /// [`scatter`](super::stencil::scatter) of both, the first one's first.
    #[inline(always)]
    fn scatter(&self, simd: V3, values: &mut [f32; HALO_LEN], amounts: [(f32, [f32; 3]); 2]) {
        let [low, high] = amounts;
        let v = each(simd, [low.0, high.0]);
        let g = [
            each(simd, [low.1[0], high.1[0]]),
            each(simd, [low.1[1], high.1[1]]),
            each(simd, [low.1[2], high.1[2]]),
        ];
        let along = product_added(simd, simd.mul_f32x8(v, self.z), g[2], self.dz);
        let mut seconds = [simd.splat_f32x4(0.0); 16];
        let out = &mut values[self.start[0]..][..REACH];
        for b in 0..4 {
            let even = product_added(
                simd,
                simd.mul_f32x8(self.y[b], along),
                simd.mul_f32x8(self.dy[b], g[1]),
                self.z,
            );
            let odd = simd.mul_f32x8(simd.mul_f32x8(self.y[b], g[0]), self.z);
            for a in 0..4 {
                let added = product_added(simd, simd.mul_f32x8(self.x[a], even), self.dx[a], odd);
                let [first, second]: [f32x4; 2] = cast(added);
                add(simd, out, a * STRIDES[0] + b * STRIDES[1], first);
                seconds[4 * b + a] = second;
            }
        }
        let out = &mut values[self.start[1]..][..REACH];
        for b in 0..4 {
            for a in 0..4 {
                add(simd, out, a * STRIDES[0] + b * STRIDES[1], seconds[4 * b + a]);
            }
        }
    }
}

#[inline(always)]
fn add(simd: V3, out: &mut [f32], at: usize, added: f32x4) {
    let sum: [f32; 4] = cast(simd.add_f32x4(row(out, at), added));
    out[at..at + 4].copy_from_slice(&sum);
}

#[cfg(test)]
mod tests {
    use super::super::stencil::{gather, scatter};
    use super::*;

    fn answer(sample: &BandSample<f32>, v: f32, g: [f32; 3]) -> (f32, [f32; 3]) {
        (
            sample.weight * (v - sample.target),
            sample.normal.map(|n| n * g[0] - g[1] * g[2]),
        )
    }

    /// Neighbours in the list read the same coefficients, or some of them, or none; the last of an odd number is left.
    #[test]
    fn pairs_have_the_bits_of_samples_one_by_one() {
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 40) as f32 / 16_777_216.0
        };
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
        if V3::try_new().is_some() {
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
