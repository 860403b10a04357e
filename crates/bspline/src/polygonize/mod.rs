//! Closed triangle meshes of iso-surfaces.
//!
//! [`polygonize`] makes the surface `{ f = iso }` of a field over the cells of a [`Frame`] into triangles whose
//! normals point out of the solid `{ f > iso }`. The mesh is an oriented 2-manifold without duplicate or degenerate
//! triangles, closed unless it is asked to stay open at the frame's box; [`check_mesh`] tells it of any mesh.
//! Positions are in world coordinates, double precision.
//!
//! A node counts as inside if `f > iso`, strictly; where the field is not a number it counts as outside.
//!
//! The work is done in blocks of 8³ cells:
//!
//! 1. the octree of blocks is searched for those that the field's bounds cannot exclude;
//! 2. each of them is sampled, and its vertices are placed by root finding along the crossed edges;
//! 3. vertices and triangles are numbered in the order of the blocks and joined over block borders.
//!
//! Steps 1 and 2 depend on the field, the frame and the block alone, and the order of blocks on their place, so the
//! mesh has the same bits at any number of threads. Memory grows with the surface.
//!
//! ```
//! # use bspline::{Aabb, Field, Frame, Interval, Jet};
//! # use glam::{DMat3, DVec3};
//! # struct Ball;
//! # impl Field for Ball {
//! #     fn value(&self, p: DVec3) -> f64 { 1.0 - p.length_squared() }
//! #     fn value_gradient(&self, p: DVec3) -> (f64, DVec3) { (self.value(p), -2.0 * p) }
//! #     fn jet(&self, p: DVec3) -> Jet {
//! #         Jet { value: self.value(p), gradient: -2.0 * p, hessian: DMat3::from_diagonal(DVec3::splat(-2.0)) }
//! #     }
//! #     fn bounds(&self, _: &Aabb) -> Interval { Interval::EVERYTHING }
//! # }
//! use bspline::polygonize::{PolygonizeOptions, check_mesh, polygonize};
//!
//! let frame = Frame::over(&Aabb::new(DVec3::splat(-1.5), DVec3::splat(1.5)), [30; 3]);
//! let (mesh, _report) = polygonize(&Ball, &frame, &PolygonizeOptions::default())?;
//! let check = check_mesh(&mesh);
//! assert!(check.is_closed_manifold());
//! assert!((check.volume - 4.0 / 3.0 * std::f64::consts::PI).abs() < 0.05);
//! # Ok::<(), bspline::polygonize::PolygonizeError>(())
//! ```

mod blocks;
mod check;
mod mesh;
mod options;
mod placement;
mod roots;
mod stitch;
mod surface;
mod table;

use std::ops::ControlFlow;

use rayon::prelude::*;
use rustc_hash::FxHashSet;

use self::blocks::{BlockGrid, BlockKey, MAX_CELLS, find_blocks};
use self::stitch::stitch;
use self::surface::{BlockSurface, Scratch};
use crate::{Field, Frame};

pub use self::check::{MeshCheck, check_mesh};
pub use self::mesh::Mesh;
pub use self::options::{MeshReport, Placement, PolygonizeError, PolygonizeOptions};

/// The surface `{ f = iso }` over the cells of `frame`.
///
/// # Errors
/// Any [`PolygonizeError`] but `Cancelled`.
pub fn polygonize(
    field: &dyn Field,
    frame: &Frame,
    options: &PolygonizeOptions,
) -> Result<(Mesh, MeshReport), PolygonizeError> {
    polygonize_with(field, frame, options, &mut |_| ControlFlow::Continue(()))
}

/// [`polygonize`] with a caller who looks on: `progress` is told the share of the work that is done, never falling,
/// from the calling thread, at least every few thousand blocks, and may break the work off.
///
/// # Errors
/// Any [`PolygonizeError`].
pub fn polygonize_with(
    field: &dyn Field,
    frame: &Frame,
    options: &PolygonizeOptions,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<(Mesh, MeshReport), PolygonizeError> {
    validate(frame, options)?;
    let grid = BlockGrid {
        frame,
        open: options.open,
    };
    let (blocks, bounds_queries) = find_blocks(field, &grid, options, |done| progress(0.1 * done))?;
    let mut report = MeshReport {
        bounds_queries,
        cells: frame.cells.iter().map(|&n| n as u64).product(),
        ..MeshReport::default()
    };
    let surfaces = sample_blocks(field, &grid, options, blocks, &mut report, |done| {
        progress(0.1 + 0.7 * done)
    })?;
    let mesh = stitch(field, &grid, options, &surfaces, |done| {
        progress(0.8 + 0.2 * done)
    })?;
    Ok((mesh, report))
}

fn validate(frame: &Frame, options: &PolygonizeOptions) -> Result<(), PolygonizeError> {
    if frame.cells.iter().any(|&n| n == 0 || n > MAX_CELLS) {
        return Err(PolygonizeError::Cells {
            cells: frame.cells,
            max: MAX_CELLS,
        });
    }
    let map = &frame.world_from_grid;
    let determinant = map.matrix3.determinant();
    if !map.is_finite() || !determinant.is_normal() {
        return Err(PolygonizeError::Frame { determinant });
    }
    if !options.iso.is_finite() {
        return Err(PolygonizeError::Iso { iso: options.iso });
    }
    match options.placement {
        Placement::RootFinding { tolerance } if !(tolerance > 0.0 && tolerance <= 0.1) => {
            Err(PolygonizeError::Tolerance { tolerance })
        }
        _ => Ok(()),
    }
}

/// Blocks sampled between two looks at the caller's wish to stop.
const STRIDE: usize = 1 << 10;

/// Samples `blocks` and returns the surfaces found, sorted by key.
///
/// A surface that runs into a block that is not among them is followed there: sound bounds never
/// let that happen, and unsound ones then cost time but leave no hole.
fn sample_blocks(
    field: &dyn Field,
    grid: &BlockGrid,
    options: &PolygonizeOptions,
    blocks: Vec<BlockKey>,
    report: &mut MeshReport,
    mut go_on: impl FnMut(f64) -> ControlFlow<()>,
) -> Result<Vec<BlockSurface>, PolygonizeError> {
    let mut surfaces: Vec<BlockSurface> = Vec::new();
    let mut known: FxHashSet<BlockKey> = blocks.iter().copied().collect();
    let mut wanted = blocks;
    loop {
        let first_new = surfaces.len();
        for (part, keys) in wanted.chunks(STRIDE).enumerate() {
            let sampled: Vec<(Option<BlockSurface>, u32)> = keys
                .par_iter()
                .with_min_len(4)
                .map_init(Scratch::default, |scratch, &key| {
                    BlockSurface::sample(field, grid, options, key, scratch)
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
