//! What a fit of a mesh says of itself: distances from points of the surface to the zero set, leaf by leaf.

use bspline::{HierarchicalSpline, Real};
use glam::DVec3;

use super::Plan;
use super::distance::MeshDistance;
use super::judge::LeafCell;
use super::measure::measure;
use super::thin::TooThin;
use crate::level::BASE_DEPTH;
use crate::{FitReport, Leaf, StopReason};

/// What stays above the tolerance for one reason; the area in the unit box.
#[derive(Clone, Copy, Default)]
struct Above {
    leaves: usize,
    area: f64,
    max: f64,
}

/// Measures the finished field.
pub(super) fn summary<T: Real>(
    mesh: &MeshDistance,
    plan: &Plan,
    field: &HierarchicalSpline<T>,
    cells: &[LeafCell],
    feet: &[DVec3],
    too_thin: &TooThin,
    triangles: usize,
) -> FitReport {
    let mut leaves: Vec<Leaf> = cells
        .iter()
        .map(|c| Leaf {
            level: (c.depth - BASE_DEPTH) as u8,
            cell: c.at,
            sample_count: 0,
            rms: 0.0,
            max: 0.0,
            reason: c.reason,
        })
        .collect();
    let found = measure(field, mesh, &leaves, |i, out| {
        out.extend_from_slice(&feet[cells[i].feet.clone()]);
    })
    .errors;
    let tolerance = plan.tolerance * mesh.scale;
    let mut area = 0.0;
    let mut above = [Above::default(); StopReason::Thin as usize + 1];
    for ((leaf, cell), error) in leaves.iter_mut().zip(cells).zip(&found.leaves) {
        (leaf.sample_count, leaf.rms, leaf.max) = (error.count, error.rms as f32, error.max as f32);
        area += cell.area;
        if leaf.is_above(tolerance) {
            if leaf.reason == StopReason::Tolerance {
                leaf.reason = StopReason::Neighbours;
            }
            let a = &mut above[leaf.reason as usize];
            (a.leaves, a.area, a.max) = (a.leaves + 1, a.area + cell.area, a.max.max(error.max));
        }
    }
    let mut notes = notes(&above, area);
    if too_thin.area > 0.0 {
        let length = |l: f64| l * mesh.scale;
        notes.push(format!(
            "parts and gaps thinner than {:.3e} are left out, with {:.2} % of the surface: the thinnest found, {:.3e}, would \
             show in shreds with less than {} coefficients, about, on levels down to {}; raise the coefficients and the \
             depth allowed",
            length(too_thin.shown),
            100.0 * too_thin.area / area,
            length(too_thin.least),
            too_thin.coefficients,
            too_thin.depth,
        ));
    }
    FitReport {
        input_count: triangles,
        used_count: triangles,
        coefficients: field.coefficient_count(),
        depth: BASE_DEPTH + field.level_count() - 1,
        tolerance,
        rms: found.rms,
        p95: found.p95,
        max: found.max,
        bound: found.bound,
        leaves,
        notes,
        ..FitReport::default()
    }
}

/// Sentences on what stays above the tolerance, where anything does.
fn notes(above: &[Above], area: f64) -> Vec<String> {
    let reasons = [
        (
            StopReason::Crease,
            "where it falls slowly with finer knots, as at edges, which a smooth field rounds off: it is left there, however many coefficients are allowed",
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
