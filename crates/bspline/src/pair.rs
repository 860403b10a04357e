//! Cubic B-splines at two points at once, in the eight lanes of AVX2, with the bits of one point after the other.
//!
//! A row has four coefficients, so that a compiler left to itself stays at four lanes: one by one a point takes 34 ns, here
//! 15, and to scatter to its coefficients 30 and 17.

use pulp::x86::V3;
use pulp::{cast, f32x4, f32x8};

use crate::{Real, cubic};

/// The processor has AVX2. Called within [`vectorized`](crate::vectorized), what is here is compiled for it.
#[derive(Clone, Copy, Debug)]
pub struct Avx2(V3);

/// The functions of two points and their derivatives along the three axes, in cells: the first point's in the low lanes.
#[derive(Clone, Copy, Debug)]
pub struct CubicPair {
    simd: V3,
    x: [f32x8; 4],
    dx: [f32x8; 4],
    y: [f32x8; 4],
    dy: [f32x8; 4],
    z: f32x8,
    dz: f32x8,
}

impl Avx2 {
    /// If the processor has it.
    #[inline(always)]
    pub fn new() -> Option<Self> {
        V3::try_new().map(Self)
    }
}

/// A point in single precision, exact if it is.
#[inline(always)]
pub fn single<T: Real>([x, y, z]: [T; 3]) -> [f32; 3] {
    [x.as_f64() as f32, y.as_f64() as f32, z.as_f64() as f32]
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

/// Length of what one point reads.
#[inline(always)]
fn reach(strides: [usize; 2]) -> usize {
    3 * (strides[0] + strides[1]) + 4
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

impl CubicPair {
    /// At `t` in their cells, each `0..=1`.
    #[inline(always)]
    pub fn new(Avx2(simd): Avx2, [low, high]: [[f32; 3]; 2]) -> Self {
        let values = |axis: usize| [cubic::values(low[axis]), cubic::values(high[axis])];
        let slopes = |axis: usize| [cubic::first(low[axis]), cubic::first(high[axis])];
        let ([wz, vz], [dz, ez]) = (values(2), slopes(2));
        Self {
            simd,
            x: rows(simd, values(0)),
            dx: rows(simd, slopes(0)),
            y: rows(simd, values(1)),
            dy: rows(simd, slopes(1)),
            z: joined(simd, [cast(wz), cast(vz)]),
            dz: joined(simd, [cast(dz), cast(ez)]),
        }
    }

    /// Value and gradient, by cells, of each. The coefficients of a point begin with `values`; `strides` are those of x and
    /// y, z is contiguous.
    #[inline(always)]
    pub fn gather(&self, [low, high]: [&[f32]; 2], strides: [usize; 2]) -> [(f32, [f32; 3]); 2] {
        let (simd, reach) = (self.simd, reach(strides));
        let (low, high) = (&low[..reach], &high[..reach]);
        let zero = simd.splat_f32x8(0.0);
        let (mut plane, mut plane_dx, mut plane_dy) = (zero, zero, zero);
        for b in 0..4 {
            let (mut line, mut line_dx) = (zero, zero);
            for a in 0..4 {
                let at = a * strides[0] + b * strides[1];
                let row = joined(simd, [row(low, at), row(high, at)]);
                line = product_added(simd, line, self.x[a], row);
                line_dx = product_added(simd, line_dx, self.dx[a], row);
            }
            plane = product_added(simd, plane, self.y[b], line);
            plane_dx = product_added(simd, plane_dx, self.y[b], line_dx);
            plane_dy = product_added(simd, plane_dy, self.dy[b], line);
        }
        // Neighbours are added first, then the pairs, as of one point.
        let sum = |a: f32x8, b: f32x8| -> f32x8 { cast(simd.avx._mm256_hadd_ps(cast(a), cast(b))) };
        let first = sum(simd.mul_f32x8(self.z, plane), simd.mul_f32x8(self.z, plane_dx));
        let second = sum(simd.mul_f32x8(self.z, plane_dy), simd.mul_f32x8(self.dz, plane));
        let [[v, x, y, z], [w, r, s, t]]: [[f32; 4]; 2] = cast(sum(first, second));
        [(v, [x, y, z]), (w, [r, s, t])]
    }

    /// Adds `v·B + Σ g·∂B` to the coefficients of each, which begin at `start`; the first point's first.
    #[inline(always)]
    pub fn scatter(
        &self,
        values: &mut [f32],
        start: [usize; 2],
        strides: [usize; 2],
        [low, high]: [(f32, [f32; 3]); 2],
    ) {
        let (simd, reach) = (self.simd, reach(strides));
        let v = each(simd, [low.0, high.0]);
        let g = [
            each(simd, [low.1[0], high.1[0]]),
            each(simd, [low.1[1], high.1[1]]),
            each(simd, [low.1[2], high.1[2]]),
        ];
        let along = product_added(simd, simd.mul_f32x8(v, self.z), g[2], self.dz);
        let mut seconds = [simd.splat_f32x4(0.0); 16];
        let out = &mut values[start[0]..][..reach];
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
                add(simd, out, a * strides[0] + b * strides[1], first);
                seconds[4 * b + a] = second;
            }
        }
        let out = &mut values[start[1]..][..reach];
        for b in 0..4 {
            for a in 0..4 {
                add(simd, out, a * strides[0] + b * strides[1], seconds[4 * b + a]);
            }
        }
    }
}

#[inline(always)]
fn add(simd: V3, out: &mut [f32], at: usize, added: f32x4) {
    let sum: [f32; 4] = cast(simd.add_f32x4(row(out, at), added));
    out[at..at + 4].copy_from_slice(&sum);
}
