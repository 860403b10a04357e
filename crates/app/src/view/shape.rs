//! The triangles of an object, kept as it changes.

mod budget;
mod surface;

use std::collections::BTreeSet;

use bspline::polygonize::PolygonizeError;
use bspline::{Aabb, Jet};
use document::Object;
use formats::field::SourceKind;
use glam::{DAffine3, DVec3};

pub use self::budget::Budget;
use self::surface::{Lying, Part, Surface, first_cells};

/// Halvings of the first cells, at most, and how many more than knots have: of a volume no cell is much finer than its voxels, tools add a level
/// or two to others.
const DEPTH: usize = 6;
const FINER: [usize; 2] = [1, 2];
/// Chord error over the diagonal of the box: half a pixel where the box fills a screen.
const ERROR: f64 = 8e-4;
/// Error and halvings of the coarser surface that are tried first, and how many are: each takes a tenth of a second.
const ROUGH: (f64, usize) = (8.0 * ERROR, 2);
const TRIES: usize = 4;
/// Where triangles are too many, cells of more halvings than these are given up as the error grows, and others from this error on.
const SMALL: usize = 3;
const COARSE: f64 = 8.0 * ERROR;
/// Coefficients from which it takes seconds to find out that triangles are too many.
const MANY: usize = 1_000_000;
/// Most triangles of a second surface whose fineness is looked for.
const MOST: usize = 1_000_000;
/// Most triangles that lie in parts of the first blocks: each part takes as long to begin with as a thousand triangles do.
const LARGE: usize = 500_000;
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
    /// Three for each of a coarser surface, for where something moves; missing where `indices` are few enough.
    pub rough: Option<Vec<u32>>,
    /// Whether they may be no closed surface, so that their backs are seen.
    pub is_open: bool,
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
    budget: Budget,
}

impl Shape {
    /// Of an object with an iso-value that stands at a place, within a budget unless the coarsest triangles are more.
    ///
    /// # Errors
    /// That the surface cannot be followed, such as for its size.
    pub fn new(
        object: &Object,
        iso: f64,
        world_from_object: DAffine3,
        budget: Budget,
    ) -> Result<Self, PolygonizeError> {
        let coarser = is_heavy(object).then(|| rough(object, iso, budget.moving));
        let coarser = coarser.and_then(Result::ok);
        let whole = fine(object, iso, budget.still, coarser.as_ref())?;
        Ok(Self {
            rough: coarser,
            ..Self::of(whole, object, iso, world_from_object, budget)
        })
    }

