//! The surface of a tool that is a part of an object.

use bspline::Aabb;
use glam::DVec3;

use super::super::{DistanceBrick, Obstacle};

/// Steps to the surface at most.
const STEPS: usize = 8;

/// The object's distance, sampled in the box from which the tool was cut.
#[derive(Debug, PartialEq)]
pub(super) struct Carved {
    brick: DistanceBrick,
    half: DVec3,
    /// How deep under the object's surface the tool's points are, mm.
    nose: f64,
}

/// An object as the tool's own axes have it.
struct Cut<'a> {
    object: &'a dyn Obstacle,
    centre: DVec3,
}

impl Obstacle for Cut<'_> {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        self.object.distance(self.centre + p)
    }

    fn finest(&self) -> f64 {
        self.object.finest()
    }
}

impl Carved {
    /// Of the part in a box, with nodes so far apart, mm.
    pub fn new(object: &dyn Obstacle, centre: DVec3, half: DVec3, nose: f64, spacing: f64) -> Self {
        let within = Aabb::new(-half, half);
        Self {
            brick: DistanceBrick::sampled(&Cut { object, centre }, &within, spacing),
            half,
            nose,
        }
    }

    /// Signed distance to the surface of the points, and its gradient, of length 1.
    pub fn distance(&self, p: DVec3) -> (f64, DVec3) {
        let (distance, gradient) = self.brick.distance(p);
        (distance + self.nose, gradient.normalize_or(DVec3::Z))
    }

    /// A near place of the surface; none where it leaves the box.
    pub fn project(&self, mut p: DVec3) -> Option<DVec3> {
        let exact = 1e-4 * self.brick.spacing();
        for _ in 0..STEPS {
            let (distance, gradient) = self.brick.distance(p);
            let off = distance + self.nose;
            if off.abs() < exact {
                return p.abs().cmple(self.half).all().then_some(p);
            }
            p -= off * gradient / gradient.length_squared().max(0.1);
        }
        None
    }

    /// Places of the surface, about `spacing` apart.
    #[cfg(test)]
    pub fn points(&self, spacing: f64) -> Vec<DVec3> {
        let parts = (self.half / spacing).ceil().as_ivec3();
        let along = |n: i32| (-n..=n).map(move |k| spacing * f64::from(k));
        let all = along(parts.x).flat_map(move |x| {
            along(parts.y).flat_map(move |y| along(parts.z).map(move |z| DVec3::new(x, y, z)))
        });
        let near = all.filter(|p| self.distance(*p).0.abs() < spacing);
        near.filter_map(|p| self.project(p)).collect()
    }
}
