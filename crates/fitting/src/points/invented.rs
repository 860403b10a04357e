//! Where the surface is made up: cells that it crosses with no sample near.

use bspline::{Field, Frame};
use glam::{DAffine3, DQuat, DVec3};
use rustc_hash::FxHashSet;

use super::samples::Samples;
use crate::components::mark_inside;
use crate::level::BASE_DEPTH;
use crate::{Leaf, StopReason};

/// Finest grid that is looked at: 64 cells along the box.
const DEPTH: usize = 6;

/// Leaves without samples, in the order of the grid: cells that the zero set crosses (signs at the centres of two
/// neighbours differ) while neither they nor the 26 cells round them hold a sample, and that lie in none of `leaves`.
pub(crate) fn leaves(field: &dyn Field, samples: &Samples, leaves: &[Leaf]) -> Vec<Leaf> {
    let depth = DEPTH;
    let n = 1usize << depth;
    let h = 1.0 / n as f64;
    let at = |c: [usize; 3]| (c[0] * n + c[1]) * n + c[2];
    let mut is_near = vec![false; n * n * n];
    for i in samples.live_points() {
        let c = samples.cell(i, depth).map(|c| c as usize);
        let range = |a: usize| c[a].saturating_sub(1)..=(c[a] + 1).min(n - 1);
        for x in range(0) {
            for y in range(1) {
                for z in range(2) {
                    is_near[at([x, y, z])] = true;
                }
            }
        }
    }
    let centres = Frame {
        world_from_grid: DAffine3::from_scale_rotation_translation(
            DVec3::splat(samples.scale * h),
            DQuat::IDENTITY,
            samples.origin + 0.5 * h * samples.scale,
        ),
        cells: [n as u32; 3],
    };
    let mut inside = vec![false; n * n * n];
    mark_inside(field, 0.0, &centres, 0, [n; 3], &mut inside);
    let taken: FxHashSet<(u8, [u32; 3])> = leaves.iter().map(|l| (l.level, l.cell)).collect();
    let level = (depth - BASE_DEPTH) as u8;
    let mut found = Vec::new();
    for x in 0..n {
        for y in 0..n {
            for z in 0..n {
                let c = [x, y, z];
                let crossed = (0..3).any(|a| {
                    let mut next = c;
                    next[a] += 1;
                    next[a] < n && inside[at(c)] != inside[at(next)]
                });
                if !crossed || is_near[at(c)] {
                    continue;
                }
                let cell = c.map(|c| c as u32);
                let in_leaf = (0..=level).any(|l| taken.contains(&(l, cell.map(|c| c >> (level - l)))));
                if !in_leaf {
                    found.push(Leaf {
                        level,
                        cell,
                        sample_count: 0,
                        rms: 0.0,
                        max: 0.0,
                        reason: StopReason::NoData,
                    });
                }
            }
        }
    }
    found
}
