//! The surfaces of many blocks.

use std::ops::ControlFlow;
use std::sync::Arc;

use rayon::prelude::*;
use rustc_hash::FxHashSet;

use super::blocks::{BlockGrid, BlockKey, Dirty};
use super::surface::{BlockSurface, Scratch};
use super::{MeshReport, PolygonizeError, PolygonizeOptions};
use crate::Field;

/// Blocks sampled between two looks at the caller's wish to stop.
const STRIDE: usize = 1 << 10;

/// Samples `blocks` and returns the surfaces found, sorted by key.
///
/// A surface that runs into a block that is not among them is followed there: sound bounds never
/// let that happen, and unsound ones then cost time but leave no hole. Blocks that are not `dirty` stay as they are.
pub(super) fn sample_blocks(
    field: &dyn Field,
    grid: &BlockGrid,
    options: &PolygonizeOptions,
    blocks: Vec<BlockKey>,
    dirty: Option<&Dirty>,
    report: &mut MeshReport,
    mut go_on: impl FnMut(f64) -> ControlFlow<()>,
) -> Result<Vec<Arc<BlockSurface>>, PolygonizeError> {
    let mut surfaces: Vec<Arc<BlockSurface>> = Vec::new();
    let mut known: FxHashSet<BlockKey> = blocks.iter().copied().collect();
    let mut wanted = blocks;
    loop {
        let first_new = surfaces.len();
        for (part, keys) in wanted.chunks(STRIDE).enumerate() {
            let sampled: Vec<(Option<Arc<BlockSurface>>, u32)> = keys
                .par_iter()
                .with_min_len(4)
                .map_init(Scratch::default, |scratch, &key| {
                    let (surface, nan_nodes) = BlockSurface::sample(field, grid, options, key, scratch);
                    (surface.map(Arc::new), nan_nodes)
                })
                .collect();
            for (surface, nan_nodes) in sampled {
                report.nan_nodes += nan_nodes as u64;
                surfaces.extend(surface);
            }
            // The first round is nearly all of the work.
            let done = if first_new == 0 {
                (part * STRIDE + keys.len()) as f64 / wanted.len() as f64
            } else {
                1.0
            };
            if go_on(done).is_break() {
                return Err(PolygonizeError::Cancelled);
            }
        }
        for &key in &wanted {
            let (lo, hi) = grid.frame_nodes(key);
            report.node_evaluations += (0..3).map(|a| (hi[a] - lo[a] + 1) as u64).product::<u64>();
            report.cells_sampled += grid.frame_cells(key);
        }
        wanted = surfaces[first_new..]
            .iter()
            .flat_map(|s| missing_neighbours(s, grid, &known))
            .filter(|key| dirty.is_none_or(|d| d.contains(0, *key)))
            .collect();
        if wanted.is_empty() {
            break;
        }
        wanted.sort_unstable();
        wanted.dedup();
        known.extend(&wanted);
        report.unsound_blocks += wanted.len() as u64;
        if known.len() > options.max_blocks {
            return Err(PolygonizeError::TooManyBlocks {
                limit: options.max_blocks,
            });
        }
    }
    if report.unsound_blocks > 0 {
        surfaces.sort_unstable_by_key(|s| s.key);
    }
    for surface in &surfaces {
        let counts = &surface.counts;
        report.blocks += 1;
        report.cells_crossed += counts.cells_crossed as u64;
        report.root_evaluations += counts.root_evaluations as u64;
        report.cap_vertices += counts.cap_vertices as u64;
        report.unconverged_vertices += counts.unconverged as u64;
    }
    Ok(surfaces)
}

/// Neighbours that the surface of a block runs into and that are not known.
fn missing_neighbours(
    surface: &BlockSurface,
    grid: &BlockGrid,
    known: &FxHashSet<BlockKey>,
) -> Vec<BlockKey> {
    let cells = grid.meshed_cells(surface.key);
    (0..27)
        .map(|n| [n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1])
        .filter(|d| matches!(d.iter().filter(|&&x| x != 0).count(), 1 | 2))
        .map(|d| (d, [0, 1, 2].map(|a| surface.key[a] + d[a])))
        .filter(|&(d, key)| grid.contains(key) && !known.contains(&key) && surface.runs_into(d, cells))
        .map(|(_, key)| key)
        .collect()
}
