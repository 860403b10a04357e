//! The surface levels, coarse to fine: each level corrects the one before where the data ask for it.

use std::ops::Range;

use bspline::Real;

use super::between::Neighbours;
use super::cells::{Cell, LeafCell, cell_quality, children, judge, keep_within, root_cells};
use super::plan::Plan;
use super::samples::Samples;
use super::still::{StillCell, replace_refined, still_cells_of_base};
use super::{NormalForm, between};
use crate::level::BASE_DEPTH;
use crate::level::assemble::Level;
use crate::level::band::{BRICK_LEN, Band, Coarser, HALO_LEN, REACH, count_bricks_near, halo_start, key_of};
use crate::level::band_problem::{BandProblem, BandSample, BrickSamples};
use crate::level::full_grid::FullGrid;
use crate::level::stencil::Spot;
use crate::{Control, FitError, SolverOutcome, StopReason};

/// Samples of a cell beyond this many are thinned.
const SAMPLES_PER_CELL: u32 = 8;
/// Conditions between samples for each sample, about.
const BETWEEN_A_SAMPLE: usize = 3;

/// A whole cascade.
pub(crate) struct Cascade<T> {
    pub levels: Vec<Level<T>>,
    pub leaves: Vec<LeafCell>,
    /// What the solve of each level did.
    pub solves: Vec<SolverOutcome>,
    /// Where the field may have an extremum near the surface, if that was asked.
    pub still: Vec<StillCell>,
}

/// Runs the cascade from the full level `base` down. No level is begun that the memory ceiling has no room for, and no
/// more cells are split than the budget of coefficients allows, the worst first; the others say so. Progress is told from `span.start` to
/// `span.end`.
///
/// # Errors
/// [`FitError::Cancelled`].
pub(crate) fn run<T: Real>(
    samples: &Samples,
    base: &FullGrid<f64>,
    plan: &Plan,
    span: Range<f64>,
    control: &mut Control,
) -> Result<Cascade<T>, FitError> {
    let mut out = Cascade {
        levels: Vec::new(),
        leaves: Vec::new(),
        solves: Vec::new(),
        still: if plan.seeks_extrema {
            still_cells_of_base(base)
        } else {
            Vec::new()
        },
    };
    let mut split = root_cells(samples, plan);
    let mut worth: Vec<f64> = split.iter().map(|(c, _)| f64::from(c.end - c.start)).collect();
    let mut coarser: Option<Band<T>> = None;
    let mut coefficients = base.values.len();
    let mut neighbours = None;
    for depth in BASE_DEPTH + 1..=plan.max_depth {
        if let Some(limit) = plan.coefficients {
            let room = limit.saturating_sub(coefficients);
            let left_out = keep_within(room, samples, &mut split, &worth, depth);
            out.leaves.extend(left_out);
        }
        let cells = children(samples, &split, depth);
        let refined: Vec<[u32; 3]> = cells
            .iter()
            .filter(|c| c.refined && c.is_live)
            .map(|c| c.at)
            .collect();
        if refined.is_empty() {
            break;
        }
        let between = if plan.is_sparse(depth) {
            let refined = cells.iter().filter(|c| c.refined && c.is_live);
            BETWEEN_A_SAMPLE * refined.map(|c| (c.end - c.start) as usize).sum::<usize>()
        } else {
            0
        };
        if let Some(reason) = no_room::<T>(depth, &refined, samples.positions.len(), between, control) {
            let kept = split
                .iter()
                .filter(|s| s.1)
                .map(|(cell, _)| cell.leaf(depth - 1, reason));
            out.leaves.extend(kept);
            break;
        }
        // Each level costs about four times the one before.
        let share = 0.25f64.powi((plan.max_depth - depth) as i32 + 1);
        control.step(
            "fitting surface levels",
            span.start + (span.end - span.start) * share,
        )?;
        let mut band = match &coarser {
            None => Band::around(depth, &refined, &Coarser::Full(base)),
            Some(band) => Band::around(depth, &refined, &Coarser::Band(band)),
        };
        if neighbours.is_none() && plan.is_sparse(depth) {
            let ranges = cells.iter().filter(|c| c.refined).map(|c| c.start..c.end);
            neighbours = Some(Neighbours::of(samples, ranges));
        }
        let (list, bricks, owners) = band_samples(samples, &band, &cells, neighbours.as_ref(), plan, depth);
        let problem = BandProblem::new(&band, &list, &bricks, plan.weights(depth));
        let (x, report) = problem.solve(plan.residual, plan.iterations);
        band.add_active(&x);
        if plan.seeks_extrema {
            replace_refined(&mut out.still, &band);
        }
        coefficients += x.len();
        out.solves.push(report);
        let quality = cell_quality(&band, &list, &bricks, &owners, cells.len());
        split.clear();
        worth.clear();
        for (cell, q) in cells.iter().zip(&quality) {
            let spacing = neighbours
                .as_ref()
                .map_or(f32::INFINITY, |n| n.spacing[cell.start as usize]);
            let verdict = judge(cell, q, spacing, plan, depth);
            split.push((*cell, cell.refined && verdict.is_ok()));
            worth.push(q.worth());
            if let (true, Err(reason)) = (cell.refined, verdict) {
                out.leaves.push(cell.leaf(depth, reason));
            }
        }
        out.levels.push(Level {
            keys: band.keys.clone(),
            masks: band.masks.clone(),
            x,
        });
        coarser = Some(band);
    }
    out.still.retain(StillCell::leads);
    Ok(out)
}

