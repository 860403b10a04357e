//! The octree's occupied cells: which are split, and why the others are not.

use bspline::Real;
use rustc_hash::FxHashSet;

use super::plan::Plan;
use super::samples::Samples;
use crate::StopReason;
use crate::level::BASE_DEPTH;
use crate::level::band::{Band, HALO_LEN, STRIDES};
use crate::level::band_problem::{BandSample, BrickSamples};
use crate::level::stencil::gather;

/// A cell is split where the rms of `|∇f + n|` exceeds this, however small `|f|` is: on thin parts opposite
/// sheets cancel to `f ≈ 0`, `|∇f| ≈ 0`.
const GRADIENT_LIMIT: f64 = 0.3;
/// Samples that the cell above must hold for its children to be split: below, the spacing of the coefficients
/// would fall under half the spacing of the samples.
const SAMPLES_TO_SPLIT: u32 = 2;
/// Distance of a sample to its neighbours, in cells of the next level, up to which its cell is split all the same where
/// conditions stand between the samples.
const CELLS_BETWEEN: f64 = 8.0;

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
    /// Whether a sample has weight.
    pub is_live: bool,
    /// First level on which its samples count.
    pub shown_from: usize,
}

impl Cell {
    /// The cell as a leaf.
    pub fn leaf(&self, depth: usize, reason: StopReason) -> LeafCell {
        LeafCell {
            depth,
            at: self.at,
            start: self.start,
            end: self.end,
            reason,
        }
    }
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

/// Cells of the base level, all of them to be split.
pub(crate) fn root_cells(samples: &Samples, plan: &Plan) -> Vec<(Cell, bool)> {
    let whole = Cell {
        at: [0; 3],
        start: 0,
        end: samples.positions.len() as u32,
        refined: true,
        above: u32::MAX,
        is_live: true,
        shown_from: 0,
    };
    let mut level = vec![(whole, true)];
    for depth in 1..=BASE_DEPTH {
        level = children(samples, &level, depth)
            .into_iter()
            .map(|c| (c, true))
            .collect();
    }
    for (cell, _) in &mut level {
        cell.shown_from = plan.shown_from.get(&cell.at).copied().unwrap_or(0);
    }
    level
}

/// Occupied cells of `depth`, in Morton order, from those above and whether they were split.
pub(crate) fn children(samples: &Samples, above: &[(Cell, bool)], depth: usize) -> Vec<Cell> {
    let mut cells: Vec<Cell> = Vec::with_capacity(2 * above.len());
    for (parent, split) in above {
        let count = parent.end - parent.start;
        let first = cells.len();
        for i in parent.start..parent.end {
            let at = samples.cell(i as usize, depth);
            let is_live = samples.weights[i as usize] > 0.0;
            match cells[first..].last_mut() {
                Some(cell) if cell.at == at => {
                    cell.end = i + 1;
                    cell.is_live |= is_live;
                }
                _ => cells.push(Cell {
                    at,
                    start: i,
                    end: i + 1,
                    refined: *split,
                    above: count,
                    is_live,
                    shown_from: parent.shown_from,
                }),
            }
        }
    }
    cells
}

/// Of the cells to be split keeps the best (largest `worth`) whose children add no more than `room` functions to the
/// level of `depth`; the others become leaves of the level above.
pub(crate) fn keep_within(
    room: usize,
    samples: &Samples,
    split: &mut [(Cell, bool)],
    worth: &[f64],
    depth: usize,
) -> Vec<LeafCell> {
    let mut order: Vec<usize> = (0..split.len()).filter(|&i| split[i].1).collect();
    order.sort_by(|&a, &b| worth[b].total_cmp(&worth[a]));
    // The central functions of a cell stand at its corners.
    let mut corners: FxHashSet<[u32; 3]> = FxHashSet::default();
    let mut left_out = Vec::new();
    for i in order {
        let refined = children(samples, &split[i..=i], depth);
        let fresh: FxHashSet<[u32; 3]> = refined
            .iter()
            .filter(|c| c.is_live)
            .flat_map(|c| (0..8u32).map(|o| std::array::from_fn(|a| c.at[a] + (o >> a & 1))))
            .filter(|corner| !corners.contains(corner))
            .collect();
        if left_out.is_empty() && corners.len() + fresh.len() <= room {
            corners.extend(fresh);
        } else {
            split[i].1 = false;
            left_out.push(split[i].0.leaf(depth - 1, StopReason::Budget));
        }
    }
    left_out
}

/// Whether a cell is split, or why not. `spacing` is the distance of its first sample to its neighbours, unit box.
pub(crate) fn judge(
    cell: &Cell,
    q: &Quality,
    spacing: f32,
    plan: &Plan,
    depth: usize,
) -> Result<(), StopReason> {
    if !cell.is_live {
        return Err(StopReason::NoData);
    }
    if depth < cell.shown_from {
        return Ok(());
    }
    let is_carried = f64::from(spacing) <= CELLS_BETWEEN * 0.5f64.powi(depth as i32 + 1);
    let fits = q.distance() <= plan.tolerance && q.turn() <= GRADIENT_LIMIT;
    if fits && !plan.uniform {
        Err(StopReason::Tolerance)
    } else if depth == plan.max_depth {
        Err(if fits {
            StopReason::Tolerance
        } else {
            plan.limited_by
        })
    } else if cell.above < SAMPLES_TO_SPLIT && !is_carried {
        Err(StopReason::NoData)
    } else {
        Ok(())
    }
}

/// Sums over the samples of a cell.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Quality {
    weight: f64,
    distance: f64,
    turn: f64,
}

impl Quality {
    /// What refining the cell may gain: the sum of its squared distances.
    pub fn worth(&self) -> f64 {
        self.distance
    }
    /// Rms of `|f|/|∇f|`, unit box.
    fn distance(&self) -> f64 {
        (self.distance / self.weight.max(1e-300)).sqrt()
    }
    /// Rms of `|∇f + n|`.
    fn turn(&self) -> f64 {
        (self.turn / self.weight.max(1e-300)).sqrt()
    }
}

pub(crate) fn cell_quality<T: Real>(
    band: &Band<T>,
    list: &[BandSample<T>],
    bricks: &[BrickSamples],
    owners: &[u32],
    cell_count: usize,
) -> Vec<Quality> {
    let n = (1u64 << band.depth) as f64;
    let mut out = vec![Quality::default(); cell_count];
    let mut values = [T::zero(); HALO_LEN];
    for b in bricks {
        band.halo(&band.totals, b.brick as usize, &mut values);
        for i in b.start as usize..b.end as usize {
            let sample = &list[i];
            let (v, g) = gather(&values, sample.spot, STRIDES);
            let g = g.map(|g| g.as_f64() * n);
            let steepness: f64 = g.iter().map(|g| g * g).sum();
            // Conditions on the value alone are no points of the surface.
            let w = if sample.normal == [T::zero(); 3] {
                0.0
            } else {
                sample.weight.as_f64()
            };
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
