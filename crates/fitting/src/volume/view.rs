//! What is fitted, and how: the input of a volume fit, checked.

use bspline::Aabb;
use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::quantile::quantiles;
use super::voxels::{Number, Voxels, each};
use crate::FitError;

/// Largest magnitude that can be fitted: coefficients, up to 27 times a voxel, have to stay finite in `f32`.
const LARGEST: f32 = f32::MAX / 1024.0;

/// A volume of densities on a regular grid, borrowed.
#[derive(Clone, Copy, Debug)]
pub struct VolumeView<'a> {
    /// Voxels along x, y, z.
    pub dims: [usize; 3],
    /// Densities, as many as there are voxels.
    pub values: Voxels<'a>,
    /// Voxel indices (voxel centres on integers) to world.
    pub world_from_voxel: DAffine3,
}

/// How the coefficients are chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum VolumeMethod {
    /// Least squares on few functions, chosen one by one where the density needs them.
    #[default]
    Adaptive,
    /// One coefficient per voxel, exact at every voxel.
    Interpolate,
}

/// Options of a volume fit; the default asks for what the noise justifies.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VolumeOptions {
    /// How the coefficients are chosen.
    pub method: VolumeMethod,
    /// Largest rms residual of a leaf, a density, `> 0`.
    pub tolerance: Option<f64>,
    /// Largest number of coefficients, at least 64. Alone it is spent whole, as far as that lowers the residual.
    pub coefficients: Option<usize>,
    /// Finest level that may be used; level 0 has a knot every 4 voxels unless the number of coefficients asks for
    /// fewer.
    pub max_depth: Option<usize>,
    /// Weight `μ >= 0` of the ridge `μ Σ c²‖B‖²` on functions above level 0, against 1 for a voxel; 0 if not given.
    /// It shrinks detail to about `1/(1 + μ)` and leaves out what falls below the tolerance by that; dense voxels do not
    /// need it.
    pub smoothing: Option<f64>,
}

/// What a look at every voxel tells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Overview {
    pub min: f32,
    pub max: f32,
    /// 1st and 99th percentile.
    pub percentiles: [f32; 2],
}

impl Overview {
    /// Range that percentages of densities refer to.
    pub fn range(&self) -> f64 {
        let [low, high] = self.percentiles.map(f64::from);
        if high > low {
            high - low
        } else {
            f64::from(self.max) - f64::from(self.min)
        }
    }

    /// Largest magnitude.
    pub fn magnitude(&self) -> f64 {
        f64::from(self.min.abs().max(self.max.abs()))
    }
}