/// Why the level of `depth` cannot be begun, if it cannot.
fn no_room<T: Real>(
    depth: usize,
    refined: &[[u32; 3]],
    sample_count: usize,
    between_count: usize,
    control: &Control,
) -> Option<StopReason> {
    // The bricks are counted only where someone asks.
    control.memory_limit?;
    let bricks = count_bricks_near(depth, refined, REACH);
    let between = between_count * (size_of::<BandSample<T>>() + between::BYTES);
    control
        .reserve(level_bytes::<T>(bricks, sample_count) + between as u64)
        .is_err()
        .then_some(StopReason::Memory)
}

/// Bytes held at once when the level with so many bricks is solved, or when the field is finished: the cloud and its
/// samples; this level's vectors and those of the one before, or the field's bricks, of which there are a quarter as many.
pub(crate) fn level_bytes<T>(bricks: usize, sample_count: usize) -> u64 {
    let per_brick = size_of::<T>() * (2 * HALO_LEN + 2 * BRICK_LEN) + 256;
    let per_sample = 2 * size_of::<[f64; 6]>() + size_of::<BandSample<T>>() + 32;
    (bricks * per_brick + sample_count * per_sample) as u64 + (8 << 20)
}

/// Samples of the cells whose brick is in the band, and the conditions between them, brick by brick; `owners[i]` is the
/// cell of sample `i`.
fn band_samples<T: Real>(
    samples: &Samples,
    band: &Band<T>,
    cells: &[Cell],
    neighbours: Option<&Neighbours>,
    plan: &Plan,
    depth: usize,
) -> (Vec<BandSample<T>>, Vec<BrickSamples>, Vec<u32>) {
    let n = (1u64 << depth) as f64;
    let between_weight = plan.between_weight(depth);
    let between = neighbours.map(|n| (n, n.by_brick(band, cells)));
    let between_count = between.as_ref().map_or(0, |(_, (order, _))| order.len());
    let mut list = Vec::with_capacity(samples.positions.len() + between_count);
    let mut owners = Vec::with_capacity(list.capacity());
    let mut bricks: Vec<BrickSamples> = Vec::new();
    let mut current = ([u32::MAX; 3], None);
    for (index, cell) in cells.iter().enumerate() {
        let key = key_of(cell.at);
        if key != current.0 {
            current = (key, band.find(key));
            if let Some(brick) = current.1 {
                let start = list.len() as u32;
                if let Some((all, (order, starts))) = &between {
                    let own = &order[starts[brick] as usize..starts[brick + 1] as usize];
                    list.extend(own.iter().map(|&i| all.condition(i, n, between_weight)));
                    // Without weight, they count for no cell.
                    owners.resize(list.len(), index as u32);
                }
                bricks.push(BrickSamples {
                    brick: brick as u32,
                    start,
                    end: list.len() as u32,
                });
            }
        }
        // What no active function reaches says nothing, nor what a deeper level shows first.
        if depth < cell.shown_from || !current.1.is_some_and(|brick| band.is_touched(brick, cell.at)) {
            continue;
        }
        let start = halo_start(cell.at);
        let count = cell.end - cell.start;
        let stride = if plan.thin {
            ((count + SAMPLES_PER_CELL / 2) / SAMPLES_PER_CELL).max(1)
        } else {
            1
        };
        let taken = count.div_ceil(stride);
        let stands_for = count as f64 / taken as f64;
        for i in (cell.start..cell.end).step_by(stride as usize) {
            let q = samples.positions[i as usize] * n;
            let t = std::array::from_fn(|a| T::from_f64(q[a] - cell.at[a] as f64));
            let i = i as usize;
            if samples.weights[i] == 0.0 {
                continue;
            }
            let weight = T::from_f64(stands_for * f64::from(samples.weights[i]));
            let (target, normal) = match &plan.probe {
                None => (samples.targets[i], samples.normals[i]),
                Some(probe) => (probe[i], [0.0; 3]),
            };
            let gradient_weight = if samples.is_sign_condition(i) || plan.form == NormalForm::OffsetPairs {
                T::zero()
            } else {
                weight
            };
            list.push(BandSample {
                spot: Spot { start, t },
                weight,
                gradient_weight,
                tangential: T::from_f64(f64::from(samples.certainty[i])),
                target: T::from_f64(target as f64),
                normal: normal.map(|c| T::from_f64(c as f64)),
            });
            owners.push(index as u32);
        }
        bricks.last_mut().expect("the cell's brick is in the band").end = list.len() as u32;
    }
    bricks.retain(|b| b.start < b.end);
    bricks.sort_unstable_by_key(|b| b.brick);
    (list, bricks, owners)
}
