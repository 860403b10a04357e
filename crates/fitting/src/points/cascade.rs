//! The surface levels, coarse to fine: each level corrects the one before where the data ask for it.

use std::collections::BTreeMap;
use std::sync::Arc;

use bspline::hierarchical::{BRICK, BrickKey, Corrections, HALO, LevelCorrections};
use bspline::{HierarchicalSpline, Real};

use super::band::{Band, Coarser};
use super::band_solve::{BandProblem, BandSample, BrickSamples, SolveReport};
use super::full_grid::FullGrid;
use super::plan::Plan;
use super::samples::{BASE_DEPTH, Samples};
use super::stencil::{Spot, gather};
use crate::{Control, FitError, StopReason};

/// Samples of a cell beyond this many are thinned on levels that will be refined again.
const SAMPLES_PER_CELL: u32 = 8;
/// A cell is split where the rms of `|∇f + n|` exceeds this, however small `|f|` is: on thin parts opposite
/// sheets cancel to `f ≈ 0`, `|∇f| ≈ 0`.
const GRADIENT_LIMIT: f64 = 0.3;
/// Samples that the cell above must hold for its children to be split: below, the spacing of the coefficients
/// would fall under half the spacing of the samples.
const SAMPLES_TO_SPLIT: u32 = 2;

/// A cell that holds samples: `start..end` in Morton order.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cell {
    pub at: [u32; 3],
    pub start: u32,
    pub end: u32,
    /// Whether this level's functions were made active here: the cell above was split.
    pub refined: bool,
    /// Samples of the cell above.
    pub above: u32,
}

/// One level as solved.
pub(crate) struct Solved<T> {
    pub band: Band<T>,
    /// Corrections of the active functions.
    pub x: Vec<T>,
    pub report: SolveReport,
}

/// A leaf: a cell that was refined to but not split.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LeafCell {
    pub depth: usize,
    pub at: [u32; 3],
    pub start: u32,
    pub end: u32,
    pub reason: StopReason,
}

/// A whole cascade.
pub(crate) struct Cascade<T> {
    pub levels: Vec<Level<T>>,
    pub leaves: Vec<LeafCell>,
    pub iterations: Vec<SolveReport>,
}

/// The stored part of a level: what is left when the next one is solved.
pub(crate) struct Level<T> {
    pub keys: Vec<BrickKey>,
    pub masks: Vec<[u64; BRICK]>,
    pub x: Vec<T>,
}

/// Runs the cascade from the full level `base` down.
///
/// # Errors
/// [`FitError::Cancelled`], [`FitError::MemoryLimit`].
pub(crate) fn run<T: Real>(
    samples: &Samples,
    base: &FullGrid<f64>,
    plan: &Plan,
    control: &mut Control,
) -> Result<Cascade<T>, FitError> {
    let mut out = Cascade {
        levels: Vec::new(),
        leaves: Vec::new(),
        iterations: Vec::new(),
    };
    let mut split: Vec<(Cell, bool)> = root_cells(samples);
    let mut previous: Option<Solved<T>> = None;
    let mut coefficients = base.values.len();
    for depth in BASE_DEPTH + 1..=plan.max_depth {
        let cells = children(samples, &split, depth);
        let refined: Vec<[u32; 3]> = cells.iter().filter(|c| c.refined).map(|c| c.at).collect();
        if refined.is_empty() {
            break;
        }
        control.step(
            "fitting surface levels",
            0.1 + 0.8 * (0.25f64).powf((plan.max_depth - depth) as f64),
        )?;
        let coarser = match &previous {
            None => Coarser::Full(base),
            Some(solved) => Coarser::Band(&solved.band),
        };
        let mut band = Band::around(depth, &refined, &coarser);
        control.reserve(level_bytes::<T>(&band, samples.positions.len()))?;
        let (list, bricks, owners) = band_samples(samples, &band, &cells, plan, depth);
        let weights = plan.weights(depth);
        let (x, report) =
            BandProblem::new(&band, &list, &bricks, weights).solve(plan.residual, plan.iterations);
        band.add_active(&x);
        coefficients += x.len();
        out.iterations.push(report);
        let quality = cell_quality(&band, &list, &bricks, &owners, cells.len());
        let may_go_on = plan.coefficients.is_none_or(|limit| coefficients < limit);
        split = cells
            .iter()
            .zip(&quality)
            .map(|(cell, q)| {
                let verdict = judge(cell, q, plan, depth, may_go_on);
                if cell.refined
                    && let Err(reason) = verdict
                {
                    out.leaves.push(LeafCell {
                        depth,
                        at: cell.at,
                        start: cell.start,
                        end: cell.end,
                        reason,
                    });
                }
                (*cell, cell.refined && verdict.is_ok())
            })
            .collect();
        let solved = Solved { band, x, report };
        if let Some(before) = previous.replace(solved) {
            out.levels.push(before.into_level());
        }
    }
    out.levels.extend(previous.map(Solved::into_level));
    Ok(out)
}

