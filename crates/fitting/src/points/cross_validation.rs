//! Smoothing of noisy clouds by generalized cross-validation.
//!
//! `GCV(μ) = r / (1 - 1.2 t)`: `r` the rms residual, `t = tr(S)/N` the share of a point that the fit takes over, from
//! one probe of random signs: `S` maps value targets to fitted values. The factor over 1 is the usual guard against
//! too little smoothing (Kim and Gu, *Smoothing spline Gaussian regression*, 2004, §4, find 1.2 to 1.4); on a thin
//! scan, where points that took the wrong sheet for theirs agree with it, 1 smooths four times too little.
//!
//! The residual of a point on its foot is `f(y) - δ`. Of others it is the Newton distance: `|f|/|∇f|` misleads, since
//! `|∇f|` falls well below 1 under strong smoothing. Residuals beyond `3σ̂` count as `3σ̂`: the few points whose sheet a
//! fit has lost would decide otherwise (five draws of 0.5 % noise on one scan: fwd rms 14.3 median without, 13.0 with).

use bspline::{Field, Real};

use super::cascade;
use super::plan::{Plan, Smoothing};
use super::residual::newton_distance;
use super::samples::Samples;
use crate::level::full_grid::FullGrid;
use crate::{Control, FitError};

/// Fits at most, each with its probe.
const TRIES: usize = 9;

/// Points at which a fit is judged, at least, where there are so many.
const JUDGED: usize = 50_000;
/// Factor of the trace.
const TRACE_FACTOR: f64 = 1.2;

/// The `μ` of least GCV on a ladder of factor 2, begun with steps of 4 from `start`, and then where the parabola through
/// the best and its neighbours is lowest. `noise` is `σ̂`, unit box.
pub(crate) fn choose<T: Real>(
    samples: &Samples,
    base: &FullGrid<f64>,
    plan: &Plan,
    start: f64,
    noise: f64,
    control: &mut Control,
) -> Result<f64, FitError> {
    let mut tried: Vec<(i32, f64)> = Vec::new();
    let mut at = |exponent: i32, control: &mut Control| -> Result<f64, FitError> {
        if let Some(known) = tried.iter().find(|t| t.0 == exponent) {
            return Ok(known.1);
        }
        if tried.len() == TRIES {
            return Ok(f64::INFINITY);
        }
        control.step("choosing the smoothing", 0.1 + 0.02 * tried.len() as f64)?;
        let plan = Plan {
            smoothing: Smoothing::Halving(start * 2f64.powi(exponent)),
            ..plan.clone()
        };
        let gcv = score::<T>(samples, base, &plan, noise, control)?;
        tried.push((exponent, gcv));
        Ok(gcv)
    };
    let mut best = 0;
    for step in [2, 1] {
        loop {
            let here = at(best, control)?;
            if at(best + step, control)? < here {
                best += step;
            } else if at(best - step, control)? < here {
                best -= step;
            } else {
                break;
            }
        }
    }
    let [less, here, more] = [best - 1, best, best + 1].map(|e| at(e, control));
    Ok(start * 2f64.powf(f64::from(best) + lowest_of_parabola(less?, here?, more?)))
}

/// Where the parabola through `(-1, a)`, `(0, b)`, `(1, c)` is lowest, `b` the least of the three.
fn lowest_of_parabola(a: f64, b: f64, c: f64) -> f64 {
    let curvature = a - 2.0 * b + c;
    if curvature > 0.0 && curvature.is_finite() {
        (0.5 * (a - c) / curvature).clamp(-0.5, 0.5)
    } else {
        0.0
    }
}

fn score<T: Real>(
    samples: &Samples,
    base: &FullGrid<f64>,
    plan: &Plan,
    noise: f64,
    control: &Control,
) -> Result<f64, FitError> {
    let quiet = &mut control.quiet();
    let n = samples.positions.len();
    let any_moved = (0..n).any(|i| samples.is_moved(i));
    let judged: Vec<usize> = (0..n)
        .step_by((n / JUDGED).max(1))
        .filter(|&i| samples.weights[i] > 0.0 && samples.is_moved(i) == any_moved)
        .collect();
    let cascade = cascade::run::<T>(samples, base, plan, 0.0..1.0, quiet)?;
    let field = samples.field(base, &cascade.levels);
    let limit = 3.0 * noise * samples.scale;
    let residual = |i: usize| {
        if any_moved {
            let wanted = samples.targets[i] as f64 * samples.scale;
            (field.value(samples.world_of_conditions(i)) - wanted).abs()
        } else {
            newton_distance(&field, samples.world(i)).0
        }
    };
    let square: f64 = judged.iter().map(|&i| residual(i).min(limit).powi(2)).sum();

    let signs = random_signs(n);
    let zero = FullGrid::zeros(base.n);
    let probe = Plan {
        probe: Some(signs.clone()),
        ..plan.clone()
    };
    let answer = cascade::run::<T>(samples, &zero, &probe, 0.0..1.0, quiet)?;
    let field = samples.field(&zero, &answer.levels);
    let answers = |i: usize| signs[i] as f64 * field.value(samples.world_of_conditions(i));
    let trace: f64 = judged.iter().map(|&i| answers(i)).sum::<f64>() / samples.scale;
    let taken_over = (trace / judged.len() as f64).clamp(0.0, 0.8);
    Ok((square / judged.len() as f64).sqrt() / (1.0 - TRACE_FACTOR * taken_over))
}

/// ±1 from a fixed multiplicative hash of the index.
fn random_signs(n: usize) -> Vec<f32> {
    let sign = |i: usize| {
        let mut x = (i as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        if x >> 63 == 0 { 1.0 } else { -1.0 }
    };
    (0..n).map(sign).collect()
}
