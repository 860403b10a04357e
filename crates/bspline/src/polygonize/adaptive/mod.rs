//! Meshes whose triangles are as large as the curvature of the surface allows: dual contouring on a balanced octree.
//!
//! A cell is divided where its chord error `κ h²/8` exceeds the one asked for, `κ` the largest curvature of the surface
//! in it; until neighbours differ by one level at most; and never beyond the last level. Every loop in which the
//! surface crosses the surface of a leaf gets a vertex, every crossed minimal edge a polygon through the leaves about
//! it, so the mesh is closed and manifold whatever the signs at the nodes are [Ju02, Schaefer07].

mod around;
mod cases;
mod changed;
mod grid;
mod hidden;
mod join;
mod judge;
mod live;
mod octree;
mod patch;
mod pieces;
mod polygons;
mod sample;
mod splice;
mod surface;
mod tree;
mod vertices;

use std::ops::ControlFlow;

use glam::DVec3;
use rayon::prelude::*;

pub use self::live::{AdaptiveBlock, AdaptiveBlockMesh, AdaptiveUpdate};

use self::around::Around;
use self::grid::Grids;
use self::polygons::{BlockTriangles, EXTRA, ExtraKey, Numbered};
use self::sample::{Judge, Sample};
use self::tree::{Limits, Samples, Tree, Watch};
use self::vertices::{BlockVertices, PLACE_BITS, Placer, STEPS, key_of};
use super::blocks::{BlockGrid, BlockKey, find_blocks};
use super::settle::{SettleOptions, settle};
use super::{Mesh, PolygonizeError, PolygonizeOptions};
use crate::{Field, Frame};

/// What to mesh, and how finely.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptiveOptions {
    /// The surface is `{ f = iso }`, the solid `{ f > iso }`. Finite; in the field's own unit.
    pub iso: f64,
    /// Leaves the surface open where it meets the frame's box, instead of closing it with a cap.
    pub open: bool,
    /// Halvings of the frame's cells, at most.
    pub depth: usize,
    /// Halvings down to which pieces of the surface are looked for that touch no corner of a cell.
    pub detection: usize,
    /// Most blocks of 8³ cells before the work is refused.
    pub max_blocks: usize,
    /// Forgets what was learnt of the field before a mesh settles, which halves the memory beside the field's own; the next
    /// mesh begins anew.
    pub frugal: bool,
}

impl Default for AdaptiveOptions {
    /// The closed surface `f = 0`, eight halvings.
    fn default() -> Self {
        Self {
            iso: 0.0,
            open: false,
            depth: 8,
            detection: 8,
            max_blocks: 1 << 22,
            frugal: false,
        }
    }
}

impl AdaptiveOptions {
    /// Most halvings of a frame that has `cells` cells along its longest side: keys of vertices have room for no more.
    pub fn most_depth(cells: u32) -> usize {
        (0..PLACE_BITS as usize)
            .rev()
            .find(|depth| (u64::from(cells) + 2) << depth <= 1 << PLACE_BITS)
            .unwrap_or(0)
    }
}

/// What the mesher met.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AdaptiveReport {
    /// Blocks of 8³ cells over all levels.
    pub blocks: u64,
    /// Leaves of each level with corners on both sides, added up.
    pub crossed_leaves: u64,
    /// Leaves of the last level whose error is still too large.
    pub leaves_at_limit: u64,
    /// Those of them where the bounds cannot exclude a crease.
    pub creased_leaves: u64,
    /// Vertices put in to keep apart what no leaf could.
    pub extra_vertices: u64,
    /// Nodes where the field is not a number; they count as outside.
    pub nan_nodes: u64,
}

/// A mesh and what a change of its connectivity has to know of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AdaptiveMesh {
    /// The triangles.
    pub mesh: Mesh,
    /// A key for each vertex that depends on its place in the octree only, not on its number.
    pub keys: Vec<u64>,
    /// Vertices on the frame's faces, which have to stay where they are.
    pub fixed: Vec<bool>,
}

/// Meshes one field again and again, with all that was learnt of it.
pub struct AdaptiveMesher<'a> {
    field: &'a dyn Field,
    options: AdaptiveOptions,
    grids: Grids,
    samples: Samples,
    roots: Vec<BlockKey>,
}

