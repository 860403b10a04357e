//! An adaptive mesh that follows a field as it changes in places.

use std::ops::ControlFlow;
use std::sync::Arc;

use rayon::prelude::*;

use super::around::Around;
use super::grid::{Cells, Grids, NONE};
use super::sample::{Judge, Sample};
use super::tree::{Block, Limits, Samples, Tree};
use super::vertices::{self, BlockVertices, Placer};
use super::{AdaptiveMesh, AdaptiveOptions, AdaptiveReport, Drawn, checked, report_of, settle_made, steps};
use crate::polygonize::blocks::{BlockGrid, BlockKey, Dirty, find_blocks};
use crate::polygonize::{PolygonizeError, PolygonizeOptions};
use crate::{Aabb, Field, Frame};

/// An adaptive mesh kept in blocks of 8³ cells, so that it can follow a field that changes in places.
///
/// After any number of updates [`Self::mesh`] is the mesh that [`super::AdaptiveMesher`] makes of the last field, to the
/// bit. The field is asked again only where it changed; joining the blocks, and settling, take time in proportion to the
/// mesh. Unsettled meshes are for while a stroke lasts.
pub struct AdaptiveBlockMesh {
    frame: Frame,
    options: AdaptiveOptions,
    error: f64,
    settled: bool,
    grids: Grids,
    samples: Samples,
    roots: Vec<BlockKey>,
    tree: Tree,
    vertices: Vec<Vec<Arc<BlockVertices>>>,
}

impl AdaptiveBlockMesh {
    /// The surface of `field` over the cells of `frame`, in cells that keep the chord error `error`, a world length;
    /// `settled` as of [`super::AdaptiveMesher::mesh`].
    ///
    /// # Errors
    /// Any [`PolygonizeError`] but `Cancelled`.
    pub fn new(
        field: &dyn Field,
        frame: &Frame,
        options: &AdaptiveOptions,
        error: f64,
        settled: bool,
    ) -> Result<Self, PolygonizeError> {
        checked(frame, options, error)?;
        let mut mesh = Self {
            frame: *frame,
            options: *options,
            error,
            settled,
            grids: Grids::new(frame, options.depth),
            samples: Samples::new(options.depth),
            roots: Vec::new(),
            tree: Tree::new(),
            vertices: Vec::new(),
        };
        mesh.follow(field, None)?;
        Ok(mesh)
    }

    /// Follows a change: `field` is what was meshed before, but for the inside of the boxes `changed` (world
    /// coordinates, ends included), which may overlap. Tells how many blocks were placed anew.
    ///
    /// # Errors
    /// Any [`PolygonizeError`] but `Cancelled`; the mesh is then empty until the next update.
    pub fn update(&mut self, field: &dyn Field, changed: &[Aabb]) -> Result<usize, PolygonizeError> {
        if changed.is_empty() {
            return Ok(0);
        }
        self.follow(field, Some(changed))
    }

    /// The whole mesh of `field`, which is the one last followed.
    ///
    /// # Errors
    /// [`PolygonizeError::TooManyVertices`], [`PolygonizeError::InconsistentField`].
    pub fn mesh(&self, field: &dyn Field) -> Result<(AdaptiveMesh, AdaptiveReport), PolygonizeError> {
        let report = report_of(&self.samples, &self.tree, &self.options, self.error);
        let placer = self.placer(field);
        let open = self.options.open;
        let drawn = Drawn::new(&placer, &self.tree, &self.vertices, open)?;
        let (mut made, report) = drawn.join(&placer, &self.vertices, open, report);
        if self.settled {
            settle_made(field, self.options.iso, self.error, &mut made);
        }
        Ok((made, report))
    }

    /// Blocks of 8³ cells over all levels.
    pub fn block_count(&self) -> usize {
        self.tree.iter().map(Vec::len).sum()
    }

    fn placer<'a>(&'a self, field: &'a dyn Field) -> Placer<'a> {
        Placer {
            field,
            grids: &self.grids,
            iso: self.options.iso,
            steps: steps(self.settled),
        }
    }

