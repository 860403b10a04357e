//! What the fit asks of a mesh: signed distance and its gradient, anywhere.

use bspline::Aabb;
use glam::DVec3;
use rayon::prelude::*;

use super::MeshDefects;
use super::nearest::{Feature, Nearest};
use super::packet::PLACES;
use super::surface::{Surface, surface};
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

/// What was found at a point of the unit box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Distance {
    /// Nearest point of the surface.
    pub foot: DVec3,
    /// To the surface, never negative.
    pub distance: f64,
    /// 1 inside, -1 outside, between them in holes.
    share: f32,
    /// Triangle of the foot, for searches near by.
    hint: u32,
    /// Whether the foot lies on a face, not on an edge or a corner.
    pub on_face: bool,
    /// Of a surface with holes: the winding number less the nearest whole one, which it would be without holes, and how
    /// wrong this may be; how far the rim of the nearest hole is, at least; how fast the winding number may change, at most.
    stray: f32,
    doubt: f32,
    rim: f32,
    slope: f32,
}

/// Points nearer than this share of a distance are on one side of the surface.
const NEARER: f64 = 1.0 - 1e-9;

impl Distance {
    /// Without its side.
    fn to(found: &Nearest) -> Self {
        Self {
            foot: found.point,
            distance: found.distance_squared.sqrt(),
            hint: found.triangle,
            on_face: found.feature == Feature::Inner,
            share: 0.0,
            stray: 0.0,
            doubt: 0.0,
            rim: 0.0,
            slope: 0.0,
        }
    }

    /// Signed distance, positive inside.
    pub fn value(&self) -> f64 {
        f64::from(self.share) * self.distance
    }

    /// Whether the winding number is neither inside nor outside.
    pub fn in_hole(&self) -> bool {
        self.share.abs() < 1.0
    }

    /// Takes over what the winding number was a little `way` from here.
    ///
    /// Off the surface `w = (1/4π) ∫ x·n/|x|³ dA` has by Stokes the gradient of a current loop along the rim, so
    /// `|∇w| ≤ Σ l/(4πr²)` over its edges of length `l` at distance `r`; through each triangle it changes by 1.
    fn carry(&mut self, way: f64, other: &Self) {
        let rim = f64::from(other.rim) - way;
        (self.stray, self.rim) = (other.stray, rim as f32);
        self.slope = other.slope * (other.rim / self.rim).powi(2);
        self.doubt = if rim > 0.0 {
            other.doubt + way as f32 * self.slope
        } else {
            f32::INFINITY
        };
    }

    /// Whether the winding number is surely beyond the bounds between which it scales the distance.
    fn is_whole(&self) -> bool {
        f64::from(self.stray.abs() + self.doubt) < 0.25 - WINDING_ERROR
    }

    /// Gradient of the signed distance at `p`, the place it was asked for; there is none on the surface and in holes.
    pub fn gradient(&self, p: DVec3) -> Option<DVec3> {
        let is_defined = !self.in_hole() && self.distance > 1e-12;
        is_defined.then(|| (p - self.foot) * (f64::from(self.share) / self.distance))
    }
}

