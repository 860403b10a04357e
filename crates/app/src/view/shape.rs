//! The triangles of an object, kept as it changes.

mod surface;

use std::collections::BTreeSet;
use std::iter;

use bspline::polygonize::PolygonizeError;
use bspline::{Aabb, Field, Jet};
use document::Object;
use formats::field::SourceKind;
use glam::{DAffine3, DVec3};
use tools::paint::Substance;

use self::surface::{Lying, Part, Surface, first_cells};

/// Halvings of the first cells, at most, and how many more than knots have: of a volume no cell is much finer than its voxels, tools add a level
/// or two to others.
const DEPTH: usize = 6;
const FINER: [usize; 2] = [1, 2];
/// Chord error over the diagonal of the box: half a pixel where the box fills a screen.
const ERROR: f64 = 8e-4;
/// Most triangles while something moves: two cores draw these 20 times a second.
const MOVING: usize = 150_000;
/// Error of these that is tried first, and how many are: each takes a tenth of a second.
const ROUGH: f64 = 8.0 * ERROR;
const TRIES: usize = 4;
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
    pub part: Part,
    /// Corners.
    pub vertices: Vec<Vertex>,
    /// Three for each triangle.
    pub indices: Vec<u32>,
    /// Three for each of a coarser surface, for where something moves; none where `indices` are few enough.
    pub rough: Vec<u32>,
}

/// A field that was not asked yet.
pub const NOTHING: Jet = Jet {
    value: 0.0,
    gradient: DVec3::ZERO,
    hessian: glam::DMat3::ZERO,
};

/// The triangles of an object.
pub struct Shape {
    whole: Surface,
    /// Where these are many.
    rough: Option<Surface>,
    object: Object,
    iso: f64,
    world_from_object: DAffine3,
}

impl Shape {
    /// Of an object with an iso-value that stands at a place.
    ///
    /// # Errors
    /// That the surface cannot be followed, such as for its size.
    pub fn new(object: &Object, iso: f64, world_from_object: DAffine3) -> Result<Self, PolygonizeError> {
        Ok(Self {
            whole: Surface::new(object, iso, depth(object), ERROR)?,
            rough: None,
            object: object.clone(),
            iso,
            world_from_object,
        })
    }

    /// Of its triangles, which are closed where the solid does not leave the field's box.
    pub fn area_and_volume(&self) -> [f64; 2] {
        let (mut area, mut volume) = (0.0, 0.0);
        for (vertices, indices) in self.whole.made() {
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
        self.object.field.world_box() == object.field.world_box()
            && self.object.iso() == object.iso()
            && self.world_from_object == world_from_object
    }

    /// All that is to be drawn of it.
    pub fn all(&mut self, name: &str, origin: DVec3) -> Vec<Patch> {
        let lying = Lying::new(&self.object, self.world_from_object, origin);
        self.whole.renew_all(&lying);
        self.rough = match self.whole.triangles() > MOVING {
            true => rough(&lying, self.iso),
            false => None,
        };
        self.whole.parts().map(|part| self.patch(name, part)).collect()
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
        let reshaped = object.field.changed_boxes(&self.object.field);
        let mut boxes = reshaped.clone();
        boxes.extend(painted(&self.object, object));
        boxes.retain(|b| b.min.cmple(b.max).all());
        self.object = object.clone();
        let lying = Lying::new(&self.object, self.world_from_object, origin);
        let mut parts = BTreeSet::new();
        for surface in iter::once(&mut self.whole).chain(&mut self.rough) {
            parts.extend(surface.follow(&lying, &reshaped, &boxes)?);
        }
        Ok(parts.into_iter().map(|part| self.patch(name, part)).collect())
    }

    /// A box round its surface, in the world.
    pub fn bounding_box(&self) -> Option<Aabb> {
        Some(self.whole.bounding_box()?.transformed(&self.world_from_object))
    }

    fn patch(&self, name: &str, part: Part) -> Patch {
        patch(name, part, &self.whole, self.rough.as_ref())
    }
}

fn patch(name: &str, part: Part, whole: &Surface, rough: Option<&Surface>) -> Patch {
    let mut vertices = Vec::new();
    let indices = whole.triangles_of(part, &mut vertices);
    let rough = rough.map_or(Vec::new(), |rough| rough.triangles_of(part, &mut vertices));
    Patch {
        object: name.into(),
        part,
        vertices,
        indices,
        rough,
    }
}

/// Triangles for where something moves; none of a solid that has no coarser ones, which is turned as it is.
fn rough(lying: &Lying<'_>, iso: f64) -> Option<Surface> {
    let (mut error, mut found) = (ROUGH, None);
    for _ in 0..TRIES {
        let mut surface = Surface::new(lying.object, iso, depth(lying.object), error).ok()?;
        surface.renew_all(lying);
        let count = surface.triangles();
        found = Some(surface);
        // Half the error has four times as many triangles at the most, nearly.
        match (count > MOVING, 4 * count < MOVING) {
            (true, _) => error *= 2.0,
            (_, true) if error > 2.0 * ERROR => error *= 0.5,
            _ => break,
        }
    }
    found
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
    let lying = Lying::new(object, world_from_object, origin);
    let mut found = None;
    // The coarser ones take a third of the time of the last, as there are so many fewer of them.
    for depth in 1..=finest {
        let mut finer = Surface::new(object, iso, depth, ERROR)?;
        finer.renew_all(&lying);
        let count = finer.triangles();
        if count > most && found.is_some() {
            break;
        }
        found = Some(finer);
        if 3 * count > most {
            break;
        }
    }
    Ok(found.map_or(Vec::new(), |surface| {
        let patch = |part| patch("", part, &surface, None);
        surface.parts().map(patch).collect()
    }))
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
