//! Settles the part of a mesh that changed, as it settles in the whole.
//!
//! A vertex settles by what lies within some rings of triangles. So the triangles within [`REACH`] + [`EDGE`] rings of
//! what changed settle as a mesh of its own, its border held, and those within [`REACH`] are taken over. That neither
//! the change nor the border reaches the seam is seen by the last [`SEAM`] of these rings: they must come out with the
//! bits that they had. If they do not, the patch is made twice as wide, at most the whole of the pieces that it meets.

use std::collections::BTreeMap;

use glam::DVec3;
use rustc_hash::FxHashMap;

use super::grid::{Grids, NONE};
use super::octree::Place;
use super::order_of;
use super::pieces::{ABOUT, At, Corner, Parts, corner};
use super::polygons::ExtraKey;
use super::splice::Splice;
use super::vertices::LOOP_BITS;
use crate::Field;
use crate::polygonize::blocks::CELLS;
use crate::polygonize::settle::{SettleOptions, settle};

/// Rings about a change that are taken over. Of 274 strokes on splines 271 moved vertices within 4 rings, the farthest was
/// 11 rings away; on an even ball, where all edges are about as good as their opposites, it was 9.
const REACH: u32 = 13;
/// Further rings, for the border.
const EDGE: u32 = 11;
/// Rings by which the seam is judged.
const SEAM: u32 = 3;

/// What to settle by.
#[derive(Clone, Copy)]
pub(super) struct Calming<'a> {
    pub field: &'a dyn Field,
    pub iso: f64,
    pub error: f64,
    pub grids: &'a Grids,
}

/// Settles what lies about the vertices `seeds`, or the whole mesh; tells how many triangles settled, those of vain
/// attempts too, and the blocks whose settled triangles may have changed.
pub(super) fn calm(parts: &mut Parts, seeds: Option<&[At]>, by: &Calming) -> (usize, Vec<Place>) {
    let mut settled = 0;
    let mut width = 1;
    loop {
        let mut patch = Patch::new(parts, by);
        let reach = match seeds {
            Some(seeds) => patch.grow(seeds, width * (REACH + EDGE)).then_some(width * REACH),
            None => {
                patch.take_all();
                None
            }
        };
        let after = patch.settle(width * (REACH + EDGE));
        settled += after.triangles.len();
        if let Some(splice) = patch.splice(&after, reach) {
            return (settled, splice.put(parts));
        }
        width *= 2;
    }
}

/// Triangles about a change, their vertices numbered as they are met.
struct Patch<'a> {
    parts: &'a Parts,
    by: Calming<'a>,
    blocks: Vec<Block>,
    ids: FxHashMap<Place, u32>,
    vertices: Vec<Vertex>,
    extras: BTreeMap<ExtraKey, (u32, DVec3)>,
    triangles: Vec<[u32; 3]>,
    /// For each corner the next one of the same vertex.
    next: Vec<u32>,
}

struct Block {
    place: Place,
    /// Number of its first vertex.
    first: u32,
    /// Its triangles, once they are loaded.
    triangles: Option<std::ops::Range<u32>>,
    /// Whether all triangles at its vertices are loaded.
    is_complete: bool,
    /// Number of the first vertex of each leaf that has any, once one was asked for.
    starts: Vec<u16>,
}

impl Block {
    /// Number of the vertex of that name, of the block's `names`. Six triangles ask for each vertex: a table instead of as
    /// many searches.
    fn number(&mut self, names: &[u16], name: u16) -> Option<usize> {
        let leaf = |name: u16| usize::from(name >> LOOP_BITS);
        if self.starts.is_empty() {
            self.starts.resize(CELLS.pow(3), 0);
            for (n, name) in names.iter().enumerate().rev() {
                self.starts[leaf(*name)] = n as u16;
            }
        }
        let start = usize::from(self.starts[leaf(name)]);
        let of_leaf = names[start..].iter();
        Some(start + of_leaf.take_while(|n| **n <= name).position(|n| *n == name)?)
    }
}

#[derive(Clone, Copy)]
struct Vertex {
    /// Number of its block; none for one that no leaf has.
    block: u32,
    /// Rings from what changed.
    distance: u32,
    /// First of its corners.
    corner: u32,
}

/// A patch that has settled.
struct Settled {
    /// Triangles of the patch that took part.
    chosen: Vec<u32>,
    /// Vertices of the patch that took part.
    used: Vec<u32>,
    positions: Vec<DVec3>,
    /// By numbers of the patch.
    triangles: Vec<[u32; 3]>,
}

impl<'a> Patch<'a> {
    fn new(parts: &'a Parts, by: &Calming<'a>) -> Self {
        Self {
            parts,
            by: *by,
            blocks: Vec::new(),
            ids: FxHashMap::default(),
            vertices: Vec::new(),
            extras: BTreeMap::new(),
            triangles: Vec::new(),
            next: Vec::new(),
        }
    }