/// Error of a winding number that the expansion of far boxes leaves, and some more.
const WINDING_ERROR: f64 = 0.02;

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
        self.at(self.to_unit(p), None).value() * self.scale
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

    /// Area of the surface in the unit box.
    pub(crate) fn unit_area(&self) -> f64 {
        self.surface
            .boundary
            .corners
            .iter()
            .map(|t| area_vector(t).length())
            .sum()
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

    /// Distance at `p` of the unit box, given what was found at a point near by.
    pub(crate) fn at(&self, p: DVec3, near: Option<(DVec3, &Distance)>) -> Distance {
        let found = self.surface.boundary.nearest(p, near.map_or(0, |n| n.1.hint));
        self.follow(p, &found, near)
            .unwrap_or_else(|| self.wind(p, &found))
    }

    /// How far the other side of a sheet is from the foot that was found along `way`, a unit vector across it, if it is
    /// nearer than `reach` and faces the other way: the contact of the ball that touches the surface in both
    /// \[Ma12\].
    pub(crate) fn across(&self, found: &Distance, way: DVec3, reach: f64) -> Option<f64> {
        let foot = found.foot;
        let mut radius = 0.5 * reach;
        let mut to = None;
        // The ball touches the last triangle found: none beyond it is looked at.
        let mut hint = found.hint;
        for _ in 0..12 {
            let center = foot + way * radius;
            let Nearest { point, triangle, .. } = self.surface.boundary.nearest(center, hint);
            hint = triangle;
            if center.distance(point) >= radius * (1.0 - 1e-6) {
                let to: DVec3 = to?;
                let faces_back = (to - way * radius).dot(way) > 0.5 * radius;
                return faces_back.then(|| to.dot(way));
            }
            let next = point - foot;
            if next.dot(way) <= 0.0 {
                return None;
            }
            radius = next.length_squared() / (2.0 * next.dot(way));
            to = Some(next);
        }
        None
    }

    /// Nearest points of the surface to eight places near each other, unit box.
    pub(crate) fn feet(&self, places: &[DVec3; PLACES]) -> [DVec3; PLACES] {
        let found = self.surface.boundary.nearest_of_eight(places, 0);
        found.map(|n| n.point)
    }

    /// [`MeshDistance::at`] for eight places near each other and near the one that something is known of.
    pub(crate) fn at_eight(
        &self,
        places: &[DVec3; PLACES],
        near: Option<(DVec3, &Distance)>,
    ) -> [Distance; PLACES] {
        let found = self
            .surface
            .boundary
            .nearest_of_eight(places, near.map_or(0, |n| n.1.hint));
        let mut last: Option<(DVec3, Distance)> = None;
        std::array::from_fn(|i| {
            let (p, found) = (places[i], &found[i]);
            let known = |near| self.follow(p, found, near);
            if let Some(out) = known(near).or_else(|| known(last.as_ref().map(|(q, d)| (*q, d)))) {
                return out;
            }
            let out = self.wind(p, found);
            last = Some((p, out));
            out
        })
    }

    /// What is known of `p` without its winding number, if its side is.
    fn follow(&self, p: DVec3, found: &Nearest, near: Option<(DVec3, &Distance)>) -> Option<Distance> {
        let mut out = Distance::to(found);
        if self.surface.rim.is_some() {
            let (q, other) = near?;
            let way = p.distance(q);
            out.carry(way, other);
            if !out.is_whole() {
                return None;
            }
        }
        out.share = self.side(p, found, near)?;
        Some(out)
    }

    /// The side of `p` by its winding number.
    fn wind(&self, p: DVec3, found: &Nearest) -> Distance {
        let mut out = Distance::to(found);
        let winding = self.surface.winding.at(p);
        let side = f64::from(u8::from(winding > 0.5));
        let Some(edges) = &self.surface.rim else {
            out.share = 2.0 * side as f32 - 1.0;
            return out;
        };
        out.share = (4.0 * winding - 2.0).clamp(-1.0, 1.0) as f32;
        out.stray = (winding - winding.round()) as f32;
        if out.is_whole() {
            let (nearest, slope) = edges.seen_from(p);
            (out.rim, out.slope) = (nearest as f32, slope as f32);
        } else {
            out.doubt = f32::INFINITY;
        }
        out
    }

    /// 1 inside, -1 outside, off holes, where that can be told without the winding number.
    fn side(&self, p: DVec3, found: &Nearest, near: Option<(DVec3, &Distance)>) -> Option<f32> {
        // No surface between the two points: the same side.
        if let Some((q, other)) = near
            && other.share.abs() == 1.0
            && p.distance(q) < other.distance * NEARER
        {
            return Some(other.share);
        }
        let outward = self
            .surface
            .normals
            .at(&self.surface.boundary, found.triangle, found.feature)?;
        let height = (p - found.point).dot(outward);
        (height != 0.0).then(|| if height < 0.0 { 1.0 } else { -1.0 })
    }
}
