//! Fits of oriented point clouds.

mod between;
pub(crate) mod cascade;
mod cells;
mod clusters;
mod coarse;
mod cross_validation;
mod directions;
mod far_field;
pub(crate) mod far_points;
mod feet;
mod invented;
#[cfg(test)]
mod iteration_growth;
mod measure;
pub(crate) mod noise;
mod pairs;
mod pieces;
mod plan;
mod residual;
pub use measure::{LeafError, PointError, PointErrors, crossing, measure_points, point_error};
pub use residual::newton_distance;
mod robust;
pub(crate) mod samples;
mod small_parts;
mod specks;
mod still;
mod support;

use bspline::{HierarchicalSpline, Real};

use crate::level::{BASE_DEPTH, MAX_DEPTH};
use crate::{Control, FitError, FitReport, StopReason};
use plan::{Plan, Smoothing};
pub use samples::OrientedPoints;
use samples::Samples;

/// What the caller may choose; `None` is chosen from the data.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointOptions {
    /// Rms distance per leaf, world units; 1e-4 of the diagonal if not given, 1.25 standard deviations of noise.
    pub tolerance: Option<f64>,
    /// Largest number of coefficients, at least [`LEAST_COEFFICIENTS`]. They are spent where the error is largest.
    /// Of clean clouds 270 000, or 0.7 a point if that is more, if neither they nor a tolerance nor a depth are given.
    pub coefficients: Option<usize>,
    /// Deepest level: `2^max_depth` cells along the box, from 6 to 16.
    pub max_depth: Option<usize>,
    /// Weight `μ` of the bending energy on the finest level.
    pub smoothing: Option<f64>,
    /// Whether points that the others contradict lose their weight.
    pub robust: bool,
    /// What a sample asks of the field beside its value.
    pub form: NormalForm,
}

/// How the normal of a sample enters the fit, on the levels that follow the surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NormalForm {
    /// As the gradient: `∇f(x) = -n`.
    #[default]
    Gradient,
    /// As two points off the surface, `f(x ± d n) = ∓d`.
    OffsetPairs,
}

/// Coefficients of the grid of 32³ cells that every field of points or of a mesh begins with.
pub const LEAST_COEFFICIENTS: usize = ((1 << BASE_DEPTH) + 3usize).pow(3);

/// Refuses a number of coefficients or a depth that the first grid alone exceeds.
pub(crate) fn check_limits(coefficients: Option<usize>, max_depth: Option<usize>) -> Result<(), FitError> {
    if let Some(n) = coefficients.filter(|&n| n < LEAST_COEFFICIENTS) {
        return Err(FitError::Option {
            option: "coefficients",
            value: n as f64,
            requirement: "the first grid of a cloud or a mesh alone has 42875; give at least as many",
        });
    }
    if let Some(depth) = max_depth.filter(|d| !(BASE_DEPTH + 1..=MAX_DEPTH).contains(d)) {
        return Err(FitError::Option {
            option: "max_depth",
            value: depth as f64,
            requirement: "a cloud or a mesh takes a finest level from 6 to 16",
        });
    }
    Ok(())
}

/// Points that a fit needs.
const LEAST_POINTS: usize = 10;
/// Rounds of conditions against pieces that no sample speaks for.
const REPAIR_ROUNDS: i32 = 3;

/// What a budget that the caller has not asked for left undone.
fn budget_spent(report: &FitReport) -> Option<String> {
    let total = report.leaves.len();
    let stopped = report.stopped_by(StopReason::Budget);
    (stopped > 0).then(|| {
        format!(
            "{stopped} of {total} leaves are coarser than the tolerance asks for: the coefficients of a default fit are \
             spent, a tolerance or a number of coefficients allows more"
        )
    })
}

