//! The triangles of an object, kept as it changes.

use std::collections::BTreeMap;

use bspline::polygonize::{AdaptiveBlock, AdaptiveBlockMesh, AdaptiveOptions, Mesh, PolygonizeError};
use bspline::{Aabb, Field, Frame, Jet};
use document::Object;
use formats::field::SourceKind;
use glam::{DAffine3, DVec3};
use rayon::prelude::*;
use tools::paint::{Substance, values};

/// Fewest cells along the longest side of the box that triangles begin with; there are fewer than twice as many.
const CELLS: u32 = 24;
/// Halvings of these, at most, and how many more than knots have: of a volume no cell is much finer than its voxels, tools add a level
/// or two to others.
const DEPTH: usize = 6;
const FINER: [usize; 2] = [1, 2];
/// Chord error over the diagonal of the box: half a pixel where the box fills a screen.
const ERROR: f64 = 8e-4;
/// Radius of curvature, over the diagonal of the box, at which a hollow is half as dark as it can be.
pub const HOLLOW: f64 = 0.02;

/// A corner of triangles, in the world from the origin of the picture.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Vertex {
    /// Place.
    pub at: [f32; 3],
    /// Outward normal, of length 1.
    pub normal: [f32; 3],
    /// -1 in hollows, 1 on ridges.
    pub ridge: f32,
    /// Logarithm to base 2 of the painted stiffness.
    pub paint: f32,
}

/// Triangles of a part of an object; none where there are none any more.
#[derive(Clone, Debug)]
pub struct Patch {
    /// Whose.
    pub object: String,
    /// Which part.
    pub part: [i32; 3],
    /// Corners.
    pub vertices: Vec<Vertex>,
    /// Three for each triangle.
    pub indices: Vec<u32>,
}

/// A field that was not asked yet.
pub const NOTHING: Jet = Jet {
    value: 0.0,
    gradient: DVec3::ZERO,
    hessian: glam::DMat3::ZERO,
};

/// The triangles of an object.
pub struct Shape {
    mesh: AdaptiveBlockMesh,
    object: Object,
    world_box: Aabb,
    world_from_object: DAffine3,
    /// Of each part the blocks with triangles.
    parts: BTreeMap<[i32; 3], BTreeMap<AdaptiveBlock, Made>>,
}

/// Corners and triangles of a block.
type Made = (Vec<Vertex>, Vec<u32>);

impl Shape {
    /// Of an object with an iso-value that stands at a place.
    ///
    /// # Errors
    /// That the surface cannot be followed, such as for its size.
    pub fn new(object: &Object, iso: f64, world_from_object: DAffine3) -> Result<Self, PolygonizeError> {
        Self::of_depth(object, iso, world_from_object, depth(object))
    }