    fn follow(&mut self, field: &dyn Field, changed: Option<&[Aabb]>) -> Result<usize, PolygonizeError> {
        // What fails leaves nothing that could be taken for known.
        let mut samples = std::mem::replace(&mut self.samples, Samples::new(self.options.depth));
        let old = (std::mem::take(&mut self.tree), std::mem::take(&mut self.vertices));
        let mut roots = std::mem::take(&mut self.roots);
        let dirty: Option<Vec<Dirty>> = changed.and_then(|boxes| {
            (0..=self.options.depth)
                .map(|level| Dirty::new(&self.block_grid(level), boxes))
                .collect()
        });
        let plain = PolygonizeOptions {
            iso: self.options.iso,
            max_blocks: self.options.max_blocks,
            ..Default::default()
        };
        let go_on = |_| ControlFlow::Continue(());
        let first = dirty.as_ref().map(|d| &d[0]);
        let (found, _) = find_blocks(field, &self.block_grid(0), &plain, first, go_on)?;
        match &dirty {
            Some(dirty) => {
                roots.retain(|key| !dirty[0].contains(0, *key));
                samples.forget(|level, key| dirty[level].contains(0, key));
            }
            None => {
                roots.clear();
                samples = Samples::new(self.options.depth);
            }
        }
        roots.extend(found);
        roots.sort_unstable();
        let judge = Judge {
            field,
            grids: &self.grids,
            iso: self.options.iso,
            least: self.error,
            detection: self.options.detection,
        };
        let limits = Limits {
            error: self.error,
            depth: self.options.depth,
            blocks: self.options.max_blocks,
        };
        let tree = samples.grow(&judge, &roots, &limits, &mut |_| ControlFlow::Continue(()))?;
        // Newton steps reach half a cell beyond a block.
        let near: Option<Vec<Dirty>> = changed.and_then(|boxes| {
            (0..=self.options.depth)
                .map(|level| {
                    let reach = self.grids.size(level).max_element();
                    let wide: Vec<Aabb> = boxes
                        .iter()
                        .map(|b| Aabb::new(b.min - reach, b.max + reach))
                        .collect();
                    Dirty::new(&self.block_grid(level), &wide)
                })
                .collect()
        });
        let placer = self.placer(field);
        let mut renewed = 0;
        let mut vertices = Vec::with_capacity(tree.len());
        for (level, blocks) in tree.iter().enumerate() {
            let keep = |block: &Block| {
                let near = near.as_ref()?;
                let at = old
                    .0
                    .get(level)?
                    .binary_search_by_key(&block.key, |b| b.key)
                    .ok()?;
                let before = &old.0[level][at];
                let same = !near[level].contains(0, block.key)
                    && same_about((&old.0, before), (&tree, block), level);
                same.then(|| old.1[level][at].clone())
            };
            let made: Vec<(bool, Arc<BlockVertices>)> = blocks
                .par_iter()
                .with_min_len(4)
                .map_init(vertices::Scratch::default, |scratch, block| match keep(block) {
                    Some(known) => (false, known),
                    None => {
                        let around = Around::new(&tree, level, block);
                        (true, Arc::new(BlockVertices::new(&placer, &around, scratch)))
                    }
                })
                .collect();
            renewed += made.iter().filter(|(new, _)| *new).count();
            vertices.push(made.into_iter().map(|(_, v)| v).collect());
        }
        (self.samples, self.roots, self.tree, self.vertices) = (samples, roots, tree, vertices);
        Ok(renewed)
    }

    fn block_grid(&self, level: usize) -> BlockGrid<'_> {
        let frame = if level == 0 {
            &self.frame
        } else {
            &self.grids.frames[level]
        };
        BlockGrid { frame, open: false }
    }
}

/// Whether all that the vertices of a block are made of is the same in two trees, but for the field itself.
fn same_about(old: (&Tree, &Block), new: (&Tree, &Block), level: usize) -> bool {
    let sets = |(tree, block): (&Tree, &Block), n: usize| -> [Cells; 2] {
        match block.neighbours[n] {
            NONE => [[0; 8]; 2],
            at => {
                let b = &tree[level][at as usize];
                [b.exists, b.split]
            }
        }
    };
    let fine = |(tree, block): (&Tree, &Block), n: usize, octant: usize| -> Option<*const Sample> {
        let at = block.neighbours[n];
        let child = (at != NONE).then(|| tree[level][at as usize].children[octant])?;
        (child != NONE).then(|| Arc::as_ptr(&tree[level + 1][child as usize].sample))
    };
    Arc::ptr_eq(&old.1.sample, &new.1.sample)
        && (0..27).all(|n| {
            sets(old, n) == sets(new, n) && (0..8).all(|octant| fine(old, n, octant) == fine(new, n, octant))
        })
}