    fn id(&mut self, place: Place) -> u32 {
        let next = self.blocks.len() as u32;
        let id = *self.ids.entry(place).or_insert(next);
        if id == next {
            self.blocks.push(Block {
                place,
                first: self.vertices.len() as u32,
                triangles: None,
                is_complete: false,
                starts: Vec::new(),
            });
            let count = self.parts.vertices_of(place).names.len();
            self.vertices.resize(
                self.vertices.len() + count,
                Vertex {
                    block: id,
                    distance: NONE,
                    corner: NONE,
                },
            );
        }
        id
    }

    fn vertex(&mut self, (place, number): At) -> u32 {
        let id = self.id(place);
        self.blocks[id as usize].first + number as u32
    }

    /// Takes in the triangles of a block.
    fn load(&mut self, place: Place) {
        let id = self.id(place) as usize;
        if self.blocks[id].triangles.is_some() {
            return;
        }
        let start = self.triangles.len() as u32;
        let piece = self.parts.piece_of(place);
        let extras: Vec<u32> = piece
            .extras
            .iter()
            .map(|(key, at)| self.extra(place, *key, *at))
            .collect();
        let mut about = [None; ABOUT];
        for t in &piece.triangles {
            let corners = t.map(|code| match corner(code) {
                Corner::Extra(n) => extras[n],
                Corner::Of(n, name) => {
                    let (id, names) = *about[n].get_or_insert_with(|| {
                        let holder = self.parts.about(place, n).expect("it was drawn");
                        (self.id(holder), &self.parts.vertices_of(holder).names[..])
                    });
                    let holder = &mut self.blocks[id as usize];
                    holder.first + holder.number(names, name).expect("it was drawn") as u32
                }
            });
            for v in corners {
                let vertex = &mut self.vertices[v as usize];
                let at = self.next.len() as u32;
                self.next.push(std::mem::replace(&mut vertex.corner, at));
            }
            self.triangles.push(corners);
        }
        self.blocks[id].triangles = Some(start..self.triangles.len() as u32);
    }

    fn extra(&mut self, (level, _): Place, key: ExtraKey, at: DVec3) -> u32 {
        let next = self.vertices.len() as u32;
        let (id, _) = *self
            .extras
            .entry(key)
            .or_insert_with(|| (next, self.by.grids.world(level, at)));
        if id == next {
            self.vertices.push(Vertex {
                block: NONE,
                distance: NONE,
                corner: NONE,
            });
        }
        id
    }

    /// The whole mesh.
    fn take_all(&mut self) {
        for place in self.parts.octree.places() {
            self.load(place);
        }
        for vertex in &mut self.vertices {
            vertex.distance = 0;
        }
    }

    /// Takes in `rings` rings of triangles about the seeds; tells whether there are more beyond.
    fn grow(&mut self, seeds: &[At], rings: u32) -> bool {
        let parts = self.parts;
        let mut queue: Vec<u32> = seeds.iter().map(|at| self.vertex(*at)).collect();
        queue.sort_unstable();
        queue.dedup();
        for v in &queue {
            self.vertices[*v as usize].distance = 0;
        }
        let mut done = 0;
        while let Some(&v) = queue.get(done) {
            done += 1;
            let Vertex { block, distance, .. } = self.vertices[v as usize];
            if distance >= rings {
                return true;
            }
            if block != NONE && !std::mem::replace(&mut self.blocks[block as usize].is_complete, true) {
                let place = self.blocks[block as usize].place;
                for other in parts.octree.neighbours(place).chain(parts.octree.finer(place)) {
                    self.load(other);
                }
            }
            let mut at = self.vertices[v as usize].corner;
            while at != NONE {
                for u in self.triangles[at as usize / 3] {
                    let vertex = &mut self.vertices[u as usize];
                    if vertex.distance == NONE {
                        vertex.distance = distance + 1;
                        queue.push(u);
                    }
                }
                at = self.next[at as usize];
            }
        }
        false
    }

    /// Rings from what changed to a triangle.
    fn distance(&self, triangle: u32) -> u32 {
        let corners = self.triangles[triangle as usize];
        let [a, b, c] = corners.map(|v| self.vertices[v as usize].distance);
        a.min(b).min(c)
    }