    /// The same with so many halvings of the first cells, at most.
    fn of_depth(
        object: &Object,
        iso: f64,
        world_from_object: DAffine3,
        depth: usize,
    ) -> Result<Self, PolygonizeError> {
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
            mesh: AdaptiveBlockMesh::new(field, &frame, &options, ERROR * size.length(), false)?,
            object: object.clone(),
            world_box,
            world_from_object,
            parts: BTreeMap::new(),
        })
    }

    /// Of its triangles, which are closed where the solid does not leave the field's box.
    pub fn area_and_volume(&self) -> [f64; 2] {
        let (mut area, mut volume) = (0.0, 0.0);
        for (vertices, indices) in self.parts.values().flat_map(BTreeMap::values) {
            for corners in indices.chunks_exact(3) {
                let [a, b, c] =
                    [0, 1, 2].map(|n| glam::Vec3::from(vertices[corners[n] as usize].at).as_dvec3());
                let across = (b - a).cross(c - a);
                area += 0.5 * across.length();
                volume += a.dot(across) / 6.0;
            }
        }
        [area, volume]
    }

    /// Whether it can follow to another state of its object.
    pub fn follows(&self, object: &Object, world_from_object: DAffine3) -> bool {
        self.world_box == object.field.world_box()
            && self.object.iso() == object.iso()
            && self.world_from_object == world_from_object
    }

    /// All that is to be drawn of it.
    pub fn all(&mut self, name: &str, origin: DVec3) -> Vec<Patch> {
        self.parts.clear();
        let blocks = self.mesh.blocks();
        self.renew(&blocks, origin);
        self.parts.keys().map(|part| self.patch(name, *part)).collect()
    }

    /// Follows its object; what is to be drawn anew.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn follow(
        &mut self,
        name: &str,
        object: &Object,
        origin: DVec3,
    ) -> Result<Vec<Patch>, PolygonizeError> {
        let mut boxes = object.field.changed_boxes(&self.object.field);
        let update = self.mesh.update(object.field.as_field(), &boxes)?;
        boxes.extend(painted(&self.object, object));
        self.object = object.clone();
        let boxes: Vec<Aabb> = boxes.into_iter().filter(|b| b.min.cmple(b.max).all()).collect();
        let mut stale = update.changed;
        // Normals and paint are new there, even where triangles are not.
        let kept = self.parts.values().flat_map(BTreeMap::keys);
        stale.extend(kept.filter(|block| {
            let b = self.block_box(block);
            boxes
                .iter()
                .any(|c| b.min.cmple(c.max).all() && c.min.cmple(b.max).all())
        }));
        stale.sort_unstable();
        stale.dedup();
        self.renew(&stale, origin);
        let mut parts: Vec<[i32; 3]> = stale.iter().map(part).collect();
        parts.sort_unstable();
        parts.dedup();
        Ok(parts.into_iter().map(|part| self.patch(name, part)).collect())
    }

    /// A box round its surface, in the world.
    pub fn bounding_box(&self) -> Option<Aabb> {
        let pieces = self
            .mesh
            .blocks()
            .into_iter()
            .filter_map(|block| self.mesh.piece(block));
        let boxes = pieces.filter_map(|piece| piece.bounding_box());
        let whole = boxes.reduce(Aabb::hull)?;
        Some(whole.transformed(&self.world_from_object))
    }

    /// A box round the triangles of a block, in the object's world.
    fn block_box(&self, block: &AdaptiveBlock) -> Aabb {
        let cell = self.world_box.size().max_element()
            / f64::from(first_cells(&self.object))
            / f64::from(1_u32 << block.level);
        let min = self.world_box.min + 8.0 * cell * DVec3::from_array(block.block.map(f64::from));
        Aabb::new(min, min + 8.0 * cell).widened(cell)
    }

    /// Makes the corners and triangles of blocks anew.
    fn renew(&mut self, blocks: &[AdaptiveBlock], origin: DVec3) {
        let made: Vec<Made> = blocks.par_iter().map(|b| self.made(*b, origin)).collect();
        for (block, made) in blocks.iter().zip(made) {
            let of_part = self.parts.entry(part(block)).or_default();
            match made.1.is_empty() {
                true => of_part.remove(block),
                false => of_part.insert(*block, made),
            };
        }
    }

    fn patch(&self, name: &str, part: [i32; 3]) -> Patch {
        let (mut vertices, mut indices) = (Vec::new(), Vec::new());
        for (corners, triangles) in self.parts.get(&part).into_iter().flat_map(BTreeMap::values) {
            let first = vertices.len() as u32;
            indices.extend(triangles.iter().map(|n| first + n));
            vertices.extend_from_slice(corners);
        }
        Patch {
            object: name.into(),
            part,
            vertices,
            indices,
        }
    }

    fn made(&self, block: AdaptiveBlock, origin: DVec3) -> Made {
        let Some(Mesh {
            positions: places,
            triangles,
            ..
        }) = self.mesh.piece(block)
        else {
            return Made::default();
        };
        let mut jets = vec![NOTHING; places.len()];
        self.object.field.as_field().jets(&places, &mut jets);
        let hollow = HOLLOW * self.world_box.size().length();
        let stiffness = values(&self.object.layers, Substance::Stiffness, &places);
        let placed = self.world_from_object;
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
                at: (placed.transform_point3(*p) - origin).as_vec3().to_array(),
                normal: normals.mul_vec3(normal).normalize_or_zero().as_vec3().to_array(),
                ridge: libm::tanh(0.5 * hollow * bent) as f32,
                paint: libm::log2(f64::max(factor, 1e-6)) as f32,
            }
        });
        let indices = triangles.into_iter().flatten().collect();
        (vertices.collect(), indices)
    }
}

/// Triangles of another density of an object, about as fine as those that are shown of it, but no more than `most`, unless the coarsest
/// are.
///
/// # Errors
/// As [`Shape::new`].
pub fn second(
    object: &Object,
    iso: f64,
    world_from_object: DAffine3,
    origin: DVec3,
    most: usize,
) -> Result<Vec<Patch>, PolygonizeError> {
    let finest = depth(object);
    let mut patches = Vec::new();
    // The coarser ones take a third of the time of the last, as there are so many fewer of them.
    for depth in 1..=finest {
        let finer = Shape::of_depth(object, iso, world_from_object, depth)?.all("", origin);
        let count: usize = finer.iter().map(|patch| patch.indices.len() / 3).sum();
        if count > most && !patches.is_empty() {
            break;
        }
        patches = finer;
        if 3 * count > most {
            break;
        }
    }
    Ok(patches)
}

/// Cells along the longest side that triangles begin with: those between knots, halved or doubled, so that halvings meet knots again. Cells
/// across knots cost half as much again.
fn first_cells(object: &Object) -> u32 {
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

/// Halvings of the first cells that show what an object is shaped to.
fn depth(object: &Object) -> usize {
    let knots = object.field.lattice().cells_at(object.detail());
    let finest = knots.into_iter().max().unwrap_or(1);
    let level = (f64::from(finest) / f64::from(first_cells(object)))
        .log2()
        .ceil()
        .max(0.0) as usize;
    let is_volume = object.meta.source == SourceKind::Volume;
    (level + FINER[usize::from(!is_volume)]).clamp(1, DEPTH)
}

/// The part of an object in which a block lies.
fn part(block: &AdaptiveBlock) -> [i32; 3] {
    block.block.map(|n| n >> block.level)
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
