//! An adaptive mesh that follows a field as it changes in places.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use glam::DAffine3;
use rayon::prelude::*;

use super::around::Around;
use super::changed::Changed;
use super::grid::{Cells, Grids, NONE};
use super::octree::{Change, Place};
use super::patch::{Calming, calm};
use super::pieces::{At, Calm, Corner, Parts, Pen, Piece, corner};
use super::polygons::EXTRA;
use super::sample::Judge;
use super::tree::Limits;
use super::vertices::{self, BlockVertices, Placer};
use super::{AdaptiveOptions, checked, steps};
use crate::polygonize::blocks::{BlockGrid, CELLS, Dirty, find_blocks};
use crate::polygonize::{PolygonizeError, PolygonizeOptions};
use crate::{Aabb, Field, Frame};

/// Cells from a block at which Newton steps of its vertices ask the field, at most.
const NEWTON: f64 = 1.0;
/// Cells from a vertex at which the field is asked while it settles, or a triangle at it, at most.
const SETTLING: f64 = 3.0;

/// An adaptive mesh kept in blocks of 8³ cells, so that it can follow a field that changes in places.
///
/// After any number of updates [`Self::mesh`] is the mesh that [`super::AdaptiveMesher`] makes of the last field, to the
/// bit. An update costs what changed: octree, vertices and triangles are made anew where the field or their neighbours
/// are not what they were, and a settled mesh settles some rings of triangles about that. How far the settling of
/// one triangle is felt is not bounded by a proof; that it is not felt at the seam is seen at each update, by
/// the bits there, and else more is settled. Unsettled meshes are for while a stroke lasts.
pub struct AdaptiveBlockMesh {
    pub(super) frame: Frame,
    pub(super) options: AdaptiveOptions,
    pub(super) error: f64,
    pub(super) settled: bool,
    pub(super) grids: Grids,
    grid_from_world: Vec<DAffine3>,
    pub(super) parts: Parts,
    /// Whether the parts are those of the field last followed.
    is_known: bool,
}

/// A block of an adaptive mesh: cells `8·block .. 8·block + 8` of the frame halved `level` times.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct AdaptiveBlock {
    /// Halvings of the frame's cells.
    pub level: usize,
    /// Place among the blocks of the level.
    pub block: [i32; 3],
}