/// Whether a cell is split, or why not.
fn judge(cell: &Cell, q: &Quality, plan: &Plan, depth: usize, may_go_on: bool) -> Result<(), StopReason> {
    let fits = q.distance() <= plan.tolerance && q.turn() <= GRADIENT_LIMIT;
    if fits && !plan.uniform {
        Err(StopReason::Tolerance)
    } else if depth == plan.max_depth {
        Err(if fits {
            StopReason::Tolerance
        } else {
            plan.limited_by
        })
    } else if cell.above < SAMPLES_TO_SPLIT {
        Err(StopReason::NoData)
    } else if !may_go_on {
        Err(StopReason::Budget)
    } else {
        Ok(())
    }
}

/// Cells of the base level, all of them to be split.
fn root_cells(samples: &Samples) -> Vec<(Cell, bool)> {
    let whole = Cell {
        at: [0; 3],
        start: 0,
        end: samples.positions.len() as u32,
        refined: true,
        above: u32::MAX,
    };
    let mut level = vec![(whole, true)];
    for depth in 1..=BASE_DEPTH {
        level = children(samples, &level, depth)
            .into_iter()
            .map(|c| (c, true))
            .collect();
    }
    level
}

/// Occupied cells of `depth`, in Morton order, from those above and whether they were split.
fn children(samples: &Samples, above: &[(Cell, bool)], depth: usize) -> Vec<Cell> {
    let mut cells: Vec<Cell> = Vec::with_capacity(2 * above.len());
    for (parent, split) in above {
        let count = parent.end - parent.start;
        let first = cells.len();
        for i in parent.start..parent.end {
            let at = samples.cell(i as usize, depth);
            match cells[first..].last_mut() {
                Some(cell) if cell.at == at => cell.end = i + 1,
                _ => cells.push(Cell {
                    at,
                    start: i,
                    end: i + 1,
                    refined: *split,
                    above: count,
                }),
            }
        }
    }
    cells
}

/// Bytes held at once while a level is solved.
fn level_bytes<T>(band: &Band<T>, sample_count: usize) -> u64 {
    let per_brick = size_of::<T>() * (HALO.pow(3) + 4 * BRICK.pow(3)) + 256;
    let per_sample = size_of::<BandSample<T>>() + 64;
    (band.keys.len() * per_brick
        + band.offsets[band.keys.len()] * 6 * size_of::<T>()
        + sample_count * per_sample) as u64
}

/// Samples of the cells whose brick is in the band, brick by brick; `owners[i]` is the cell of sample `i`.
fn band_samples<T: Real>(
    samples: &Samples,
    band: &Band<T>,
    cells: &[Cell],
    plan: &Plan,
    depth: usize,
) -> (Vec<BandSample<T>>, Vec<BrickSamples>, Vec<u32>) {
    let n = (1u64 << depth) as f64;
    let thin = plan.thin && depth < plan.max_depth;
    let mut list = Vec::with_capacity(samples.positions.len());
    let mut owners = Vec::with_capacity(samples.positions.len());
    let mut bricks: Vec<BrickSamples> = Vec::new();
    let mut current = (BrickKey([u32::MAX; 3]), None);
    for (index, cell) in cells.iter().enumerate() {
        let key = BrickKey(cell.at.map(|c| c / BRICK as u32));
        if key != current.0 {
            current = (key, band.find(key));
            if let Some(brick) = current.1 {
                bricks.push(BrickSamples {
                    brick: brick as u32,
                    start: list.len() as u32,
                    end: list.len() as u32,
                });
            }
        }
        if current.1.is_none() {
            continue;
        }
        let local = cell.at.map(|c| c as usize % BRICK);
        let start = (local[0] * HALO + local[1]) * HALO + local[2];
        let count = cell.end - cell.start;
        let stride = if thin {
            (count / SAMPLES_PER_CELL).max(1)
        } else {
            1
        };
        let taken = count.div_ceil(stride);
        let weight = T::from_f64(count as f64 / taken as f64);
        for i in (cell.start..cell.end).step_by(stride as usize) {
            let q = samples.positions[i as usize] * n;
            let t = std::array::from_fn(|a| T::from_f64(q[a] - cell.at[a] as f64));
            let i = i as usize;
            let (target, normal) = match &plan.probe {
                None => (samples.targets[i], samples.normals[i]),
                Some(probe) => (probe[i], [0.0; 3]),
            };
            let gradient_weight = if samples.is_sign_condition(i) {
                T::zero()
            } else {
                weight
            };
            list.push(BandSample {
                spot: Spot { start, t },
                weight,
                gradient_weight,
                target: T::from_f64(target as f64),
                normal: normal.map(|c| T::from_f64(c as f64)),
            });
            owners.push(index as u32);
        }
        bricks.last_mut().expect("the cell's brick is in the band").end = list.len() as u32;
    }
    bricks.sort_unstable_by_key(|b| b.brick);
    (list, bricks, owners)
}