    /// For a first look: of no more triangles than are turned.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn preview(
        object: &Object,
        iso: f64,
        world_from_object: DAffine3,
        budget: Budget,
    ) -> Result<Self, PolygonizeError> {
        let coarse = rough(object, iso, budget.moving)?;
        Ok(Self::of(coarse, object, iso, world_from_object, budget))
    }

    fn of(whole: Surface, object: &Object, iso: f64, world_from_object: DAffine3, budget: Budget) -> Self {
        Self {
            whole,
            rough: None,
            object: object.clone(),
            iso,
            world_from_object,
            budget,
        }
    }

    /// Of its triangles, which are closed where the solid does not leave the field's box.
    pub fn area_and_volume(&self) -> [f64; 2] {
        let (mut area, mut volume) = (0.0, 0.0);
        for made in self.whole.made() {
            for corners in made.indices.chunks_exact(3) {
                let at = |n: u32| glam::Vec3::from(made.vertices[n as usize].at).as_dvec3();
                let [a, b, c] = [0, 1, 2].map(|n| at(corners[n]));
                let across = (b - a).cross(c - a);
                area += 0.5 * across.length();
                volume += a.dot(across) / 6.0;
            }
        }
        [area, volume]
    }

    /// Whether it is within another budget, and as fine as that allows.
    pub fn fits(&self, budget: Budget) -> bool {
        let moving = self.rough.as_ref().unwrap_or(&self.whole);
        let may_be_finer = budget.still > self.budget.still && self.whole.error() > ERROR;
        self.whole.triangles() <= budget.still && moving.triangles() <= budget.moving && !may_be_finer
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
        let count = self.whole.triangles();
        let halvings = halvings(count);
        self.whole.renew_all(&lying, halvings);
        // A solid that has no coarser surface is turned as it is.
        let most = self.budget.moving;
        self.rough = match self.rough.take().filter(|_| count > most) {
            None if count > most => rough(&self.object, self.iso, most).ok(),
            known => known,
        };
        self.rough
            .iter_mut()
            .for_each(|rough| rough.renew_all(&lying, halvings));
        self.patches(name, self.parts())
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
        let mut parts = self.follow_finely(object, origin)?;
        let lying = Lying::new(&self.object, self.world_from_object, origin);
        match self.rough.as_mut().map(|rough| rough.follow(&lying)) {
            None => {}
            Some(Ok(changed)) => parts.extend(changed),
            // Then it is turned as it is.
            Some(Err(_)) => {
                parts = self.parts();
                self.rough = None;
            }
        }
        Ok(self.patches(name, parts))
    }

    /// As [`follow`](Self::follow), while a stroke lasts: the coarser surface stays behind, as nobody sees it where something changed.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn follow_stroke(
        &mut self,
        name: &str,
        object: &Object,
        origin: DVec3,
    ) -> Result<Vec<Patch>, PolygonizeError> {
        let parts = self.follow_finely(object, origin)?;
        Ok(self.patches(name, parts))
    }

    fn follow_finely(&mut self, object: &Object, origin: DVec3) -> Result<BTreeSet<Part>, PolygonizeError> {
        self.object = object.clone();
        let lying = Lying::new(&self.object, self.world_from_object, origin);
        Ok(self.whole.follow(&lying)?.into_iter().collect())
    }

    /// A box round its surface, in the world.
    pub fn bounding_box(&self) -> Option<Aabb> {
        Some(self.whole.bounding_box()?.transformed(&self.world_from_object))
    }

    /// Those of either surface: a large cell of the coarser one may lie where the finer one has none that begins there.
    fn parts(&self) -> BTreeSet<Part> {
        let coarser = self.rough.iter().flat_map(Surface::parts);
        self.whole.parts().chain(coarser).collect()
    }

    fn patches(&self, name: &str, parts: BTreeSet<Part>) -> Vec<Patch> {
        let patch = |part| patch(name, part, &self.whole, self.rough.as_ref());
        parts.into_iter().map(patch).collect()
    }
}

fn patch(name: &str, part: Part, whole: &Surface, rough: Option<&Surface>) -> Patch {
    let mut patch = Patch {
        object: name.into(),
        part,
        vertices: Vec::new(),
        indices: Vec::new(),
        rough: rough.map(|_| Vec::new()),
        is_open: false,
    };
    for (surface, is_rough) in [(Some(whole), false), (rough, true)] {
        for made in surface.into_iter().flat_map(|surface| surface.made_in(part)) {
            let first = patch.vertices.len() as u32;
            let indices = match &mut patch.rough {
                Some(rough) if is_rough => rough,
                _ => &mut patch.indices,
            };
            indices.extend(made.indices.iter().map(|n| first + n));
            patch.vertices.extend_from_slice(&made.vertices);
        }
    }
    patch
}

/// Halvings of the first blocks after which so many triangles are in parts of a size that dabs may put anew.
fn halvings(triangles: usize) -> u32 {
    (0..)
        .find(|n| triangles >> (2 * n) <= LARGE)
        .expect("numbers run out of bits")
}

/// Whether its triangles take so long that coarse ones are seen first.
pub fn is_heavy(object: &Object) -> bool {
    object.field.coefficient_count() > MANY
}

/// Triangles as fine as an object, or as can be had of so many, which a coarser surface may tell.
fn fine(
    object: &Object,
    iso: f64,
    most: usize,
    coarse: Option<&Surface>,
) -> Result<Surface, PolygonizeError> {
    let mut now = (ERROR, depth(object));
    // Half the error has twice as many, of noise more.
    let expected = |error| {
        coarse.map_or(0.0, |coarse| {
            2.0 * coarse.triangles() as f64 * coarse.error() / error
        })
    };
    while expected(now.0) > most as f64 {
        now = coarser(now);
    }
    loop {
        let made = Surface::new(object, iso, now, most);
        if now.1 == 1 || count(&made).is_none_or(|count| count <= most) {
            return made;
        }
        now = coarser(now);
    }
}

