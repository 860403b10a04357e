//! What a brush covers that moves a surface along the normals of its places.

use bspline::Aabb;
use glam::DVec3;

use crate::fade::fade;
use crate::geometric::band::FULL;
use crate::geometric::moved::Displacement;

/// Radii that a brush reaches along its way.
const ALONG: f64 = 2.0;

/// Where a brush acts in a step, and which way.
pub(super) struct Cover {
    /// Places of the surface, and the unit vectors into the solid there.
    pub places: Vec<[DVec3; 2]>,
    /// Of the time, at each of them.
    pub share: f64,
    pub radius: f64,
    /// The way that the force gives, into the solid.
    pub by: f64,
}

impl Cover {
    /// What matter goes in a step, as a share of the way that the force gives: a length of 0 to 1. Across its way a brush acts whole within
    /// half of its radius and fades to the whole; along it whole within the radius, and it fades to the double. So all of a wall goes
    /// alike, and the profile of many steps is that of one: by the distance from its place alone a wall that lags would lag more and more.
    pub fn share_at(&self, p: DVec3) -> DVec3 {
        let way = |[place, inward]: &[DVec3; 2]| {
            let from = (p - *place) / self.radius;
            let along = from.dot(*inward);
            let across = (from - along * *inward).length();
            fade((across - FULL) / (1.0 - FULL))[0] * fade((along.abs() - 1.0) / (ALONG - 1.0))[0] * *inward
        };
        self.share * self.places.iter().map(way).sum::<DVec3>()
    }

    /// The box in which it acts.
    pub fn within(&self) -> Option<Aabb> {
        let boxes = self.places.iter().map(|[place, inward]| {
            let across = (DVec3::ONE - *inward * *inward).max(DVec3::ZERO);
            let reach =
                self.radius * (ALONG * inward.abs() + DVec3::from_array(across.to_array().map(f64::sqrt)));
            Aabb::new(*place - reach, *place + reach)
        });
        boxes.reduce(Aabb::hull)
    }
}

impl Displacement for Cover {
    fn at(&self, p: DVec3) -> DVec3 {
        self.by * self.share_at(p)
    }

    fn most(&self) -> f64 {
        self.by.abs()
    }

    fn reaches(&self, b: &Aabb) -> bool {
        let reach = self.radius * self.radius * (1.0 + ALONG * ALONG);
        let near = |[place, _]: &[DVec3; 2]| place.distance_squared(place.clamp(b.min, b.max)) < reach;
        self.places.iter().any(near)
    }
}