/// Sums over the samples of a cell.
#[derive(Clone, Copy, Debug, Default)]
struct Quality {
    weight: f64,
    distance: f64,
    turn: f64,
}

impl Quality {
    /// Rms of `|f|/|∇f|`, unit box.
    fn distance(&self) -> f64 {
        (self.distance / self.weight.max(1e-300)).sqrt()
    }
    /// Rms of `|∇f + n|`.
    fn turn(&self) -> f64 {
        (self.turn / self.weight.max(1e-300)).sqrt()
    }
}

fn cell_quality<T: Real>(
    band: &Band<T>,
    list: &[BandSample<T>],
    bricks: &[BrickSamples],
    owners: &[u32],
    cell_count: usize,
) -> Vec<Quality> {
    let n = (1u64 << band.depth) as f64;
    let mut out = vec![Quality::default(); cell_count];
    let mut values = [T::zero(); HALO * HALO * HALO];
    for b in bricks {
        band.halo(&band.totals, b.brick as usize, &mut values);
        for i in b.start as usize..b.end as usize {
            let sample = &list[i];
            let (v, g) = gather(&values, sample.spot, [HALO * HALO, HALO]);
            let g = g.map(|g| g.as_f64() * n);
            let steepness: f64 = g.iter().map(|g| g * g).sum();
            let w = sample.gradient_weight.as_f64();
            let q = &mut out[owners[i] as usize];
            q.weight += w;
            q.distance += w * v.as_f64().powi(2) / steepness.max(1e-4);
            q.turn += w
                * (0..3)
                    .map(|a| (g[a] + sample.normal[a].as_f64()).powi(2))
                    .sum::<f64>();
        }
    }
    out
}

impl<T: Real> Solved<T> {
    fn into_level(self) -> Level<T> {
        Level {
            keys: self.band.keys,
            masks: self.band.masks,
            x: self.x,
        }
    }
}

/// The field: level 0 is the full base level, the others what the cascade found, scaled to world units.
pub(crate) fn assemble<T: Real>(
    samples: &Samples,
    base: &FullGrid<f64>,
    levels: &[Level<T>],
) -> HierarchicalSpline<T> {
    let mut stored: Vec<LevelCorrections<T>> = Vec::with_capacity(levels.len() + 1);
    let m = base.width();
    let mut bottom: BTreeMap<BrickKey, Corrections<T>> = BTreeMap::new();
    for (i, c) in base.values.iter().enumerate() {
        let s = [i / (m * m), i / m % m, i % m];
        let key = BrickKey(s.map(|s| (s / BRICK) as u32));
        let value = T::from_f64(c * samples.scale);
        bottom
            .entry(key)
            .or_insert_with(Corrections::empty)
            .set(s.map(|s| s % BRICK), value);
    }
    stored.push(bottom.into_iter().map(|(k, c)| (k, Arc::new(c))).collect());
    let scale = T::from_f64(samples.scale);
    for level in levels {
        let mut values = level.x.iter();
        let mut corrections = LevelCorrections::new();
        for (key, mask) in level.keys.iter().zip(&level.masks) {
            if *mask == [0; BRICK] {
                continue;
            }
            let mut brick = Corrections {
                mask: *mask,
                ..Corrections::empty()
            };
            for slot in (0..brick.values.len()).filter(|&s| mask[s / 64] >> (s % 64) & 1 == 1) {
                brick.values[slot] = *values.next().expect("one value per active function") * scale;
            }
            corrections.insert(*key, Arc::new(brick));
        }
        stored.push(corrections);
    }
    HierarchicalSpline::from_corrections(samples.lattice(), 1.0, stored)
}
