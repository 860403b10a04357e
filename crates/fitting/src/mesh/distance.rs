//! What the fit asks of a mesh: signed distance and its gradient, anywhere.

use std::f64::consts::PI;

use bspline::Aabb;
use glam::DVec3;
use rayon::prelude::*;

use super::MeshDefects;
use super::nearest::Nearest;
use super::surface::{Rim, Surface, surface};
use super::topology::{Faces, area_vector};
use crate::FitError;
use crate::phantoms::SplitMix64;

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
    /// Whether the winding number is neither inside nor outside.
    pub in_hole: bool,
    /// Nearest point of the surface.
    pub foot: DVec3,
    /// Triangle of the foot, for searches near by.
    pub hint: u32,
    /// How far the winding number is beyond the bounds between which it scales the distance, and how far the rim
    /// of the nearest hole is, at least.
    slack: f64,
    rim: f64,
}

/// What the winding number says of a point.
struct Side {
    /// 1 inside, -1 outside, between them in holes.
    share: f64,
    slack: f64,
    rim: f64,
}

/// Slack below which the winding number is computed anew: more than its error.
const LEAST_SLACK: f64 = 0.02;

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

    /// The box that a fit fills: a cube 1.15 times as wide as the longest side of the mesh.
    pub fn fit_box(&self) -> Aabb {
        Aabb::new(self.origin, self.origin + self.scale)
    }

    /// `count` points of the surface, world units: one at random in each of `count` shares of its area.
    pub fn surface_samples(&self, count: usize) -> Vec<DVec3> {
        let triangles = &self.surface.boundary.corners;
        let areas: Vec<f64> = triangles.iter().map(|t| area_vector(t).length()).collect();
        let share = areas.iter().sum::<f64>() / count as f64;
        let mut random = SplitMix64::new(1);
        let (mut at, mut passed) = (0, 0.0);
        (0..count)
            .map(|i| {
                let [r, mut s, mut t] = random.uniform3().to_array();
                let goal = (i as f64 + r) * share;
                while at + 1 < areas.len() && passed + areas[at] < goal {
                    passed += areas[at];
                    at += 1;
                }
                if s + t > 1.0 {
                    (s, t) = (1.0 - s, 1.0 - t);
                }
                let [a, b, c] = triangles[at];
                self.origin + (a + (b - a) * s + (c - a) * t) * self.scale
            })
            .collect()
    }

    /// Whether `p` lies in a hole, where the winding number is neither inside nor outside and the surface is invented.
    pub fn is_in_hole(&self, p: DVec3) -> bool {
        self.surface.rim.is_some() && (4.0 * self.winding_number(p) - 2.0).abs() < 1.0
    }

    /// Diagonal of the box round the mesh, world units.
    pub fn diagonal(&self) -> f64 {
        self.diagonal
    }

    /// Corners of the surface in the unit box, each once.
    pub(crate) fn corners(&self) -> impl Iterator<Item = DVec3> {
        let mut corners: Vec<[f64; 3]> = self
            .surface
            .boundary
            .corners
            .iter()
            .flatten()
            .map(|p| p.to_array())
            .collect();
        corners.par_sort_unstable_by(|p, q| {
            let by = |a: usize| p[a].total_cmp(&q[a]);
            by(0).then(by(1)).then(by(2))
        });
        corners.dedup();
        corners.into_iter().map(DVec3::from_array)
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
        let Side { share, slack, rim } = match &self.surface.rim {
            None => Side {
                share: self.whole_side(p, &found, offset, near),
                slack: 0.0,
                rim: 0.0,
            },
            Some(edges) => side_kept(p, near, edges).unwrap_or_else(|| self.side(p, edges)),
        };
        let is_whole = share.abs() == 1.0 && distance > 1e-12;
        Distance {
            value: share * distance,
            distance,
            in_hole: share.abs() < 1.0,
            gradient: is_whole.then(|| offset * (share / distance)),
            foot: found.point,
            hint: found.triangle,
            slack,
            rim,
        }
    }

    /// 1 inside a closed surface, -1 outside.
    fn whole_side(&self, p: DVec3, found: &Nearest, offset: DVec3, near: Option<(DVec3, &Distance)>) -> f64 {
        // No surface between the two points: the same side.
        if let Some((q, other)) = near
            && p.distance(q) < other.distance * (1.0 - 1e-9)
        {
            return other.value.signum();
        }
        // The way to the inner of a triangle meets no other.
        let triangle = found.triangle as usize;
        if found.on_face && self.surface.certain[triangle] {
            let height = offset.dot(area_vector(&self.surface.boundary.corners[triangle]));
            if height != 0.0 {
                return -height.signum();
            }
        }
        if self.surface.winding.at(p) > 0.5 {
            1.0
        } else {
            -1.0
        }
    }

    /// The side of a surface with holes.
    fn side(&self, p: DVec3, rim: &Rim) -> Side {
        let scaled = 4.0 * self.surface.winding.at(p) - 2.0;
        let slack = 0.25 * (scaled.abs() - 1.0);
        Side {
            share: scaled.clamp(-1.0, 1.0),
            slack,
            rim: if slack > LEAST_SLACK {
                rim.edges.nearest(p, 0).distance_squared.sqrt()
            } else {
                0.0
            },
        }
    }
}

/// The side of a point near by, if no surface lies between and the winding number cannot have changed by its slack.
///
/// `w = (1/4π) ∫ x·n/|x|³ dA` has by Stokes the gradient of a current loop along the rim, so `|∇w| ≤ L/(4πR²)` with
/// the length `L` of the rim and the distance `R` to it.
fn side_kept(p: DVec3, near: Option<(DVec3, &Distance)>, rim: &Rim) -> Option<Side> {
    let (q, other) = near?;
    let way = p.distance(q);
    let to_rim = other.rim - way;
    if way >= other.distance * (1.0 - 1e-9) || to_rim <= 0.0 {
        return None;
    }
    let slack = other.slack - way * rim.length / (4.0 * PI * to_rim * to_rim);
    (slack > LEAST_SLACK).then(|| Side {
        share: other.value.signum(),
        slack,
        rim: to_rim,
    })
}
