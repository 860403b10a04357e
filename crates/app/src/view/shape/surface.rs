//! Triangles of an object, of some fineness.

use std::collections::BTreeMap;

use bspline::polygonize::{AdaptiveBlock, AdaptiveBlockMesh, AdaptiveOptions, Mesh, PolygonizeError};
use bspline::{Aabb, Field, Frame};
use document::Object;
use glam::{DAffine3, DVec3};
use rayon::prelude::*;
use tools::paint::{Substance, values};

use super::{HOLLOW, NOTHING, Vertex};
use crate::view::pick::side;

/// Fewest cells along the longest side of the box that triangles begin with; there are fewer than twice as many.
const CELLS: u32 = 24;

/// Fewest triangles of a block, of many: there are about 250.
const OF_BLOCK: usize = 48;

/// A place among blocks of one fineness, which holds blocks of all.
pub type Part = [i32; 3];

/// Triangles of a block.
#[derive(Default)]
pub struct Made {
    pub vertices: Vec<Vertex>,
    /// Three for each triangle.
    pub indices: Vec<u32>,
}

/// Triangles that follow an object.
pub struct Surface {
    mesh: AdaptiveBlockMesh,
    /// What it follows.
    object: Object,
    error: f64,
    /// Halvings of the first blocks that give parts.
    halvings: u32,
    /// Of each part the blocks with triangles.
    parts: BTreeMap<Part, BTreeMap<AdaptiveBlock, Made>>,
}

/// An object, and where it lies.
pub struct Lying<'a> {
    pub object: &'a Object,
    world_box: Aabb,
    world_from_object: DAffine3,
    origin: DVec3,
}

impl<'a> Lying<'a> {
    pub fn new(object: &'a Object, world_from_object: DAffine3, origin: DVec3) -> Self {
        Self {
            object,
            world_box: object.field.world_box(),
            world_from_object,
            origin,
        }
    }
}

impl Surface {
    /// With an error over the diagonal of the box and so many halvings of the first cells, at most. Where there would be far more triangles
    /// than `most` there are none, unless cells are halved once only.
    pub fn new(
        object: &Object,
        iso: f64,
        (error, depth): (f64, usize),
        most: usize,
    ) -> Result<Self, PolygonizeError> {
        let world_box = object.field.world_box();
        let size = world_box.size();
        let edge = size.max_element() / f64::from(first_cells(object));
        let cells = (size / edge).ceil().max(DVec3::ONE).to_array().map(|n| n as u32);
        let options = AdaptiveOptions {
            iso,
            depth,
            detection: depth - 1,
            // The coarsest are few, and there is nothing in their place.
            max_blocks: if depth == 1 { usize::MAX } else { most / OF_BLOCK },
            ..AdaptiveOptions::default()
        };
        let frame = Frame::over(&world_box, cells);
        let field = object.field.as_field();
        Ok(Self {
            mesh: AdaptiveBlockMesh::new(field, &frame, &options, error * size.length(), false)?,
            object: object.clone(),
            error,
            halvings: 0,
            parts: BTreeMap::new(),
        })
    }

    /// Makes all corners and triangles anew, in parts that so many halvings of the first blocks give.
    pub fn renew_all(&mut self, lying: &Lying<'_>, halvings: u32) {
        self.halvings = halvings;
        self.parts.clear();
        let blocks = self.mesh.blocks();
        self.renew(&blocks, lying);
    }

    /// Follows its object to another shape and other paint; parts that are others now.
    pub fn follow(&mut self, lying: &Lying<'_>) -> Result<Vec<Part>, PolygonizeError> {
        let now = lying.object;
        let before = std::mem::replace(&mut self.object, now.clone());
        let reshaped = now.field.changed_boxes(&before.field);
        let mut boxes = reshaped.clone();
        boxes.extend(painted(&before, now));
        boxes.retain(|b| b.min.cmple(b.max).all());
        let update = self.mesh.update(now.field.as_field(), &reshaped)?;
        let mut stale = update.changed;
        // Normals and paint are new there, even where triangles are not.
        let kept = self.parts.values().flat_map(BTreeMap::keys);
        stale.extend(kept.filter(|block| {
            let b = block_box(block, lying);
            boxes
                .iter()
                .any(|c| b.min.cmple(c.max).all() && c.min.cmple(b.max).all())
        }));
        stale.sort_unstable();
        stale.dedup();
        self.renew(&stale, lying);
        Ok(stale.iter().map(|block| self.part(block)).collect())
    }

    /// A box round it, in the object's world.
    pub fn bounding_box(&self) -> Option<Aabb> {
        let blocks = self.mesh.blocks().into_iter();
        let pieces = blocks.filter_map(|block| self.mesh.piece(block));
        let boxes = pieces.filter_map(|piece| piece.bounding_box());
        boxes.reduce(Aabb::hull)
    }

    /// Over the diagonal of the box.
    pub fn error(&self) -> f64 {
        self.error
    }

    /// Parts that have triangles.
    pub fn parts(&self) -> impl Iterator<Item = Part> {
        self.parts.keys().copied()
    }

