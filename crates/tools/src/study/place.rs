use bspline::{Field, HierarchicalSpline};
use glam::DVec3;

use super::StudyError;
use crate::force::nearest_surface;
use crate::number::Point;

/// A fitted field to work on.
pub struct Sculpture {
    /// Its name.
    pub name: String,
    /// The field.
    pub field: HierarchicalSpline<f32>,
    /// Density of its surface.
    pub iso: f64,
}

/// Radii of tools on a fitted field, at both ends of what one level serves: regions of a point of about 9³ and 18³ free
/// coefficients.
pub struct Sizes {
    /// Level of the regions.
    pub level: usize,
    /// Knot interval of that level, a world length.
    pub interval: f64,
    /// Radii, world lengths, and what \[Hua04 table 2\] would call such a patch: coefficients and samples on an axis.
    pub radii: [(f64, &'static str); 2],
}

/// Radius of a tool over the knot interval of the level that it moves.
const SMALL: f64 = 1.15;
const LARGE: f64 = 1.8;
/// Size of the large tool: radius over the longest edge of the field's box, about.
const SIZE: f64 = 0.04;

impl Sculpture {
    /// Sizes of tools for it.
    pub fn sizes(&self) -> Sizes {
        let lattice = self.field.lattice();
        let spacing = lattice.spacing(0).max_element();
        let edge = lattice.world_box().size().max_element();
        let level = (LARGE * spacing / (SIZE * edge)).log2().round().max(0.0) as usize;
        let interval = spacing / (1u64 << level) as f64;
        Sizes {
            level,
            interval,
            radii: [(SMALL * interval, "15/20"), (LARGE * interval, "24/32")],
        }
    }

    /// The place of the surface, seen from six sides, that is farthest from the walls of the box.
    ///
    /// # Errors
    /// [`StudyError::NoSurface`].
    pub fn place(&self) -> Result<DVec3, StudyError> {
        let whole = self.field.lattice().world_box();
        let (middle, half) = (0.5 * (whole.min + whole.max), 0.5 * whole.size());
        let ways = [
            DVec3::Z,
            DVec3::Y,
            DVec3::X,
            DVec3::NEG_Z,
            DVec3::NEG_Y,
            DVec3::NEG_X,
        ];
        let found = ways.into_iter().filter_map(|way| {
            let length = half.dot(way.abs());
            let outer = (0..64).map(|i| middle + (1.0 - f64::from(i) / 64.0) * length * way);
            let first = { outer }.find(|p| self.field.value(*p) > self.iso)?;
            nearest_surface(&self.field, self.iso, first, 0.1 * length).ok()
        });
        let room = |p: &DVec3| (*p - whole.min).min(whole.max - *p).min_element();
        { found }
            .max_by(|a, b| room(a).total_cmp(&room(b)))
            .ok_or_else(|| StudyError::NoSurface(self.name.clone()))
    }
}

/// A way over the surface from a place of it, in steps of a world length.
///
/// # Errors
/// [`StudyError::Force`] where there is no surface.
pub fn walk(
    field: &HierarchicalSpline<f32>,
    iso: f64,
    from: DVec3,
    length: f64,
    step: f64,
) -> Result<Vec<Point>, StudyError> {
    let (mut at, mut way, mut out) = (from, DVec3::new(0.8, 0.6, 0.0), vec![Point(from)]);
    for _ in 0..(length / step).round() as usize {
        let normal = field.value_gradient(at).1.normalize_or_zero();
        way = (way - way.dot(normal) * normal).normalize_or(normal.any_orthonormal_vector());
        at = nearest_surface(field, iso, at + step * way, 4.0 * step)?;
        out.push(Point(at));
    }
    Ok(out)
}