/// What an update of an adaptive mesh did.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct AdaptiveUpdate {
    /// Blocks whose part of the mesh may be new or gone, in order; see [`AdaptiveBlockMesh::piece`].
    pub changed: Vec<AdaptiveBlock>,
    /// Blocks in which the field was sampled or cells were judged.
    pub sampled: usize,
    /// Blocks whose vertices were placed.
    pub placed: usize,
    /// Blocks whose triangles were drawn.
    pub drawn: usize,
    /// Triangles that settled.
    pub settled: usize,
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
        let grids = Grids::new(frame, options.depth);
        let mut mesh = Self {
            frame: *frame,
            options: *options,
            error,
            settled,
            grid_from_world: grids.inverses(),
            grids,
            parts: Parts::new(options.depth),
            is_known: false,
        };
        mesh.update(field, &[])?;
        Ok(mesh)
    }

    /// Follows a change: `field` is what was meshed before, but for the inside of the boxes `changed` (world
    /// coordinates, ends included), which may overlap.
    ///
    /// # Errors
    /// Any [`PolygonizeError`] but `Cancelled`; the mesh is then empty until the next update, which makes all of it.
    pub fn update(&mut self, field: &dyn Field, changed: &[Aabb]) -> Result<AdaptiveUpdate, PolygonizeError> {
        if changed.is_empty() && self.is_known {
            return Ok(AdaptiveUpdate::default());
        }
        let grid = self.grid();
        let known = (Changed::new(&self.grids, changed), Dirty::new(&grid, changed));
        let result = match known {
            (Some(boxes), Some(dirty)) if self.is_known => {
                self.follow(field, &boxes, Some((&dirty, changed)))
            }
            _ => {
                self.parts = Parts::new(self.options.depth);
                self.follow(field, &Changed::everywhere(self.options.depth), None)
            }
        };
        self.is_known = result.is_ok();
        if !self.is_known {
            self.parts = Parts::new(self.options.depth);
        }
        result
    }

    fn follow(
        &mut self,
        field: &dyn Field,
        boxes: &Changed,
        dirty: Option<(&Dirty, &[Aabb])>,
    ) -> Result<AdaptiveUpdate, PolygonizeError> {
        let plain = PolygonizeOptions {
            iso: self.options.iso,
            max_blocks: self.options.max_blocks,
            ..Default::default()
        };
        let first = dirty.map(|d| d.0);
        let (roots, _) = find_blocks(field, &self.grid(), &plain, first, |_| ControlFlow::Continue(()))?;
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
        let followed = self.parts.octree.follow(&Change {
            judge: &judge,
            roots: &roots,
            dirty: first.map_or(&[][..], Dirty::blocks),
            boxes,
            limits: &limits,
        })?;
        let mut update = AdaptiveUpdate {
            sampled: followed.sampled,
            ..Default::default()
        };
        let mut changed: Vec<AdaptiveBlock> = Vec::new();
        for (level, blocks) in self.parts.octree.tree.iter().enumerate() {
            let count = blocks.len();
            self.parts.vertices[level].resize_with(count, Default::default);
            self.parts.pieces[level].resize_with(count, Default::default);
            self.parts.calm[level].resize_with(count, Default::default);
        }
        for &((level, slot), block) in &followed.gone {
            let slot = slot as usize;
            self.parts.vertices[level][slot] = BlockVertices::default();
            self.parts.calm[level][slot] = Calm::default();
            if self.parts.pieces[level][slot] != Piece::default() {
                self.parts.pieces[level][slot] = Piece::default();
                changed.push(AdaptiveBlock { level, block });
            }
        }
        let world = dirty.map(|d| d.1);
        let mut seeds: Vec<At> = Vec::new();

        let renew = self.to_place(boxes, world, &followed.about);
        let moved = self.place(field, &renew, &mut seeds);
        update.placed = renew.len();

        let mut redraw = followed.about;
        redraw.extend(&followed.dirty);
        for &(place, leaves) in &moved {
            redraw.extend(self.parts.octree.touching(place, &leaves));
        }
        let moved: Vec<Place> = moved.into_iter().map(|(place, _)| place).collect();
        let touched = self.draw(&mut redraw, &moved, &mut seeds)?;
        update.drawn = redraw.len();
        let block = |parts: &Parts, place: Place| AdaptiveBlock {
            level: place.0,
            block: parts.octree.block(place).key,
        };
        changed.extend(touched.iter().map(|place| block(&self.parts, *place)));

        if self.settled {
            let near = world.map_or_else(Vec::new, |_| self.near(boxes, world, SETTLING));
            for (place, among) in near {
                let map = &self.grid_from_world[place.0];
                let vertices = self.parts.vertices_of(place).positions.iter().enumerate();
                seeds.extend(
                    vertices
                        .filter(|(_, p)| {
                            let at = map.transform_point3(**p).to_array();
                            among.iter().any(|b| boxes.meets(place.0, at, 0.0, SETTLING, *b))
                        })
                        .map(|(n, _)| (place, n)),
                );
            }
            let by = Calming {
                field,
                iso: self.options.iso,
                error: self.error,
                grids: &self.grids,
            };
            let (settled, touched) = calm(&mut self.parts, world.is_some().then_some(&seeds[..]), &by);
            update.settled = settled;
            changed.extend(touched.iter().map(|place| block(&self.parts, *place)));
        }
        changed.sort_unstable();
        changed.dedup();
        update.changed = changed;
        Ok(update)
    }

    /// Blocks within `reach` of their cells from the boxes, with the boxes.
    fn near(&self, boxes: &Changed, world: Option<&[Aabb]>, reach: f64) -> Vec<(Place, Vec<u32>)> {
        let octree = &self.parts.octree;
        let wide = world.and_then(|boxes| {
            let reach = reach * self.grids.size(0).max_element();
            let wide: Vec<Aabb> = boxes
                .iter()
                .map(|b| Aabb::new(b.min - reach, b.max + reach))
                .collect();
            Dirty::new(&self.grid(), &wide)
        });
        let first: Vec<Place> = match wide {
            Some(wide) => {
                let found = wide.blocks().iter().filter_map(|key| octree.slot(0, *key));
                found.map(|slot| (0, slot)).collect()
            }
            None => octree.places().take_while(|place| place.0 == 0).collect(),
        };
        let meeting = |place: Place, among: &[u32]| {
            let met = boxes.meeting(place.0, octree.block(place).key, reach, among);
            (!met.is_empty()).then_some((place, met))
        };
        let all = boxes.all();
        let mut found: Vec<(Place, Vec<u32>)> = first.into_iter().filter_map(|p| meeting(p, &all)).collect();
        let mut done = 0;
        while let Some((place, among)) = found.get(done) {
            let children = octree.block(*place).children.into_iter().filter(|c| *c != NONE);
            let below: Vec<_> = children
                .filter_map(|c| meeting((place.0 + 1, c), among))
                .collect();
            found.extend(below);
            done += 1;
        }
        found
    }

    /// Blocks whose vertices are to be placed, with the cells in which: all in blocks that are divided otherwise or lie
    /// beside such, else those near the change.
    fn to_place(&self, boxes: &Changed, world: Option<&[Aabb]>, about: &[Place]) -> Vec<(Place, Cells)> {
        const ALL: Cells = [u64::MAX; CELLS];
        let mut renew: Vec<(Place, Cells)> = about.iter().map(|place| (*place, ALL)).collect();
        for (place, among) in self.near(boxes, world, NEWTON) {
            let own = self.parts.octree.block(place).key;
            let stale = boxes.cells(place.0, own, NEWTON, &among);
            if about.binary_search(&place).is_err() && stale != [0; CELLS] {
                renew.push((place, stale));
            }
        }
        renew.sort_unstable();
        renew
    }

    /// Places the vertices of some cells of blocks anew; gives the blocks where that changed something, with the leaves,
    /// and adds the vertices that are new or moved to `seeds`.
    fn place(
        &mut self,
        field: &dyn Field,
        renew: &[(Place, Cells)],
        seeds: &mut Vec<At>,
    ) -> Vec<(Place, Cells)> {
        let tree = &self.parts.octree.tree;
        let placer = Placer {
            field,
            grids: &self.grids,
            iso: self.options.iso,
            steps: steps(self.settled),
        };
        let made: Vec<BlockVertices> = renew
            .par_iter()
            .with_min_len(2)
            .map_init(vertices::Scratch::default, |scratch, ((level, slot), cells)| {
                let around = Around::new(tree, *level, &tree[*level][*slot as usize]);
                let old = &self.parts.vertices[*level][*slot as usize];
                BlockVertices::renewed(&placer, &around, Some((old, cells)), scratch)
            })
            .collect();
        let mut moved = Vec::new();
        for (&((level, slot), _), new) in renew.iter().zip(made) {
            let old = &mut self.parts.vertices[level][slot as usize];
            if old.is_same(&new) {
                continue;
            }
            moved.push(((level, slot), old.changed(&new)));
            if self.settled {
                let calm = &mut self.parts.calm[level][slot as usize];
                let mut positions = new.positions.clone();
                for (n, name) in new.names.iter().enumerate() {
                    let known = old.find(*name);
                    if let Some(k) = known {
                        positions[n] = calm.positions[k];
                    }
                    if !known.is_some_and(|k| new.is_same_at(n, old, k)) {
                        seeds.push(((level, slot), n));
                    }
                }
                calm.positions = positions;
            }
            *old = new;
        }
        moved
    }

    /// Draws the triangles of some blocks anew, which it sorts; gives the blocks whose triangles are new or have corners
    /// in the blocks `moved`, and adds the corners of new triangles to `seeds`.
    fn draw(
        &mut self,
        redraw: &mut Vec<Place>,
        moved: &[Place],
        seeds: &mut Vec<At>,
    ) -> Result<Vec<Place>, PolygonizeError> {
        redraw.sort_unstable();
        redraw.dedup();
        // A polygon belongs to a block that has one of its vertices.
        redraw.retain(|place| {
            let is_bare = self.parts.vertices_of(*place).names.is_empty();
            !(is_bare && self.parts.piece_of(*place).triangles.is_empty())
        });
        let pen = Pen {
            cells: self.grids.frames[0].cells.map(|n| n as i32),
            mirrored: self.grids.mirrored,
            grid_from_world: &self.grid_from_world,
            open: self.options.open,
        };
        let parts = &self.parts;
        let made = redraw.par_iter().with_min_len(2);
        let made: Vec<Piece> = made
            .map(|place| parts.draw(&pen, *place))
            .collect::<Result<_, _>>()?;
        let mut touched = Vec::new();
        for (&place, new) in redraw.iter().zip(made) {
            let (level, slot) = (place.0, place.1 as usize);
            let old = &self.parts.pieces[level][slot];
            let is_same = *old == new;
            let corners = |t: &[u32; 3]| t.map(corner);
            let is_moved = |c: Corner| match c {
                Corner::Of(n, _) => self
                    .parts
                    .about(place, n)
                    .is_some_and(|p| moved.binary_search(&p).is_ok()),
                Corner::Extra(_) => false,
            };
            if !is_same || (!self.settled && new.triangles.iter().flat_map(corners).any(is_moved)) {
                touched.push(place);
            }
            if is_same {
                continue;
            }
            if self.settled {
                let mut known: BTreeMap<[u32; 3], u32> = BTreeMap::new();
                if old.extras == new.extras {
                    known.extend(old.triangles.iter().zip(0..).map(|(t, n)| (*t, n)));
                } else {
                    let plain = old.triangles.iter().zip(0..);
                    let plain = plain.filter(|(t, _)| t.iter().all(|c| *c < EXTRA));
                    known.extend(plain.map(|(t, n)| (*t, n)));
                }
                let calm = &self.parts.calm[level][slot];
                let mut turned = Vec::new();
                for (n, t) in new.triangles.iter().enumerate() {
                    match known.get(t) {
                        Some(before) => turned.extend(calm.turned(*before).map(|keys| (n as u32, keys))),
                        None => seeds.extend(corners(t).into_iter().filter_map(|c| match c {
                            Corner::Of(about, name) => {
                                let holder = self.parts.about(place, about)?;
                                Some((holder, self.parts.vertices_of(holder).find(name)?))
                            }
                            Corner::Extra(_) => None,
                        })),
                    }
                }
                self.parts.calm[level][slot].turned = turned;
            }
            self.parts.pieces[level][slot] = new;
        }
        Ok(touched)
    }

    fn grid(&self) -> BlockGrid<'_> {
        BlockGrid {
            frame: &self.frame,
            open: false,
        }
    }
}
