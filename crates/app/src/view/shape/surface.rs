//! Triangles of an object, of some fineness.

use std::collections::BTreeMap;

use bspline::polygonize::{AdaptiveBlock, AdaptiveBlockMesh, AdaptiveOptions, Mesh, PolygonizeError};
use bspline::{Aabb, Frame};
use document::Object;
use glam::{DAffine3, DVec3};
use rayon::prelude::*;
use tools::paint::{Substance, values};

use super::{HOLLOW, NOTHING, Vertex};

/// Fewest cells along the longest side of the box that triangles begin with; there are fewer than twice as many.
const CELLS: u32 = 24;

/// Cells along each side of the first blocks, which are parts of all finenesses.
pub type Part = [i32; 3];

/// Corners and triangles of a block.
type Made = (Vec<Vertex>, Vec<u32>);

/// Triangles that follow an object.
pub struct Surface {
    mesh: AdaptiveBlockMesh,
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
    /// With so many halvings of the first cells, at most, and an error over the diagonal of the box.
    pub fn new(object: &Object, iso: f64, depth: usize, error: f64) -> Result<Self, PolygonizeError> {
        let world_box = object.field.world_box();
        let size = world_box.size();
        let edge = size.max_element() / f64::from(first_cells(object));
        let cells = (size / edge).ceil().max(DVec3::ONE).to_array().map(|n| n as u32);
        let options = AdaptiveOptions {
            iso,
            depth,
            detection: depth - 1,
            ..AdaptiveOptions::default()
        };
        let frame = Frame::over(&world_box, cells);
        let field = object.field.as_field();
        Ok(Self {
            mesh: AdaptiveBlockMesh::new(field, &frame, &options, error * size.length(), false)?,
            parts: BTreeMap::new(),
        })
    }

    /// Makes all corners and triangles anew.
    pub fn renew_all(&mut self, lying: &Lying<'_>) {
        self.parts.clear();
        let blocks = self.mesh.blocks();
        self.renew(&blocks, lying);
    }

    /// Follows an object that has another shape in some boxes, and looks otherwise in these and more; parts that are others now.
    pub fn follow(
        &mut self,
        lying: &Lying<'_>,
        reshaped: &[Aabb],
        boxes: &[Aabb],
    ) -> Result<Vec<Part>, PolygonizeError> {
        let update = self.mesh.update(lying.object.field.as_field(), reshaped)?;
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
        Ok(stale.iter().map(part).collect())
    }

    /// A box round it, in the object's world.
    pub fn bounding_box(&self) -> Option<Aabb> {
        let blocks = self.mesh.blocks().into_iter();
        let pieces = blocks.filter_map(|block| self.mesh.piece(block));
        let boxes = pieces.filter_map(|piece| piece.bounding_box());
        boxes.reduce(Aabb::hull)
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
        self.made().map(|(_, indices)| indices.len() / 3).sum()
    }

    /// The triangles of a part, whose corners are put behind others.
    pub fn triangles_of(&self, part: Part, vertices: &mut Vec<Vertex>) -> Vec<u32> {
        let mut indices = Vec::new();
        for (corners, triangles) in self.parts.get(&part).into_iter().flat_map(BTreeMap::values) {
            let first = vertices.len() as u32;
            indices.extend(triangles.iter().map(|n| first + n));
            vertices.extend_from_slice(corners);
        }
        indices
    }

    /// Makes the corners and triangles of blocks anew.
    fn renew(&mut self, blocks: &[AdaptiveBlock], lying: &Lying<'_>) {
        let made: Vec<Made> = blocks.par_iter().map(|b| self.made_of(*b, lying)).collect();
        for (block, made) in blocks.iter().zip(made) {
            let of_part = self.parts.entry(part(block)).or_default();
            match made.1.is_empty() {
                true => of_part.remove(block),
                false => of_part.insert(*block, made),
            };
        }
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
        let vertices = places.iter().zip(&jets).enumerate().map(|(n, (p, jet))| {
            let steep = jet.gradient.length();
            let normal = -jet.gradient / steep.max(f64::MIN_POSITIVE);
            // Twice the mean curvature: div n.
            let h = &jet.hessian;
            let trace = h.x_axis.x + h.y_axis.y + h.z_axis.z;
            let bent = -(trace - normal.dot(*h * normal)) / steep.max(f64::MIN_POSITIVE);
            let factor = stiffness.as_ref().map_or(1.0, |stiffness| stiffness[n]);
            Vertex {
                at: (placed.transform_point3(*p) - lying.origin).as_vec3().to_array(),
                normal: normals.mul_vec3(normal).normalize_or_zero().as_vec3().to_array(),
                ridge: libm::tanh(0.5 * hollow * bent) as f32,
                paint: libm::log2(f64::max(factor, 1e-6)) as f32,
            }
        });
        let indices = triangles.into_iter().flatten().collect();
        (vertices.collect(), indices)
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

/// The part of an object in which a block lies.
fn part(block: &AdaptiveBlock) -> [i32; 3] {
    block.block.map(|n| n >> block.level)
}
