//! Fitting to a tolerance: every leaf's rms residual below it.

use bspline::Real;
use rayon::prelude::*;

use super::active::ActiveSet;
use super::adaptive::{Adaptive, Scores};
use super::detail::DetailLayout;
use super::domain::SLAB;
use super::leaves::{LeafGrid, LeafResidual, LeafSums};
use super::select::{Cutoff, largest};
use crate::{Control, FitError};

/// A function is taken in the first place if its score exceeds this multiple of the tolerance.
const FIRST_THRESHOLD: f64 = 2.4;
/// Iterations of the two solves before leaves are looked at, and of those after.
const ITERATIONS: [usize; 3] = [12, 12, 8];
/// Rounds of additions to leaves above the tolerance.
const ROUNDS: usize = 24;
/// From this round on a failing leaf and its neighbours get all their functions.
const GENEROUS_ROUND: usize = 10;
/// Share of the tolerance that additions to a leaf aim at.
const AIM: f64 = 0.6;
/// Factor on it from round to round: the few leaves that resist get ever more.
const LATER_AIM: f64 = 0.7;
/// Leaves are held to this share of the tolerance, so that rounding of the stored coefficients cannot
/// lift one above it.
const MARGIN: f64 = 0.999;

/// While any leaf is above the tolerance, leaves above this share of it get functions too: the additions
/// next door may lift them.
const CAUTION: f64 = 0.95;

/// Share of the whole work where a fit to a tolerance begins and ends.
const SPAN: (f64, f64) = (0.05, 0.88);

/// What ended a fit to a tolerance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// Every leaf meets it.
    Met,
    /// The budget is spent; some leaves may not.
    BudgetSpent,
    /// No function of the allowed levels is left to add where it is missed.
    Exhausted,
    /// What is above it is what the smoothing took away.
    Smoothed,
}

