//! What the data itself says about the accuracy worth asking for.

use bspline::Real;

use super::detail::interpolation;
use super::domain::{Domain, Samples};
use super::quantile::quantiles;

/// Voxels looked at for the noise estimate: its own relative error is then about 0.1 %.
const PROBES: usize = 1 << 20;
/// Standard deviation over median absolute deviation of a normal distribution.
const SIGMA_PER_MAD: f64 = 1.4826;
/// Variance that the inverse of `[1, 4, 1]/6` gives to white noise of variance 1: `Σ_k h_k² = 2√3` with
/// `h_k = √3 (√3 - 2)^|k|`. The share of the noise that coarser levels took is below 1 % of its cube.
const GAIN_PER_AXIS: f64 = 3.464_101_615_137_754_6;
/// Least share of voxels that differ from a neighbour for flat regions to be left out. Below it the volume is
/// a clean drawing with sharp edges, whose edges are no noise.
const TEXTURED_SHARE: f64 = 0.25;

/// Standard deviation of white noise, estimated by the median absolute deviation of the finest residual
/// coefficients, in the scale of the samples.
///
/// `residual` is what a coarser fit left, at all samples (padding included); it is overwritten by the
/// finest coefficients. Voxels that equal both neighbours along x (air set to zero, saturated parts)
/// are left out where at least a quarter of the volume is textured.
pub(crate) fn noise_level<T: Real>(domain: &Domain<T>, samples: &Samples<T>, residual: &mut [T]) -> f64 {
    interpolation(domain, residual);
    let [px, py, _] = domain.padded();
    let [nx, ny, nz] = domain.samples();
    let n = nx * ny * nz;
    let stride = n.div_ceil(PROBES);
    let mut all = Vec::with_capacity(n / stride + 1);
    let mut textured = Vec::with_capacity(n / stride + 1);
    for i in (0..n).step_by(stride) {
        let (x, y, z) = (i % nx, i / nx % ny, i / (nx * ny));
        let magnitude = residual[(z * py + y) * px + x].abs().as_f64() as f32;
        all.push(magnitude);
        let at = |x| samples.values.at(samples.dims, [x, y, z]);
        let value = at(x);
        let flat = (x == 0 || at(x - 1) == value) && (x + 1 == nx || at(x + 1) == value);
        if !flat {
            textured.push(magnitude);
        }
    }
    let used = if textured.len() as f64 >= TEXTURED_SHARE * all.len() as f64 {
        textured
    } else {
        all
    };
    let [mad] = quantiles(&used, [0.5]);
    SIGMA_PER_MAD * f64::from(mad) / GAIN_PER_AXIS.powi(3).sqrt()
}