impl<'a> AdaptiveMesher<'a> {
    /// Finds the cells of `frame` that may hold surface.
    ///
    /// # Errors
    /// Any [`PolygonizeError`].
    pub fn new(
        field: &'a dyn Field,
        frame: &Frame,
        options: &AdaptiveOptions,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Self, PolygonizeError> {
        let plain = checked(frame, options, 1.0)?;
        let grid = BlockGrid { frame, open: false };
        let (roots, _) = find_blocks(field, &grid, &plain, None, &mut *progress)?;
        Ok(Self {
            field,
            options: *options,
            grids: Grids::new(frame, options.depth),
            samples: Samples::new(options.depth),
            roots,
        })
    }

    fn judge(&self, error: f64) -> Judge<'_> {
        Judge {
            field: self.field,
            grids: &self.grids,
            iso: self.options.iso,
            least: error,
            detection: self.options.detection,
        }
    }

    /// The octree whose cells keep a chord error `κ h²/8`.
    fn grow(&mut self, error: f64, watch: &mut Watch) -> Result<Tree, PolygonizeError> {
        checked(&self.grids.frames[0], &self.options, error)?;
        let limits = Limits {
            error,
            depth: self.options.depth,
            blocks: self.options.max_blocks,
        };
        let mut samples = std::mem::take(&mut self.samples);
        let tree = samples.grow(&self.judge(error), &self.roots, &limits, watch);
        self.samples = samples;
        tree
    }