impl<T: Real> Adaptive<'_, T> {
    /// Adds functions until every leaf's rms residual is at most `tolerance` (in the samples' scale) or
    /// `budget` functions are active.
    ///
    /// With smoothing `μ` a function is taken only if `1/(1 + μ)` of its score, which is what the ridge leaves of it,
    /// exceeds the threshold, and leaves above the tolerance get no more: that would take the smoothing back.
    pub fn meet(
        &mut self,
        tolerance: f64,
        budget: usize,
        floor: f64,
        control: &mut Control,
    ) -> Result<Outcome, FitError> {
        let span = |share: f64| SPAN.0 + (SPAN.1 - SPAN.0) * share;
        let smoothing = self.problem.ridge;
        let clean_threshold = FIRST_THRESHOLD * tolerance * (1.0 + smoothing);
        let threshold = clean_threshold.max(floor);
        for level in 1..=self.depth() {
            control.step(
                "choosing functions",
                span(0.05 * level as f64 / self.depth() as f64),
            )?;
            let free = budget.saturating_sub(self.fit.count());
            let cutoff = Cutoff::above(threshold / self.level_weight(level));
            self.grow(level, |scores| match count_kept(&[scores], cutoff) > free {
                true => largest(&[scores], free + 1),
                false => cutoff,
            });
            if self.fit.count() > budget {
                return self.spend_instead(budget, floor, control);
            }
        }
        let [first, second, later] = ITERATIONS;
        self.solve(first, control, (span(0.05), span(0.2)))?;
        if self.depth() > 0 {
            let mut scores = self.scores();
            if threshold > clean_threshold {
                self.silence_below(&mut scores, threshold, tolerance);
            }
            let cutoff = Cutoff::above(clean_threshold);
            let lists: Vec<&[T]> = scores.levels.iter().map(Vec::as_slice).collect();
            if self.fit.active[0].len() + count_kept(&lists, cutoff) > budget {
                self.discard(scores);
                return self.spend_instead(budget, floor, control);
            }
            self.activate(scores, cutoff);
            self.solve(second, control, (span(0.2), span(0.4)))?;
        }
        for round in 0..if smoothing > 0.0 { 0 } else { ROUNDS } {
            // Most of the time falls to the first rounds.
            let at = |r: usize| span(1.0 - 0.6 * 0.7_f64.powi(r as i32));
            control.step("leaves above the tolerance", at(round))?;
            let (grid, leaves) = self.leaf_residuals();
            let failing: Vec<bool> = leaves.iter().map(|l| l.rms() > MARGIN * tolerance).collect();
            if !failing.contains(&true) {
                return Ok(Outcome::Met);
            }
            let failing: Vec<bool> = leaves.iter().map(|l| l.rms() > CAUTION * tolerance).collect();
            if self.depth() == 0 {
                break;
            }
            let generous = round >= GENEROUS_ROUND;
            let aim = AIM * LATER_AIM.powi(round as i32) * tolerance;
            let free = budget.saturating_sub(self.fit.count());
            let mut picked = self.pick(grid, &leaves, &failing, aim, generous);
            let spent = picked.len() > free;
            if spent {
                picked.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
                picked.truncate(free);
            }
            let none_left = picked.is_empty();
            self.add(picked);
            let iterations = if generous { 2 * later } else { later };
            self.solve(iterations, control, (at(round), at(round + 1)))?;
            if spent {
                return Ok(Outcome::BudgetSpent);
            }
            if none_left && round > GENEROUS_ROUND + 2 {
                break;
            }
        }
        let (_, leaves) = self.leaf_residuals();
        let met = leaves.iter().all(|l| l.rms() <= MARGIN * tolerance);
        Ok(match met {
            true => Outcome::Met,
            false if smoothing > 0.0 => Outcome::Smoothed,
            false => Outcome::Exhausted,
        })
    }

    /// The tolerance asks for more than the budget: starts over and spends it where it helps most.
    fn spend_instead(
        &mut self,
        budget: usize,
        floor: f64,
        control: &mut Control,
    ) -> Result<Outcome, FitError> {
        self.restart();
        self.spend(budget, floor, control, (SPAN.0 + 0.2 * (SPAN.1 - SPAN.0), SPAN.1))?;
        Ok(Outcome::BudgetSpent)
    }

    /// Residuals of every leaf.
    pub fn leaf_residuals(&self) -> (LeafGrid, Vec<LeafResidual>) {
        let domain = self.domain();
        let grid = LeafGrid::new(domain);
        let [px, py, _] = domain.padded();
        let [nx, ny, nz] = domain.samples();
        let parts: Vec<LeafSums> = self.residual[..px * py * nz]
            .par_chunks(px * py * SLAB)
            .enumerate()
            .map(|(i, slab)| {
                let planes = i * SLAB..i * SLAB + slab.len() / (px * py);
                let mut sums = LeafSums::new(grid, &planes);
                for (z, plane) in planes.zip(slab.chunks(px * py)) {
                    for (y, row) in plane.chunks(px).take(ny).enumerate() {
                        sums.add_row(y, z, &row[..nx]);
                    }
                }
                sums
            })
            .collect();
        (grid, LeafSums::merge(grid, parts))
    }

    /// Takes the scores below `floor` out of the competition, except in leaves above the tolerance and next to them:
    /// elsewhere they are noise.
    fn silence_below(&self, scores: &mut Scores<T>, floor: f64, tolerance: f64) {
        let (grid, leaves) = self.leaf_residuals();
        let failing: Vec<bool> = leaves.iter().map(|l| l.rms() > CAUTION * tolerance).collect();
        let heard = dilated(grid, &failing);
        let floor = T::from_f64(floor);
        for (layout, list) in scores.layouts.iter().zip(&mut scores.levels) {
            self.for_each_row(*layout, grid, |start, leaf_row, leaf_of_x| {
                for (score, x) in list[start..].iter_mut().zip(leaf_of_x) {
                    if *score < floor && !heard[leaf_row + x] {
                        *score = T::zero();
                    }
                }
            });
        }
    }

    /// Visits the rows of an array of detail: its start in the array, the first leaf of the row of leaves that it is
    /// centred in, and the leaf along x of each entry.
    fn for_each_row(
        &self,
        layout: DetailLayout,
        grid: LeafGrid,
        mut visit: impl FnMut(usize, usize, &[usize]),
    ) {
        let domain = self.domain();
        let leaf_of: [Vec<usize>; 3] = std::array::from_fn(|a| {
            let axis = domain.axes[a];
            let voxel = |i: usize| {
                let s = i + layout.first;
                (s.saturating_sub(1) * axis.spacing(layout.level)).min(axis.samples - 1)
            };
            (0..layout.size[a]).map(|i| grid.cell(a, voxel(i))).collect()
        });
        let [nx, ny, nz] = layout.size;
        for z in 0..nz {
            for y in 0..ny {
                let leaf_row = (leaf_of[2][z] * grid.cells[1] + leaf_of[1][y]) * grid.cells[0];
                visit((z * ny + y) * nx, leaf_row, &leaf_of[0]);
            }
        }
    }

    /// Functions of the finest allowed level to add to failing leaves: score and index of each.
    ///
    /// A leaf gets the best of those centred in it until the share of energy left in them is that which the
    /// tolerance leaves of its residual. A `generous` pick is all of them, and the neighbours'.
    fn pick(
        &mut self,
        grid: LeafGrid,
        leaves: &[LeafResidual],
        failing: &[bool],
        aim: f64,
        generous: bool,
    ) -> Vec<(f64, usize)> {
        let domain = self.domain();
        let level = self.depth();
        let layout = DetailLayout::of_level(domain, level);
        let mut scores = self.detail(level);
        layout.score(domain, T::one(), &mut scores);
        layout.for_each_active(&self.fit.active[level], |_, entry| scores[entry] = T::zero());
        let wanted = if generous {
            dilated(grid, failing)
        } else {
            failing.to_vec()
        };
        let [nx, ny, _] = layout.size;
        let functions = domain.functions(level);
        let mut offered: Vec<(usize, f64, usize)> = Vec::new();
        self.for_each_row(layout, grid, |start, leaf_row, leaf_of_x| {
            let (y, z) = (start / nx % ny, start / (nx * ny));
            for ((x, score), leaf) in scores[start..].iter().enumerate().zip(leaf_of_x) {
                let leaf = leaf_row + leaf;
                if wanted[leaf] && *score > T::zero() {
                    offered.push((leaf, score.as_f64(), layout.function(functions, x, y, z)));
                }
            }
        });
        self.recycle(level, scores);
        if generous {
            return offered
                .into_iter()
                .map(|(_, score, index)| (score, index))
                .collect();
        }
        offered.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)).then(a.2.cmp(&b.2)));
        let mut picked = Vec::new();
        for of_leaf in offered.chunk_by(|a, b| a.0 == b.0) {
            let total: f64 = of_leaf.iter().map(|o| o.1 * o.1).sum();
            let share = aim / leaves[of_leaf[0].0].rms();
            let mut left = total;
            for &(_, score, index) in of_leaf {
                if left <= share * share * total {
                    break;
                }
                left -= score * score;
                picked.push((score, index));
            }
        }
        picked
    }

    /// Activates functions of the finest allowed level, with coefficient 0.
    fn add(&mut self, picked: Vec<(f64, usize)>) {
        let level = self.depth();
        let mut indices: Vec<usize> = self.fit.active[level].indices().collect();
        indices.extend(picked.into_iter().map(|p| p.1));
        indices.sort_unstable();
        let set = ActiveSet::from_indices(self.domain().functions(level), indices.into_iter());
        self.fit.set_active(level, set);
    }
}

fn count_kept<T: Real>(lists: &[&[T]], cutoff: Cutoff) -> usize {
    // A threshold keeps by value alone; the index does not matter.
    lists
        .iter()
        .map(|l| l.par_iter().filter(|&&s| cutoff.keeps(s, usize::MAX)).count())
        .sum()
}

/// Marked leaves and their 26 neighbours.
fn dilated(grid: LeafGrid, marked: &[bool]) -> Vec<bool> {
    let [cx, cy, cz] = grid.cells;
    let mut out = vec![false; marked.len()];
    for (i, _) in marked.iter().enumerate().filter(|(_, m)| **m) {
        let (x, y, z) = (i % cx, i / cx % cy, i / (cx * cy));
        for z in z.saturating_sub(1)..(z + 2).min(cz) {
            for y in y.saturating_sub(1)..(y + 2).min(cy) {
                for x in x.saturating_sub(1)..(x + 2).min(cx) {
                    out[(z * cy + y) * cx + x] = true;
                }
            }
        }
    }
    out
}