/// Fits a signed distance, positive inside, to points with outward normals.
///
/// # Errors
/// See [`FitError`].
pub fn fit_points<T: Real>(
    cloud: &OrientedPoints<'_>,
    options: &PointOptions,
    control: &mut Control,
) -> Result<(HierarchicalSpline<T>, FitReport), FitError> {
    check_limits(options.coefficients, options.max_depth)?;
    control.step("sorting points", 0.0)?;
    control.reserve(cascade::level_bytes::<T>(0, cloud.positions.len()))?;
    let mut samples = Samples::prepare(*cloud)?;
    let mut tree = support::tree(&samples.positions);
    if let Some(all) = tree.as_ref().filter(|_| options.robust) {
        control.step("weighing points", 0.03)?;
        robust::weigh_by_support(&mut samples, all);
        if let Some(near) = far_points::without_far(&samples, *cloud)? {
            samples = near;
            tree = support::tree(&samples.positions);
            if let Some(near) = &tree {
                robust::weigh_by_support(&mut samples, near);
            }
        }
    } else if let Some(tree) = &tree {
        let doubt = far_points::doubt(&samples).or_else(|| support::doubt(&samples, tree));
        samples.notes.extend(doubt);
    }
    // Below the default tolerance noise does not matter; above, it does even to a caller who asks for less.
    let default_tolerance = 1e-4 * samples.diagonal / samples.scale;
    let tolerance = options.tolerance.map_or(default_tolerance, |t| t / samples.scale);
    samples.notes.extend(far_field::doubt_of_inward(&samples));
    let noise = match (&tree, options.smoothing) {
        (Some(tree), None) => noise::estimate(&samples, tree, default_tolerance.min(tolerance)),
        _ => None,
    };
    drop(tree);
    let mut plan = Plan::new(&samples, options, tolerance, noise);
    if noise.is_none() && directions::are_doubtful(&samples) {
        directions::refine::<T>(&mut samples, &plan, control)?;
    }
    control.step("fitting coarse levels", 0.05)?;
    let (mut base, mut solves) = if options.robust {
        robust::reweigh::<T>(&mut samples, &plan, control)?
    } else {
        coarse::solve(&samples, plan.beta, false)
    };
    if options.robust {
        samples.notes.push(robust::account(&samples));
    }
    let (turned, small) = far_field::settle(&mut base, &samples);
    plan.shows(&small);
    if turned > 0 {
        samples.notes.push(format!(
            "the sign of {turned} coefficients far from all points was turned over: the winding number of the points \
             contradicts them"
        ));
    }
    if let (Some(sigma), Some(beta)) = (noise, plan.second_beta) {
        let first = cascade::run::<T>(&samples, &base, &plan, 0.09..0.1, control)?;
        let field = samples.field(&base, &first.levels);
        let on_feet = feet::on_feet(&samples, &field, sigma);
        if on_feet.live_points().count() >= LEAST_POINTS {
            samples = on_feet;
            plan.beta = beta;
        }
        let without = samples.weights.iter().filter(|w| **w == 0.0).count();
        if without > 0 && !options.robust {
            samples.notes.push(format!(
                "{without} of {} noisy points lie on no sheet that the first fit found; they are measured, but not fitted",
                samples.positions.len()
            ));
        }
    }
    if let Some(sigma) = noise {
        let start = plan.smoothing.at(plan.max_depth, plan.max_depth);
        let mu = cross_validation::choose::<T>(&samples, &base, &plan, start, sigma, control)?;
        plan.smoothing = Smoothing::Halving(mu);
    }
    if options.form == NormalForm::OffsetPairs
        && let Some(tree) = support::tree(&samples.positions)
    {
        let spacing = samples.mean_spacing(0.0);
        let (paired, account) = pairs::with_offset_pairs(&samples, &tree, spacing);
        samples = paired;
        samples.notes.push(account);
        plan.form = NormalForm::OffsetPairs;
    }
    plan.seeks_extrema = true;
    let mut rounds = 0;
    let (cascade, field) = loop {
        // A round of repair costs what the first run did; most clouds need none.
        let begin = 0.9 - 0.6 * 0.5f64.powi(rounds);
        let end = 0.9 - 0.3 * 0.5f64.powi(rounds);
        let cascade = cascade::run::<T>(&samples, &base, &plan, begin..end, control)?;
        let field = samples.field(&base, &cascade.levels);
        let mut conditions = pieces::conditions(&field, &samples);
        if noise.is_some() {
            conditions.extend(far_field::beyond(&field, &samples, 0.5 * pieces::width(&field)));
        }
        if conditions.is_empty() || rounds == REPAIR_ROUNDS {
            break (cascade, field);
        }
        rounds += 1;
        far_field::turn_over(&mut base, &samples, &conditions, pieces::width(&field));
        samples = samples.with_sign_conditions(&conditions);
        samples.notes.push(format!(
            "{} cells whose sign no sample speaks for were turned over (round {rounds})",
            conditions.len()
        ));
    };
    let (field, specks) = specks::remove(field, &samples, &cascade.still, plan.coefficients);
    if specks > 0 {
        samples.notes.push(format!(
            "specks of solid or cavity without a point of their own taken out: {specks}"
        ));
    }
    control.step("measuring", 0.95)?;
    let mut report = residual::report(&field, &samples, &cascade, cloud.positions, &plan, noise);
    solves.extend(&cascade.solves);
    report.told_solves(solves);
    if options.coefficients.is_none() {
        report.notes.extend(budget_spent(&report));
    }
    Ok((field, report))
}
