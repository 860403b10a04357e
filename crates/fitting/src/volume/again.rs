//! The errors of a finished field at the voxels, as the fit measured them.

use bspline::hierarchical::BRICK;
use bspline::{HierarchicalSpline, Real};

use super::active::ActiveSet;
use super::domain::{Domain, Samples};
use super::fit::{exponent_of, lattice};
use super::measure::measure;
use super::view::VolumeView;
use crate::FitError;

/// Most levels that a fit can have: knots every 2³¹ voxels.
const MOST_LEVELS: usize = 32;

/// Errors of a field at the voxels of a volume, densities.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VolumeErrors {
    /// Root of the mean square residual.
    pub rms: f64,
    /// 95th percentile of the absolute residuals.
    pub p95: f64,
    /// Largest absolute residual.
    pub max: f64,
    /// Sound bound on all of them, rounding of the evaluation included.
    pub bound: f64,
    /// Rms residual of each leaf, in the order of the fit's report.
    pub leaf_rms: Vec<f64>,
}

/// Measures `field` at the voxels of the volume that it was fitted to; the same bits as the report of the fit. `None` if
/// the grid of the field is not that of such a fit.
///
/// # Errors
/// As [`super::fit_volume`] for a volume that cannot be fitted, or cannot be held.
pub fn measure_volume<T: Real>(
    field: &HierarchicalSpline<T>,
    view: &VolumeView,
) -> Result<Option<VolumeErrors>, FitError> {
    let overview = view.check()?;
    let fits = |levels: &usize| lattice(view, 1 << (levels - 1)) == *field.lattice();
    let Some(levels) = (field.level_count()..MOST_LEVELS).find(fits) else {
        return Ok(None);
    };
    let scale = T::from_f64(2.0_f64.powi(-exponent_of(&overview)));
    let samples = Samples {
        values: view.values,
        dims: view.dims,
        scale,
    };
    let domain = Domain::<T>::new(view.dims, levels);
    let (active, stored): (Vec<ActiveSet>, Vec<Vec<T>>) = (0..levels)
        .map(|level| match level < field.level_count() {
            true => stored_level(field, level, &domain, scale),
            false => (ActiveSet::empty(domain.functions(level)), Vec::new()),
        })
        .unzip();
    let measured = measure(&samples, &domain, &active, &stored);
    let scale = scale.as_f64();
    Ok(Some(VolumeErrors {
        rms: measured.rms / scale,
        p95: measured.p95 / scale,
        max: measured.max / scale,
        bound: measured.bound / scale,
        leaf_rms: measured.leaves.iter().map(|l| l.rms() / scale).collect(),
    }))
}

/// The active functions of a level and their coefficients in the samples' scale, x fastest.
fn stored_level<T: Real>(
    field: &HierarchicalSpline<T>,
    level: usize,
    domain: &Domain<T>,
    scale: T,
) -> (ActiveSet, Vec<T>) {
    let size = domain.functions(level);
    let mut found: Vec<(usize, T)> = Vec::new();
    for (key, corrections) in &field.corrections(level) {
        let corner = key.0.map(|k| k as usize * BRICK);
        for (slot, value) in corrections.iter() {
            let at = [
                corner[0] + slot / 64,
                corner[1] + slot / 8 % 8,
                corner[2] + slot % 8,
            ];
            found.push(((at[2] * size[1] + at[1]) * size[0] + at[0], value * scale));
        }
    }
    found.sort_unstable_by_key(|f| f.0);
    let set = ActiveSet::from_indices(size, found.iter().map(|f| f.0));
    (set, found.into_iter().map(|f| f.1).collect())
}
