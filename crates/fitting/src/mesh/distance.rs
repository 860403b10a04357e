//! What the fit asks of a mesh: signed distance and its gradient, anywhere.

use glam::DVec3;

use super::MeshDefects;
use super::surface::{Surface, surface};
use super::topology::Faces;
use crate::FitError;

/// The solid that a triangle mesh bounds: exact distance to its surface, sign by the generalized winding number.
///
/// Inside is where the winding number of the triangles is above 1/2. Of the triangles only those count for the
/// distance that have the inside on one side of them. In a hole the winding number goes from 0 to 1 gradually;
/// there the distance is scaled by it (see [`MeshDistance::signed`]), so that the field closes the hole smoothly.
pub struct MeshDistance {
    /// Corner and edge of the unit box in world units, diagonal of the mesh's own box.
    pub(crate) origin: DVec3,
    pub(crate) scale: f64,
    pub(crate) diagonal: f64,
    surface: Surface,
}

/// Signed distance at a point of the unit box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Distance {
    /// Positive inside.
    pub value: f64,
    /// To the surface, never negative.
    pub distance: f64,
    /// Gradient where it is defined: off the surface, and off holes.
    pub gradient: Option<DVec3>,
    /// Nearest point of the surface.
    pub foot: DVec3,
    /// Triangle of the foot, for searches near by.
    pub hint: u32,
}

impl MeshDistance {
    /// Repairs a mesh and makes it ready to be asked. Vertices in world units, triangles counterclockwise seen from
    /// outside where they know it.
    ///
    /// # Errors
    /// [`FitError::Degenerate`] for coordinates that are not finite, indices out of range, a mesh without area, and
    /// one that encloses nothing.
    pub fn new(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Result<(Self, MeshDefects), FitError> {
        let mut defects = MeshDefects::default();
        let mut faces = Faces::prepare(vertices, triangles, &mut defects)?;
        let surface = surface(&mut faces, &mut defects)?;
        let out = Self {
            origin: faces.origin,
            scale: faces.scale,
            diagonal: faces.diagonal,
            surface,
        };
        Ok((out, defects))
    }

    /// Distance from `p` to the surface, world units.
    pub fn distance(&self, p: DVec3) -> f64 {
        self.unit_distance(self.to_unit(p)) * self.scale
    }

    /// Winding number at `p`: about 1 inside, about 0 outside.
    pub fn winding_number(&self, p: DVec3) -> f64 {
        self.surface.winding.at(self.to_unit(p))
    }

    /// Distance to the surface, positive inside, world units. Where the winding number `w` is between 1/4 and 3/4,
    /// which happens in holes alone, it is scaled by `4w - 2`.
    pub fn signed(&self, p: DVec3) -> f64 {
        self.at(self.to_unit(p), None).value * self.scale
    }

    /// Diagonal of the box round the mesh, world units.
    pub fn diagonal(&self) -> f64 {
        self.diagonal
    }

    fn to_unit(&self, p: DVec3) -> DVec3 {
        (p - self.origin) / self.scale
    }

    fn unit_distance(&self, p: DVec3) -> f64 {
        self.surface.boundary.nearest(p, 0).distance_squared.sqrt()
    }

    /// Signed distance at `p` of the unit box, given what was found at a point near by.
    pub(crate) fn at(&self, p: DVec3, near: Option<(DVec3, &Distance)>) -> Distance {
        let found = self.surface.boundary.nearest(p, near.map_or(0, |n| n.1.hint));
        let distance = found.distance_squared.sqrt();
        let offset = p - found.point;
        let share = self.sign(p, &found, offset, near);
        let is_whole = share.abs() == 1.0 && distance > 1e-12;
        Distance {
            value: share * distance,
            distance,
            gradient: is_whole.then(|| offset * (share / distance)),
            foot: found.point,
            hint: found.triangle,
        }
    }

    /// 1 inside, -1 outside, between them in holes.
    fn sign(
        &self,
        p: DVec3,
        found: &super::nearest::Nearest,
        offset: DVec3,
        near: Option<(DVec3, &Distance)>,
    ) -> f64 {
        if self.surface.is_closed {
            // No surface between the two points: the same side.
            if let Some((q, other)) = near
                && p.distance(q) < other.distance * (1.0 - 1e-9)
            {
                return other.value.signum();
            }
            // The way to the inner of a triangle meets no other.
            let triangle = found.triangle as usize;
            if found.on_face && self.surface.certain[triangle] {
                let [a, b, c] = self.surface.boundary.corners[triangle];
                let height = offset.dot((b - a).cross(c - a));
                if height != 0.0 {
                    return -height.signum();
                }
            }
        }
        let w = self.surface.winding.at(p);
        if self.surface.is_closed {
            return if w > 0.5 { 1.0 } else { -1.0 };
        }
        (4.0 * w - 2.0).clamp(-1.0, 1.0)
    }
}