impl VolumeView<'_> {
    /// Looks at every voxel once.
    ///
    /// # Errors
    /// [`FitError::NotEnoughSamples`] for a volume without voxels, [`FitError::Degenerate`] if the number of
    /// values is not that of the dimensions, the map to the world cannot be inverted, or a voxel is not finite or
    /// too large; the sentence says where and what would help.
    pub(crate) fn check(&self) -> Result<Overview, FitError> {
        let [nx, ny, nz] = self.dims;
        if self.dims.contains(&0) {
            return Err(FitError::NotEnoughSamples { found: 0, needed: 1 });
        }
        if nx.checked_mul(ny).and_then(|n| n.checked_mul(nz)) != Some(self.values.len()) {
            return Err(FitError::Degenerate(format!(
                "a volume of {nx} × {ny} × {nz} voxels comes with {} values; correct the dimensions",
                self.values.len()
            )));
        }
        if let Some(n) = self.dims.into_iter().find(|&n| n > 1 << 28) {
            return Err(FitError::Degenerate(format!(
                "{n} voxels along an axis; at most 2^28 can be fitted: split the volume"
            )));
        }
        let map = self.world_from_voxel;
        if !map.is_finite() || !map.inverse().is_finite() || map.matrix3.determinant() == 0.0 {
            return Err(FitError::Degenerate(format!(
                "the map from voxels to world cannot be inverted: {:?}; correct the spacing or orientation",
                map.to_cols_array()
            )));
        }
        let (min, max, odd) = each!(self.values, values, _order => extremes(values));
        let place = |bad: fn(f32) -> bool| {
            let at = |i| [i % nx, i / nx % ny, i / (nx * ny)];
            let mut voxels = (0..self.values.len()).map(|i| (at(i), self.values.at(self.dims, at(i))));
            let ([x, y, z], value) = voxels.find(|v| bad(v.1)).expect("counted above");
            format!("voxel ({x}, {y}, {z}) is {value}")
        };
        if odd > 0 {
            return Err(FitError::Degenerate(format!(
                "{} ({odd} of {} voxels are not finite); replace them, for example by the value of air, before fitting",
                place(|v| !v.is_finite()),
                self.values.len()
            )));
        }
        if min.abs().max(max.abs()) > LARGEST {
            return Err(FitError::Degenerate(format!(
                "{}; magnitudes up to {LARGEST:e} can be fitted: divide the densities before fitting",
                place(|v| v.abs() > LARGEST)
            )));
        }
        Ok(Overview {
            min,
            max,
            percentiles: each!(self.values, values, _order => quantiles(values, [0.01, 0.99])),
        })
    }

    /// Range between the 1st and the 99th percentile, which shares of a density refer to; of the extremes where
    /// these percentiles coincide.
    ///
    /// # Errors
    /// As [`super::fit_volume`], for a volume that cannot be fitted.
    pub fn density_range(&self) -> Result<f64, FitError> {
        Ok(self.check()?.range())
    }

    /// Fall of the density per world length at the edges of what the volume shows: half of the sum of `|∇d|²` is of voxels
    /// where `|∇d|` is less. Noise, though there are far more voxels of it, has little share in that sum. For a constant
    /// volume, 1.
    pub(crate) fn edge_slope(&self, overview: &Overview) -> f64 {
        const PROBES: usize = 1 << 18;
        let [nx, ny, _] = self.dims;
        // Gradients are covectors: world gradient = inverse transpose · voxel gradient.
        let world = self.world_from_voxel.matrix3.inverse().transpose();
        let stride = self.values.len().div_ceil(PROBES);
        let mut magnitudes: Vec<f32> = (0..self.values.len())
            .step_by(stride)
            .map(|i| {
                let voxel = [i % nx, i / nx % ny, i / (nx * ny)];
                let difference = |a: usize| {
                    let (mut back, mut ahead) = (voxel, voxel);
                    back[a] = voxel[a].saturating_sub(1);
                    ahead[a] = (voxel[a] + 1).min(self.dims[a] - 1);
                    let steps = (ahead[a] - back[a]).max(1) as f64;
                    let at = |voxel| f64::from(self.values.at(self.dims, voxel));
                    (at(ahead) - at(back)) / steps
                };
                (world * DVec3::new(difference(0), difference(1), difference(2))).length() as f32
            })
            .collect();
        magnitudes.retain(|m| m.is_finite());
        magnitudes.sort_unstable_by(f32::total_cmp);
        let square = |m: &f32| f64::from(*m).powi(2);
        let half = 0.5 * magnitudes.iter().map(square).sum::<f64>();
        let mut sum = 0.0;
        let edge = magnitudes.iter().find(|m| {
            sum += square(m);
            sum > half
        });
        if let Some(edge) = edge {
            return f64::from(*edge);
        }
        let span = f64::from(overview.max) - f64::from(overview.min);
        let reach = Aabb {
            min: DVec3::ZERO,
            max: DVec3::new(self.dims[0] as f64, self.dims[1] as f64, self.dims[2] as f64),
        }
        .transformed(&self.world_from_voxel)
        .size()
        .length();
        if span > 0.0 && reach > 0.0 {
            span / reach
        } else {
            1.0
        }
    }
}

/// The least and the largest number, and how many are not finite.
fn extremes<N: Number>(values: &[N]) -> (f32, f32, usize) {
    let start = (f32::INFINITY, f32::NEG_INFINITY, 0_usize);
    values
        .par_chunks(1 << 16)
        .map(|chunk| {
            chunk.iter().fold(start, |(lo, hi, odd), &v| {
                let v = v.float();
                let bad = usize::from(!v.is_finite());
                (
                    if v < lo { v } else { lo },
                    if v > hi { v } else { hi },
                    odd + bad,
                )
            })
        })
        .reduce(|| start, |a, b| (a.0.min(b.0), a.1.max(b.1), a.2 + b.2))
}

impl VolumeOptions {
    /// Refuses values out of range and contradictions.
    pub(crate) fn check(&self) -> Result<(), FitError> {
        let refuse = |option, value, requirement| {
            Err(FitError::Option {
                option,
                value,
                requirement,
            })
        };
        if let Some(t) = self.tolerance
            && !(t > 0.0 && t.is_finite())
        {
            return refuse("tolerance", t, "it has to be a positive density");
        }
        if let Some(m) = self.smoothing
            && !(m >= 0.0 && m.is_finite())
        {
            return refuse("smoothing", m, "it has to be 0 or a positive number");
        }
        if self.method == VolumeMethod::Interpolate {
            const EXACT: &str = "the interpolating method takes one coefficient per voxel and leaves no residual; \
                leave the option out or choose the adaptive method";
            let given = [
                ("tolerance", self.tolerance),
                ("coefficients", self.coefficients.map(|n| n as f64)),
                ("max_depth", self.max_depth.map(|n| n as f64)),
                ("smoothing", self.smoothing),
            ];
            for (option, value) in given {
                if let Some(value) = value {
                    return refuse(option, value, EXACT);
                }
            }
        }
        Ok(())
    }
}
