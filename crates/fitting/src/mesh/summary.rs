//! What a fit of a mesh says of itself: distances from points of the surface to the zero set, leaf by leaf.

use std::ops::Range;

use bspline::{Field, HierarchicalSpline, Real};
use glam::DVec3;
use rayon::prelude::*;

use super::Plan;
use super::distance::MeshDistance;
use super::judge::{LEAST_SLOPE, Misses, Quality};
use super::levels::BENDING;
use crate::points::BASE_DEPTH;
use crate::{FitReport, Leaf, StopReason};

/// Random points of the surface at which the whole field is measured.
const SAMPLES: usize = 30_000;

/// A leaf as it was judged.
pub(super) struct LeafCell {
    pub depth: usize,
    pub at: [u32; 3],
    pub reason: StopReason,
    pub found: Quality,
    /// Points of its surface, if cells beside it were split: what was found may have moved.
    pub feet: Range<usize>,
}

/// What stays above the tolerance for one reason; the area in the unit box.
#[derive(Clone, Copy, Default)]
struct Above {
    leaves: usize,
    area: f64,
    max: f64,
}

/// Measures the finished field. Errors of leaves that nothing changed beside are those of their own level.
pub(super) fn summary<T: Real>(
    mesh: &MeshDistance,
    plan: &Plan,
    field: &HierarchicalSpline<T>,
    leaves: &[LeafCell],
    feet: &[DVec3],
    triangles: usize,
) -> FitReport {
    let found: Vec<Quality> = leaves
        .par_iter()
        .with_min_len(256)
        .map(|leaf| {
            let mut found = leaf.found;
            if !leaf.feet.is_empty() {
                found.feet = Misses::default();
                for &foot in &feet[leaf.feet.clone()] {
                    let (f, slope) = field.value_gradient(mesh.origin + foot * mesh.scale);
                    found.feet.add((f / mesh.scale, slope));
                }
            }
            found
        })
        .collect();
    let tolerance = plan.tolerance * mesh.scale;
    let mut out = FitReport {
        input_count: triangles,
        used_count: triangles,
        coefficients: field.coefficient_count(),
        depth: BASE_DEPTH + field.level_count() - 1,
        tolerance,
        smoothing: BENDING,
        ..FitReport::default()
    };
    let mut area = 0.0;
    let mut above = [Above::default(); StopReason::Crease as usize + 1];
    for (leaf, q) in leaves.iter().zip(&found) {
        let rms = q.feet.rms() * mesh.scale;
        let max = q.feet.max.max(q.corners.max) * mesh.scale;
        let own_area = q.area(0.5f64.powi(leaf.depth as i32));
        area += own_area;
        let is_over = rms > tolerance;
        let reason = match leaf.reason {
            StopReason::Tolerance if is_over => StopReason::Neighbours,
            reason => reason,
        };
        if is_over {
            let a = &mut above[reason as usize];
            (a.leaves, a.area, a.max) = (a.leaves + 1, a.area + own_area, a.max.max(max));
        }
        out.max = out.max.max(max);
        out.leaves.push(Leaf {
            level: (leaf.depth - BASE_DEPTH) as u8,
            cell: leaf.at,
            sample_count: q.feet.count,
            rms: rms as f32,
            max: max as f32,
            reason,
        });
    }
    let mut errors: Vec<f64> = mesh
        .surface_samples(SAMPLES)
        .par_iter()
        .with_min_len(1024)
        .map(|&p| {
            let (f, slope) = field.value_gradient(p);
            f.abs() / slope.length().max(LEAST_SLOPE)
        })
        .collect();
    out.rms = (errors.iter().map(|e| e * e).sum::<f64>() / SAMPLES as f64).sqrt();
    out.max = errors.iter().copied().fold(out.max, f64::max);
    out.p95 = *errors
        .select_nth_unstable_by(SAMPLES * 95 / 100, f64::total_cmp)
        .1;
    out.bound = out.max + field.rounding_bound();
    out.notes = notes(&above, area);
    out
}

/// Sentences on what stays above the tolerance, where anything does.
fn notes(above: &[Above], area: f64) -> Vec<String> {
    let reasons = [
        (
            StopReason::Crease,
            "at edges of the surface, which a smooth field rounds off: half the error there costs twice the coefficients",
        ),
        (StopReason::Depth, "at the deepest level allowed"),
        (StopReason::Budget, "because the coefficients allowed are spent"),
        (StopReason::Memory, "because the memory allowed is spent"),
    ];
    let told = reasons.into_iter().filter_map(|(reason, why)| {
        let a = above[reason as usize];
        (a.leaves > 0).then(|| {
            format!(
                "{:.2} % of the surface, in {} leaves, is above the tolerance, at most {:.3e} off: {why}",
                100.0 * a.area / area,
                a.leaves,
                a.max,
            )
        })
    });
    told.collect()
}