/// No more triangles than `most`, for where something moves.
fn rough(object: &Object, iso: f64, most: usize) -> Result<Surface, PolygonizeError> {
    let mut now = (ROUGH.0, depth(object).min(ROUGH.1));
    let mut found = Surface::new(object, iso, now, most);
    for _ in 1..TRIES {
        let (error, depth) = now;
        now = match count(&found) {
            None => break,
            Some(count) if count > most => coarser(now),
            // Half the error has four times as many at the most, nearly.
            Some(count) if 4 * count < most && error > 2.0 * ERROR => (0.5 * error, depth),
            Some(_) => break,
        };
        found = Surface::new(object, iso, now, most);
    }
    found
}

/// How many triangles were made, or would be; none where it is not their number that cannot be had.
fn count(made: &Result<Surface, PolygonizeError>) -> Option<usize> {
    match made {
        Ok(surface) => Some(surface.triangles()),
        Err(PolygonizeError::TooManyBlocks { .. }) => Some(usize::MAX),
        Err(_) => None,
    }
}

/// Error and halvings that give fewer triangles. Of noise a larger error alone leaves as many: what smaller cells find stands alone.
fn coarser((error, depth): (f64, usize)) -> (f64, usize) {
    let gives_up = depth > SMALL || error >= COARSE;
    (2.0 * error, (depth - usize::from(gives_up)).max(1))
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
        let mut finer = match Surface::new(object, iso, (ERROR, depth), MOST) {
            Err(PolygonizeError::TooManyBlocks { .. }) if found.is_some() => break,
            made => made?,
        };
        let count = finer.triangles();
        finer.renew_all(&lying, halvings(count));
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

#[cfg(test)]
mod tests {
    use bspline::HierarchicalSpline;
    use bspline::hierarchical::Lattice;

    use super::*;

    #[test]
    fn mirrored_objects_show_their_fronts() {
        let lattice = Lattice {
            world_from_lattice: DAffine3::from_translation(DVec3::splat(-8.0)),
            cells: [16; 3],
        };
        let ball = |p: DVec3| 5.0 - p.length();
        let field = HierarchicalSpline::<f32>::schoenberg(lattice, 1.0, ball).unwrap();
        let object = Object::of(field.into(), formats::field::FieldMeta::default());
        let [volume, mirrored] = [1.0, -1.0].map(|side| {
            let placed = DAffine3::from_scale(DVec3::new(side, 1.0, 1.0));
            let mut shape = Shape::new(&object, 0.0, placed, Budget::PROCESSOR).unwrap();
            shape.all("ball", DVec3::ZERO);
            shape.area_and_volume()[1]
        });
        // Backs would count below 0.
        assert!(
            volume > 400.0 && (volume - mirrored).abs() < 1e-3,
            "{volume} {mirrored}"
        );
    }

    /// Large cells of the coarser surface begin where the finer one has none: they are in patches of their own.
    #[test]
    fn patches_hold_all_triangles_of_both_surfaces() {
        let lattice = Lattice {
            world_from_lattice: DAffine3::from_translation(DVec3::splat(-24.0)),
            cells: [48; 3],
        };
        // Cut off by its box: the sides are flat, and their cells large.
        let ball = |p: DVec3| 30.0 - p.length() + 0.4 * (2.0 * p.x).sin() * (2.0 * p.y).cos();
        let field = HierarchicalSpline::<f32>::schoenberg(lattice, 1.0, ball).unwrap();
        let object = Object::of(field.into(), formats::field::FieldMeta::default());
        let lying = Lying::new(&object, DAffine3::IDENTITY, DVec3::ZERO);
        let made = |depth, error| {
            let mut surface = Surface::new(&object, 0.0, (error, depth), MOST).unwrap();
            surface.renew_all(&lying, 2);
            surface
        };
        let mut shape = Shape::of(
            made(3, ERROR),
            &object,
            0.0,
            DAffine3::IDENTITY,
            Budget::PROCESSOR,
        );
        shape.rough = Some(made(2, 32.0 * ERROR));
        let alone = shape.parts().len() - shape.whole.parts().count();
        assert!(alone > 0, "all parts have fine triangles");
        let patches = shape.patches("", shape.parts());
        let count = |of: fn(&Patch) -> usize| patches.iter().map(of).sum::<usize>() / 3;
        assert_eq!(count(|patch| patch.indices.len()), shape.whole.triangles());
        let coarser = count(|patch| patch.rough.as_ref().unwrap().len());
        assert_eq!(coarser, shape.rough.as_ref().unwrap().triangles());
    }
}
