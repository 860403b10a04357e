//! Fits of oriented point clouds.

pub(crate) mod assemble;
pub(crate) mod band;
pub(crate) mod band_solve;
pub(crate) mod cascade;
mod cells;
mod clusters;
mod coarse;
mod cross_validation;
mod far_field;
pub(crate) mod full_grid;
#[cfg(test)]
mod iteration_growth;
pub(crate) mod noise;
mod plan;
mod residual;
pub use residual::newton_distance;
pub(crate) mod samples;
pub(crate) mod stencil;

use bspline::{HierarchicalSpline, Real};

use crate::{Control, FitError, FitReport};
use plan::{Plan, Smoothing};
pub use samples::OrientedPoints;
use samples::Samples;
pub(crate) use samples::{BASE_DEPTH, MAX_DEPTH};

/// What the caller may choose; `None` is chosen from the data.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointOptions {
    /// Rms distance per leaf, world units.
    pub tolerance: Option<f64>,
    /// No level is begun once so many coefficients are spent.
    pub coefficients: Option<usize>,
    /// Deepest level: `2^max_depth` cells along the box.
    pub max_depth: Option<usize>,
    /// Weight `μ` of the bending energy on the finest level.
    pub smoothing: Option<f64>,
}

/// Rounds of conditions against pieces that no sample speaks for.
const REPAIR_ROUNDS: i32 = 3;

/// Fits a signed distance, positive inside, to points with outward normals.
///
/// # Errors
/// See [`FitError`].
pub fn fit_points<T: Real>(
    cloud: &OrientedPoints<'_>,
    options: &PointOptions,
    control: &mut Control,
) -> Result<(HierarchicalSpline<T>, FitReport), FitError> {
    control.step("sorting points", 0.0)?;
    control.reserve(cascade::level_bytes::<T>(0, cloud.positions.len()))?;
    let mut samples = Samples::prepare(*cloud)?;
    // Below the default tolerance noise does not matter; above, it does even to a caller who asks for less.
    let default_tolerance = 1e-4 * samples.diagonal / samples.scale;
    let tolerance = options.tolerance.map_or(default_tolerance, |t| t / samples.scale);
    let noise = match options.smoothing {
        None => noise::estimate(&samples, default_tolerance.min(tolerance)),
        Some(_) => None,
    };
    let mut plan = Plan::new(&samples, options, tolerance, noise);
    control.step("fitting coarse levels", 0.05)?;
    let base = coarse::solve(&samples, plan.beta);
    if let Some(sigma) = noise {
        let mu = cross_validation::choose::<T>(&samples, &base, &plan, sigma, control)?;
        plan.smoothing = Smoothing::Halving(mu);
    }
    let mut rounds = 0;
    let (cascade, field) = loop {
        // A round of repair costs what the first run did; most clouds need none.
        let begin = 0.9 - 0.6 * 0.5f64.powi(rounds);
        let end = 0.9 - 0.3 * 0.5f64.powi(rounds);
        let cascade = cascade::run::<T>(&samples, &base, &plan, begin..end, control)?;
        let field = assemble::assemble(&samples, &base, &cascade.levels);
        let conditions = far_field::conditions(&field, &samples);
        if conditions.is_empty() || rounds == REPAIR_ROUNDS {
            break (cascade, field);
        }
        rounds += 1;
        samples = samples.with_sign_conditions(&conditions);
        samples.notes.push(format!(
            "{} cells whose sign no sample speaks for were turned over (round {rounds})",
            conditions.len()
        ));
    };
    control.step("measuring", 0.95)?;
    let report = residual::report(&field, &samples, &cascade, cloud.positions.len(), &plan, noise);
    Ok((field, report))
}