    /// Settles the triangles with a corner less than `rings` rings away, numbered in the order of the whole mesh.
    fn settle(&self, rings: u32) -> Settled {
        let (parts, by) = (self.parts, &self.by);
        let depth = parts.octree.tree.len() - 1;
        let mut order: Vec<(u64, usize, usize)> = (0..self.blocks.len())
            .map(|n| {
                let place = self.blocks[n].place;
                (
                    order_of(parts.octree.block(place).key, place.0, depth),
                    place.0,
                    n,
                )
            })
            .collect();
        order.sort_unstable();
        let chosen: Vec<u32> = order
            .iter()
            .flat_map(|(_, _, n)| self.blocks[*n].triangles.clone().unwrap_or_default())
            .filter(|t| self.distance(*t) < rings)
            .collect();
        let mut number = vec![NONE; self.vertices.len()];
        for t in &chosen {
            for v in self.triangles[*t as usize] {
                number[v as usize] = 0;
            }
        }
        let (mut used, mut positions, mut fixed) = (Vec::new(), Vec::new(), Vec::new());
        for (_, _, n) in &order {
            let Block { place, first, .. } = &self.blocks[*n];
            let own = parts.vertices_of(*place);
            for (k, at) in own.positions.iter().enumerate() {
                let v = first + k as u32;
                if number[v as usize] != NONE {
                    number[v as usize] = used.len() as u32;
                    used.push(v);
                    positions.push(*at);
                    fixed.push(own.fixed[k]);
                }
            }
        }
        for (v, at) in self.extras.values() {
            if number[*v as usize] != NONE {
                number[*v as usize] = used.len() as u32;
                used.push(*v);
                positions.push(*at);
                fixed.push(true);
            }
        }
        let numbered = |t: &u32| self.triangles[*t as usize].map(|v| number[v as usize]);
        let mut triangles: Vec<[u32; 3]> = chosen.iter().map(numbered).collect();
        settle(
            by.field,
            by.iso,
            &mut positions,
            &mut triangles,
            &fixed,
            &SettleOptions::new(by.error),
        );
        for t in &mut triangles {
            *t = t.map(|v| used[v as usize]);
        }
        Settled {
            chosen,
            used,
            positions,
            triangles,
        }
    }

    /// What is to be taken over: all, or what is within `reach` rings; `None` if its seam is not what it was.
    fn splice(&self, after: &Settled, reach: Option<u32>) -> Option<Splice> {
        let (reach, seam) = reach.map_or((NONE, NONE), |reach| (reach, reach - SEAM));
        let mut splice = Splice::default();
        let mut is_moved = vec![false; self.vertices.len()];
        for (&v, &to) in after.used.iter().zip(&after.positions) {
            let Vertex { block, distance, .. } = self.vertices[v as usize];
            if block == NONE || distance > reach {
                continue;
            }
            let Block { place, first, .. } = self.blocks[block as usize];
            let number = (v - first) as usize;
            let from = self.parts.calm_of(place).positions[number];
            if from.to_array().map(f64::to_bits) != to.to_array().map(f64::to_bits) {
                if distance > seam {
                    return None;
                }
                is_moved[v as usize] = true;
                splice.positions.push(((place, number), to));
            }
        }
        let key = |v: u32| {
            let block = &self.blocks[self.vertices[v as usize].block as usize];
            self.parts.key(block.place, (v - block.first) as usize)
        };
        // The triangles of a block follow each other.
        let mut blocks = self.blocks_of(&after.chosen);
        for (&t, corners) in after.chosen.iter().zip(&after.triangles) {
            let distance = self.distance(t);
            let n = blocks.next().expect("each has one");
            if distance > reach {
                continue;
            }
            let Block { place, triangles, .. } = &self.blocks[n];
            let number = t - triangles.as_ref().expect("it was loaded").start;
            let from = self.parts.calm_of(*place).turned(number);
            let to = (*corners != self.triangles[t as usize]).then(|| corners.map(key));
            if to != from {
                if distance > seam {
                    return None;
                }
                splice.triangles.push((*place, number, to));
            }
            if to != from || corners.iter().any(|v| is_moved[*v as usize]) {
                splice.changed.push(*place);
            }
        }
        splice.changed.dedup();
        Some(splice)
    }

    /// The block of each of some triangles, those of a block one after the other.
    fn blocks_of(&self, triangles: &[u32]) -> impl Iterator<Item = usize> {
        let mut starts: Vec<(u32, usize)> = self
            .blocks
            .iter()
            .enumerate()
            .filter_map(|(n, b)| Some((b.triangles.clone().filter(|t| !t.is_empty())?.start, n)))
            .collect();
        starts.sort_unstable();
        let mut block = 0..0;
        let mut n = 0;
        triangles.iter().map(move |t| {
            if !block.contains(t) {
                let after = starts.partition_point(|(start, _)| start <= t);
                let end = starts.get(after).map_or(u32::MAX, |next| next.0);
                (block, n) = (starts[after - 1].0..end, starts[after - 1].1);
            }
            n
        })
    }
}
