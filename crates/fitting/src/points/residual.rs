//! The fit's own account of its error: Newton distances of the samples to the zero set.

use bspline::{Field, HierarchicalSpline, Real};
use glam::DVec3;
use rayon::prelude::*;

use super::cascade::Cascade;
use super::plan::{Plan, Smoothing};
use super::samples::Samples;
use crate::{FitReport, Leaf, StopReason};

/// Steps of the projection.
const NEWTON_STEPS: usize = 5;

/// Distance from `p` to the zero set of `field`, found by Newton steps along the gradient, and `|f(p)|`.
///
/// Steps stop when they are under a hundredth of the way gone. Where the gradient vanishes the way gone so far
/// is returned.
pub fn newton_distance(field: &dyn Field, p: DVec3) -> (f64, f64) {
    let (x, _, first) = newton(field, p);
    ((x - p).length(), first.abs())
}

/// Where the steps of [`newton_distance`] end, and the gradient met last.
pub(crate) fn newton_foot(field: &dyn Field, p: DVec3) -> (DVec3, DVec3) {
    let (x, gradient, _) = newton(field, p);
    (x, gradient)
}

/// End of the steps, gradient before the last of them, and `f(p)`.
fn newton(field: &dyn Field, p: DVec3) -> (DVec3, DVec3, f64) {
    let (first, mut gradient) = field.value_gradient(p);
    let (mut x, mut value) = (p, first);
    for step in 0..NEWTON_STEPS {
        let steepness = gradient.length_squared();
        if steepness < 1e-12 {
            break;
        }
        let move_by = gradient * (-value / steepness);
        x += move_by;
        if step + 1 == NEWTON_STEPS || move_by.length() <= 0.01 * (x - p).length() {
            break;
        }
        (value, gradient) = field.value_gradient(x);
    }
    (x, gradient, first)
}

pub(crate) fn report<T: Real>(
    field: &HierarchicalSpline<T>,
    samples: &Samples,
    cascade: &Cascade<T>,
    input_count: usize,
    plan: &Plan,
    noise: Option<f64>,
) -> FitReport {
    // Outliers are no part of the surface whose error this is.
    let is_counted = |i: usize| !samples.is_sign_condition(i) && (!plan.robust || samples.weights[i] > 0.0);
    let measured: Vec<Option<(f64, f64)>> = (0..samples.positions.len())
        .into_par_iter()
        .with_min_len(4096)
        .map(|i| is_counted(i).then(|| newton_distance(field, samples.world(i))))
        .collect();
    let leaves = cascade.leaves.iter().map(|leaf| {
        let part = measured[leaf.start as usize..leaf.end as usize].iter().flatten();
        let (count, square, max) = part.fold((0u32, 0.0, 0.0f64), |(n, s, m), d| {
            (n + 1, s + d.0 * d.0, m.max(d.0))
        });
        let rms = (square / f64::from(count.max(1))).sqrt();
        let moved = leaf.reason == StopReason::Tolerance && rms > plan.tolerance * samples.scale;
        Leaf {
            level: (leaf.depth - super::samples::BASE_DEPTH) as u8,
            cell: leaf.at,
            sample_count: count,
            rms: rms as f32,
            max: max as f32,
            reason: if moved {
                StopReason::Neighbours
            } else {
                leaf.reason
            },
        }
    });
    let mut leaves: Vec<Leaf> = leaves.collect();
    let mut notes = samples.notes.clone();
    let invented = super::invented::leaves(field, samples, &leaves);
    if !invented.is_empty() {
        notes.push(format!(
            "the surface crosses {} cells of 1/64 of the box far from all points: it is invented there (leaves without \
             samples; a mesh can be trimmed there)",
            invented.len()
        ));
        leaves.extend(invented);
    }
    let mut distances: Vec<f64> = measured.iter().flatten().map(|m| m.0).collect();
    let count = distances.len();
    let rms = (distances.iter().map(|d| d * d).sum::<f64>() / count as f64).sqrt();
    let max = distances.iter().copied().fold(0.0, f64::max);
    let p95 = *distances
        .select_nth_unstable_by((count - 1) * 95 / 100, f64::total_cmp)
        .1;
    FitReport {
        input_count,
        used_count: count,
        coefficients: field.coefficient_count(),
        depth: super::samples::BASE_DEPTH + field.level_count() - 1,
        rms,
        p95,
        max,
        bound: measured.iter().flatten().map(|m| m.1).fold(0.0, f64::max) + field.rounding_bound(),
        noise: noise.map(|sigma| sigma * samples.scale),
        tolerance: plan.tolerance * samples.scale,
        smoothing: match plan.smoothing {
            Smoothing::Steps { finest, .. } => finest,
            Smoothing::Halving(mu) => mu,
        },
        leaves,
        signs: None,
        notes,
    }
}
