//! Robust fits: points that the others contradict lose their weight.
//!
//! Iteratively re-weighted least squares with the biweight of Beaton and Tukey (1974), `w(d) = (1 - (d/c)²)²` for
//! `d < c`, else 0, of Newton distances. The cut `c` is 4.685 standard deviations, estimated by the median absolute
//! deviation, and no less than half a cell, since a coarse fit errs by that much at details that are no outliers. It
//! falls with the cells from round to round (graduated non-convexity, Blake and Zisserman 1987). The first weights
//! come from [`support`](super::support), so that the coarse levels, where one outlier can fill a half-cell of its own,
//! never see most of the outliers.

use bspline::{Field, Real};
use rayon::prelude::*;

use super::plan::Plan;
use super::residual::newton_foot;
use super::samples::Samples;
use super::support::{self, Tree};
use super::{LEAST_POINTS, cascade, coarse};
use crate::level::BASE_DEPTH;
use crate::level::full_grid::FullGrid;
use crate::{Control, FitError, SolverOutcome};

/// Rounds after the one on the full levels, each one level deeper.
const ROUNDS: usize = 3;
/// Tukey's constant: 95 % efficiency on Gaussian noise.
const TUKEY: f64 = 4.685;
/// Standard deviations in a median absolute deviation.
const FROM_MAD: f64 = 1.4826;
/// Least cut in cells.
const LEAST_CUT: f64 = 0.5;
/// Cosine between a point's normal and the field's from which the normal costs no weight.
const FACING: f64 = 0.5;

/// The samples with weight only where their neighbours speak for them; all as they were, with a note, where hardly any
/// neighbours do. Points in no order have no surface to lie off, and a dozen points no neighbourhoods.
pub(crate) fn weigh_by_support(samples: &mut Samples, tree: &Tree) {
    let weights = support::weights(samples, tree);
    if live_count(&weights) >= LEAST_POINTS {
        samples.weights = weights;
    } else {
        samples.notes.push(format!(
            "the neighbours of all but {} of {} points contradict them, so none could be told for an outlier: all keep \
             their weight",
            live_count(&weights),
            weights.len()
        ));
    }
}

fn live_count(weights: &[f32]) -> usize {
    weights.iter().filter(|w| **w > 0.0).count()
}

/// Re-weighs `samples` by fits of growing depth. Returns the last coarse solution and how it was solved.
///
/// # Errors
/// [`FitError::Cancelled`].
pub(crate) fn reweigh<T: Real>(
    samples: &mut Samples,
    plan: &Plan,
    control: &mut Control,
) -> Result<(FullGrid<f64>, Vec<SolverOutcome>), FitError> {
    let mut base = coarse::solve(samples, plan.beta, true);
    let field = samples.field::<T>(&base.0, &[]);
    weigh(samples, &field, 0.5f64.powi(BASE_DEPTH as i32));
    base = coarse::solve(samples, plan.beta, true);
    for round in 0..ROUNDS {
        let depth = BASE_DEPTH + 1 + round;
        if depth > plan.max_depth {
            break;
        }
        control.step("weighing points", 0.06 + 0.01 * round as f64)?;
        let shallow = Plan {
            max_depth: depth,
            ..plan.clone()
        };
        let quiet = &mut control.quiet();
        let fit = cascade::run::<T>(samples, &base.0, &shallow, 0.0..1.0, quiet)?;
        let field = samples.field(&base.0, &fit.levels);
        weigh(samples, &field, 0.5f64.powi(depth as i32));
        base = coarse::solve(samples, plan.beta, true);
    }
    Ok(base)
}

/// Biweights of all points, from their distances to the zero set of `field`; `h` is its finest cell, unit box. A field
/// that passes nearly all points by, or faces the other way, is no judge of them: the weights stay.
fn weigh(samples: &mut Samples, field: &dyn Field, h: f64) {
    let found: Vec<(f64, f64)> = (0..samples.positions.len())
        .into_par_iter()
        .with_min_len(1024)
        .map(|i| {
            let x = samples.world(i);
            let (foot, gradient) = newton_foot(field, x);
            let normal = glam::DVec3::from(samples.normals[i].map(f64::from));
            let facing = -gradient.normalize_or_zero().dot(normal);
            ((foot - x).length() / samples.scale, facing)
        })
        .collect();
    let mut live: Vec<f64> = found
        .iter()
        .zip(&samples.weights)
        .filter(|(_, w)| **w > 0.0)
        .map(|(f, _)| f.0)
        .collect();
    if live.is_empty() {
        return;
    }
    let middle = live.len() / 2;
    let deviation = *live.select_nth_unstable_by(middle, f64::total_cmp).1;
    let cut = (TUKEY * FROM_MAD * deviation).max(LEAST_CUT * h);
    let weight = |(distance, facing): &(f64, f64)| {
        let share = (1.0 - (distance / cut).powi(2)).max(0.0).powi(2);
        (share * (facing / FACING).clamp(0.0, 1.0)) as f32
    };
    let weights: Vec<f32> = found.iter().map(weight).collect();
    if live_count(&weights) >= LEAST_POINTS {
        samples.weights = weights;
    }
}

/// How many points were left without weight, as a sentence.
pub(crate) fn account(samples: &Samples) -> String {
    let total = samples.weights.len();
    let outliers = samples.weights.iter().filter(|w| **w == 0.0).count();
    format!(
        "{outliers} of {total} points ({:.1} %) are outliers: the surface that the others agree on passes them by",
        100.0 * outliers as f64 / total.max(1) as f64
    )
}