    /// About how many triangles [`Self::mesh`] makes.
    ///
    /// # Errors
    /// Any [`PolygonizeError`].
    pub fn estimate(
        &mut self,
        error: f64,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<u64, PolygonizeError> {
        let tree = self.grow(error, &mut |_| progress(0.0))?;
        Ok(2 * tree::crossed_leaves(&tree))
    }

    /// The mesh of cells that keep the chord error `κ h²/8 <= error`, a world length above 0, `κ` the largest curvature
    /// in the cell and `h` its edge; with `settled`, its vertices spread and its edges turned so that the triangles
    /// are as good as they may be, at about a fifth of that error.
    ///
    /// # Errors
    /// Any [`PolygonizeError`].
    pub fn mesh(
        &mut self,
        error: f64,
        settled: bool,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<(AdaptiveMesh, AdaptiveReport), PolygonizeError> {
        let tree = self.grow(error, &mut |_| progress(0.0))?;
        let mut report = report_of(&tree, &self.options, error);
        report.blocks = self.samples.len() as u64;
        report.nan_nodes = self.samples.nan_nodes();
        let placer = Placer {
            field: self.field,
            grids: &self.grids,
            iso: self.options.iso,
            steps: steps(settled),
        };
        let vertices: Vec<Vec<BlockVertices>> = tree
            .iter()
            .enumerate()
            .map(|(level, blocks)| {
                let place = |scratch: &mut vertices::Scratch, block| {
                    BlockVertices::new(&placer, &Around::new(&tree, level, block), scratch)
                };
                let blocks = blocks.par_iter().with_min_len(4);
                blocks.map_init(vertices::Scratch::default, place).collect()
            })
            .collect();
        let open = self.options.open;
        let drawn = Drawn::new(&placer, &tree, &vertices, open)?;
        drop(tree);
        if self.options.frugal {
            self.samples = Samples::new(self.options.depth);
        }
        let (mut made, report) = drawn.join(&placer, &vertices, open, report);
        drop(vertices);
        if progress(0.5).is_break() {
            return Err(PolygonizeError::Cancelled);
        }
        if settled {
            settle_made(self.field, self.options.iso, error, &mut made);
        }
        if progress(1.0).is_break() {
            return Err(PolygonizeError::Cancelled);
        }
        Ok((made, report))
    }
}

/// Newton steps of the vertices: settling begins with one of its own.
fn steps(settled: bool) -> usize {
    if settled { 0 } else { STEPS }
}

fn settle_made(field: &dyn Field, iso: f64, error: f64, made: &mut AdaptiveMesh) {
    let Mesh {
        positions, triangles, ..
    } = &mut made.mesh;
    settle(
        field,
        iso,
        positions,
        triangles,
        &made.fixed,
        &SettleOptions::new(error),
    );
}

/// What is common with other meshes, if all of it makes sense.
fn checked(
    frame: &Frame,
    options: &AdaptiveOptions,
    error: f64,
) -> Result<PolygonizeOptions, PolygonizeError> {
    let plain = PolygonizeOptions {
        iso: options.iso,
        max_blocks: options.max_blocks,
        ..Default::default()
    };
    super::validate(frame, &plain)?;
    let room = (1u32 << PLACE_BITS)
        .checked_shr(options.depth as u32)
        .unwrap_or(0);
    let max = room.saturating_sub(2);
    if frame.cells.iter().any(|&n| n > max) {
        let cells = frame.cells;
        return Err(PolygonizeError::Cells { cells, max });
    }
    if !(error.is_finite() && error > 0.0) {
        return Err(PolygonizeError::Error { error });
    }
    Ok(plain)
}

/// What the leaves tell.
fn report_of(tree: &Tree, options: &AdaptiveOptions, error: f64) -> AdaptiveReport {
    let mut report = AdaptiveReport {
        crossed_leaves: tree::crossed_leaves(tree),
        ..Default::default()
    };
    for block in tree.get(options.depth).into_iter().flatten() {
        let sample: &Sample = &block.sample;
        for c in grid::each(tree::leaves(block)) {
            if f64::from(sample.error(c)) > error {
                report.leaves_at_limit += 1;
                report.creased_leaves += u64::from(grid::holds(&sample.creased, c));
            }
        }
    }
    report
}

/// The triangles of an octree, block by block.
struct Drawn {
    /// Blocks in the order of space, so that what is close in it is close in the mesh: place, level, number, key.
    order: Vec<(u64, usize, usize, BlockKey)>,
    /// Vertices of all leaves.
    count: u64,
    parts: Vec<BlockTriangles>,
}

impl Drawn {
    /// Draws the triangles between the vertices of an octree.
    fn new(
        placer: &Placer,
        tree: &Tree,
        vertices: &[Vec<BlockVertices>],
        open: bool,
    ) -> Result<Self, PolygonizeError> {
        let depth = placer.grids.depth();
        let mut order: Vec<(u64, usize, usize, BlockKey)> = tree
            .iter()
            .enumerate()
            .flat_map(|(level, blocks)| {
                blocks
                    .iter()
                    .enumerate()
                    .map(move |(n, b)| (order_of(b.key, level, depth), level, n, b.key))
            })
            .collect();
        order.sort_unstable();
        let mut first: Vec<Vec<u32>> = tree.iter().map(|blocks| vec![0; blocks.len()]).collect();
        let mut count: u64 = 0;
        for &(_, level, n, _) in &order {
            first[level][n] = count as u32;
            count += vertices[level][n].positions.len() as u64;
        }
        if count >= u64::from(EXTRA) {
            return Err(PolygonizeError::TooManyVertices { vertices: count });
        }
        let grid_from_world = placer.grids.inverses();
        let numbered = Numbered {
            vertices,
            first: |level: usize, n: usize| first[level][n],
            cells: placer.grids.frames[0].cells.map(|n| n as i32),
            mirrored: placer.grids.mirrored,
            grid_from_world: &grid_from_world,
            depth,
            open,
        };
        let parts = order
            .par_iter()
            .with_min_len(4)
            .map(|&(_, level, n, _)| {
                let mut out = BlockTriangles::default();
                numbered.triangles(&Around::new(tree, level, &tree[level][n]), &mut out)?;
                out.triangles.shrink_to_fit();
                Ok(out)
            })
            .collect::<Result<_, PolygonizeError>>()?;
        Ok(Self { order, count, parts })
    }

    /// Joins the blocks.
    fn join(
        self,
        placer: &Placer,
        vertices: &[Vec<BlockVertices>],
        open: bool,
        mut report: AdaptiveReport,
    ) -> (AdaptiveMesh, AdaptiveReport) {
        let Self { order, count, parts } = self;
        let mut made = AdaptiveMesh::default();
        made.mesh.positions.reserve_exact(count as usize);
        made.keys.reserve_exact(count as usize);
        made.fixed.reserve_exact(count as usize);
        let depth = placer.grids.depth();
        for &(_, level, n, key) in &order {
            let block = &vertices[level][n];
            made.mesh.positions.extend_from_slice(&block.positions);
            let names = block.names.iter();
            made.keys
                .extend(names.map(|name| key_of(depth, level, key, *name)));
            made.fixed.extend_from_slice(&block.fixed);
        }
        let extras: Vec<_> = parts
            .iter()
            .zip(&order)
            .map(|(p, o)| (o.1, &p.extras[..]))
            .collect();
        let extras = add_extras(placer.grids, &extras, &mut made);
        report.extra_vertices = made.mesh.positions.len() as u64 - count;
        let triangle_count = parts.iter().map(|p| p.triangles.len()).sum();
        made.mesh.triangles.reserve_exact(triangle_count);
        for (part, own) in parts.into_iter().zip(extras) {
            let known = |v: u32| if v < EXTRA { v } else { own[(v - EXTRA) as usize] };
            made.mesh
                .triangles
                .extend(part.triangles.iter().map(|t| t.map(known)));
        }
        if open {
            drop_unused(&mut made);
        }
        (made, report)
    }
}

/// Numbers, keys and places the vertices that no leaf has, given by part with its level; gives the numbers by part.
fn add_extras(
    grids: &Grids,
    parts: &[(usize, &[(ExtraKey, DVec3)])],
    made: &mut AdaptiveMesh,
) -> Vec<Vec<u32>> {
    let mut all: Vec<(ExtraKey, DVec3)> = Vec::new();
    for (level, extras) in parts {
        all.extend(extras.iter().map(|(key, p)| (*key, grids.world(*level, *p))));
    }
    if all.is_empty() {
        return parts.iter().map(|_| Vec::new()).collect();
    }
    all.sort_by_key(|e| e.0);
    all.dedup_by_key(|e| e.0);
    let first = made.mesh.positions.len() as u32;
    for (key, p) in &all {
        made.mesh.positions.push(*p);
        made.keys
            .push(key.iter().fold(u64::MAX, |hash, k| mixed(hash ^ *k as u64)));
        // Kept where they are: a piece of surface that is thinner than the cells hangs on them.
        made.fixed.push(true);
    }
    let number = |key: &ExtraKey| {
        first
            + all
                .binary_search_by_key(key, |e| e.0)
                .expect("every one is there") as u32
    };
    parts
        .iter()
        .map(|(_, extras)| extras.iter().map(|(key, _)| number(key)).collect())
        .collect()
}

/// The finalizer of SplitMix64.
fn mixed(x: u64) -> u64 {
    let z = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ z >> 31
}

/// Place of a block in the order of space; of two with one place, the coarser comes first.
fn order_of(key: BlockKey, level: usize, depth: usize) -> u64 {
    interleave(key.map(|k| ((i64::from(k) + 1) << (depth - level)) as u64))
}

/// Bits of three numbers below 2²¹ by turns, the first highest.
fn interleave(x: [u64; 3]) -> u64 {
    let spread = |x: u64| (0..21).fold(0, |s, bit| s | (x >> bit & 1) << (3 * bit));
    spread(x[0]) << 2 | spread(x[1]) << 1 | spread(x[2])
}

/// Drops vertices that no triangle uses.
fn drop_unused(made: &mut AdaptiveMesh) {
    let mut number = vec![u32::MAX; made.mesh.positions.len()];
    for corner in made.mesh.triangles.iter().flatten() {
        number[*corner as usize] = 0;
    }
    let mut next = 0;
    for n in &mut number {
        if *n == 0 {
            *n = next;
            next += 1;
        }
    }
    let mut kept = number.iter().map(|n| *n != u32::MAX);
    made.mesh.positions.retain(|_| kept.next() == Some(true));
    let mut kept = number.iter().map(|n| *n != u32::MAX);
    made.keys.retain(|_| kept.next() == Some(true));
    let mut kept = number.iter().map(|n| *n != u32::MAX);
    made.fixed.retain(|_| kept.next() == Some(true));
    for corner in made.mesh.triangles.iter_mut().flatten() {
        *corner = number[*corner as usize];
    }
}