    /// Corners and triangles of all blocks.
    pub fn made(&self) -> impl Iterator<Item = &Made> {
        self.parts.values().flat_map(BTreeMap::values)
    }

    /// How many triangles there are.
    pub fn triangles(&self) -> usize {
        let pieces = self
            .mesh
            .blocks()
            .into_iter()
            .filter_map(|block| self.mesh.piece(block));
        pieces.map(|piece| piece.triangles.len()).sum()
    }

    /// Those of a part.
    pub fn made_in(&self, part: Part) -> impl Iterator<Item = &Made> {
        self.parts.get(&part).into_iter().flat_map(BTreeMap::values)
    }

    /// Makes the corners and triangles of blocks anew.
    fn renew(&mut self, blocks: &[AdaptiveBlock], lying: &Lying<'_>) {
        let made: Vec<Made> = blocks.par_iter().map(|b| self.made_of(*b, lying)).collect();
        for (block, made) in blocks.iter().zip(made) {
            let of_part = self.parts.entry(self.part(block)).or_default();
            match made.indices.is_empty() {
                true => of_part.remove(block),
                false => of_part.insert(*block, made),
            };
        }
    }

    /// The part in which a block lies, or begins.
    fn part(&self, block: &AdaptiveBlock) -> Part {
        let level = block.level as u32;
        block.block.map(|n| match level.checked_sub(self.halvings) {
            Some(finer) => n >> finer,
            None => n << (self.halvings - level),
        })
    }

    fn made_of(&self, block: AdaptiveBlock, lying: &Lying<'_>) -> Made {
        let Some(Mesh {
            positions: places,
            triangles,
            ..
        }) = self.mesh.piece(block)
        else {
            return Made::default();
        };
        let mut jets = vec![NOTHING; places.len()];
        lying.object.field.as_field().jets(&places, &mut jets);
        let hollow = HOLLOW * lying.world_box.size().length();
        let stiffness = values(&lying.object.layers, Substance::Stiffness, &places);
        let placed = lying.world_from_object;
        let normals = placed.matrix3.inverse().transpose();
        // Mirrored ones show their backs else.
        let is_mirrored = placed.matrix3.determinant() < 0.0;
        let around = |[a, b, c]: [u32; 3]| if is_mirrored { [a, c, b] } else { [a, b, c] };
        let vertices = places.iter().zip(&jets).enumerate().map(|(n, (p, jet))| {
            let steep = jet.gradient.length();
            let mut normal = -jet.gradient / steep.max(f64::MIN_POSITIVE);
            // Twice the mean curvature: div n.
            let h = &jet.hessian;
            let trace = h.x_axis.x + h.y_axis.y + h.z_axis.z;
            let mut bent = -(trace - normal.dot(*h * normal)) / steep.max(f64::MIN_POSITIVE);
            // Where the box cuts the solid off, the field's normal is not that of the cut.
            if let Some(flat) = side(&lying.world_box, *p).filter(|flat| normal.dot(*flat) < 0.5) {
                (normal, bent) = (flat, 0.0);
            }
            let factor = stiffness.as_ref().map_or(1.0, |stiffness| stiffness[n]);
            Vertex {
                at: (placed.transform_point3(*p) - lying.origin).as_vec3().to_array(),
                normal: normals.mul_vec3(normal).normalize_or_zero().as_vec3().to_array(),
                ridge: libm::tanh(0.5 * hollow * bent) as f32,
                paint: libm::log2(f64::max(factor, 1e-6)) as f32,
            }
        });
        Made {
            vertices: vertices.collect(),
            indices: triangles.into_iter().flat_map(around).collect(),
        }
    }
}

/// Boxes that hold all places whose stiffness was painted anew.
fn painted(before: &Object, now: &Object) -> Vec<Aabb> {
    let whole = now.field.world_box();
    let [before, now] = [before, now].map(|object| object.layers.get(&Substance::Stiffness));
    match (before, now) {
        (None, None) => Vec::new(),
        (Some(before), Some(now)) => Field::changed_boxes(now.tree(), before.tree(), &whole),
        _ => vec![whole],
    }
}

/// A box round the triangles of a block, in the object's world.
fn block_box(block: &AdaptiveBlock, lying: &Lying<'_>) -> Aabb {
    let first = lying.world_box.size().max_element() / f64::from(first_cells(lying.object));
    let cell = first / f64::from(1_u32 << block.level);
    let min = lying.world_box.min + 8.0 * cell * DVec3::from_array(block.block.map(f64::from));
    Aabb::new(min, min + 8.0 * cell).widened(cell)
}

/// Cells along the longest side that triangles begin with: those between knots, halved or doubled, so that halvings meet knots again. Cells
/// across knots cost half as much again.
pub fn first_cells(object: &Object) -> u32 {
    let knots = object.field.lattice().cells.into_iter().max().unwrap_or(1);
    let mut cells = knots.max(1);
    while cells >= 2 * CELLS {
        cells = cells.div_ceil(2);
    }
    while cells < CELLS {
        cells *= 2;
    }
    cells
}
