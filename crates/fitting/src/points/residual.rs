//! The fit's own account of its error: Newton distances of the samples to the zero set.

use std::cell::OnceCell;

use bspline::{Field, HierarchicalSpline, Real};
use glam::DVec3;

use super::cascade::Cascade;
use super::measure::measure_in_order;
use super::plan::{Plan, Smoothing};
use super::samples::{ADDED, Samples};
use crate::level::BASE_DEPTH;
use crate::{FitReport, Leaf, LeafIndex, StopReason};

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

/// The fit's account of `field`, measured at the points of the cloud as they were given.
pub(crate) fn report<T: Real>(
    field: &HierarchicalSpline<T>,
    samples: &Samples,
    cascade: &Cascade<T>,
    positions: &[DVec3],
    plan: &Plan,
    noise: Option<f64>,
) -> FitReport {
    let tolerance = plan.tolerance * samples.scale;
    let mut leaves: Vec<Leaf> = cascade
        .leaves
        .iter()
        .map(|leaf| Leaf {
            level: (leaf.depth - BASE_DEPTH) as u8,
            cell: leaf.at,
            sample_count: 0,
            rms: 0.0,
            max: 0.0,
            reason: leaf.reason,
        })
        .collect();
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
    let leaf_of = leaves_of_points(field, samples, cascade, &leaves, plan.robust, positions);
    let counts = |i: usize| leaf_of[i] != LEFT_OUT;
    let in_leaf = |i: usize| Some(leaf_of[i] as usize).filter(|l| *l < leaves.len());
    let order: Vec<u32> = samples.source.iter().copied().filter(|&i| i != ADDED).collect();
    let errors = measure_in_order(field, positions, &order, counts, in_leaf, leaves.len());
    for (leaf, error) in leaves.iter_mut().zip(&errors.leaves) {
        leaf.sample_count = error.count;
        (leaf.rms, leaf.max) = (error.rms as f32, error.max as f32);
        if leaf.reason == StopReason::Tolerance && leaf.is_above(tolerance) {
            leaf.reason = StopReason::Neighbours;
        }
    }
    FitReport {
        input_count: positions.len(),
        used_count: errors.count,
        coefficients: field.coefficient_count(),
        depth: BASE_DEPTH + field.level_count() - 1,
        rms: errors.rms,
        p95: errors.p95,
        max: errors.max,
        bound: errors.bound,
        noise: noise.map(|sigma| sigma * samples.scale),
        tolerance,
        smoothing: match plan.smoothing {
            Smoothing::Steps { finest, .. } => finest,
            Smoothing::Halving(mu) => mu,
        },
        left_out: (0..positions.len())
            .filter(|&i| !counts(i))
            .map(|i| i as u32)
            .collect(),
        leaves,
        notes,
        ..FitReport::default()
    }
}

/// A point that no figure counts.
const LEFT_OUT: u32 = u32::MAX;
/// A point that counts, but lies in no leaf: noise carried it out of the cells of the surface.
const NO_LEAF: u32 = u32::MAX - 1;

/// The leaf of each point given, by where it was measured, or why it has none.
fn leaves_of_points<T: Real>(
    field: &HierarchicalSpline<T>,
    samples: &Samples,
    cascade: &Cascade<T>,
    leaves: &[Leaf],
    robust: bool,
    positions: &[DVec3],
) -> Vec<u32> {
    let mut leaf_of = vec![LEFT_OUT; positions.len()];
    // Made only where points were moved: the others are sorted into their leaves already.
    let index = OnceCell::new();
    for (i, &source) in samples.source.iter().enumerate() {
        // Outliers are no part of the surface whose error this is.
        if source == ADDED || robust && samples.weights[i] == 0.0 {
            continue;
        }
        leaf_of[source as usize] = NO_LEAF;
        if samples.is_moved(i) {
            let index = index.get_or_init(|| LeafIndex::new(field.lattice(), leaves));
            if let Some(leaf) = index.find(positions[source as usize]) {
                leaf_of[source as usize] = leaf as u32;
            }
        }
    }
    for (number, leaf) in cascade.leaves.iter().enumerate() {
        for i in leaf.start as usize..leaf.end as usize {
            let source = samples.source[i];
            if source != ADDED && !samples.is_moved(i) && leaf_of[source as usize] == NO_LEAF {
                leaf_of[source as usize] = number as u32;
            }
        }
    }
    leaf_of
}
