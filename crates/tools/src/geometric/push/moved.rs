//! A field whose surface a brush has moved along the normals of its places.

use bspline::{Aabb, Field, Frame, Interval, Jet};
use glam::{DMat3, DVec3};

use crate::fade::fade;
use crate::geometric::band::FULL;
use crate::slope::slope;

/// Radii that a brush reaches along its way.
const ALONG: f64 = 2.0;

/// Where a brush acts in a step, and which way.
pub(super) struct Cover {
    /// Places of the surface, and the unit vectors into the solid there.
    pub places: Vec<[DVec3; 2]>,
    /// Of the time, at each of them.
    pub share: f64,
    pub radius: f64,
}

impl Cover {
    /// What matter goes in a step, as a share of the way that the force gives: a length of 0 to 1. Across its way a brush acts whole within
    /// half of its radius and fades to the whole; along it whole within the radius, and it fades to the double. So all of a wall goes
    /// alike, and the profile of many steps is that of one: by the distance from its place alone a wall that lags would lag more and more.
    pub fn at(&self, p: DVec3) -> DVec3 {
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

    fn reaches(&self, b: &Aabb) -> bool {
        let reach = self.radius * self.radius * (1.0 + ALONG * ALONG);
        let near = |[place, _]: &[DVec3; 2]| place.distance_squared(place.clamp(b.min, b.max)) < reach;
        self.places.iter().any(near)
    }
}

/// `f(x − h·w)`: every place takes the value that lies behind it.
pub(super) struct Moved<'a> {
    pub field: &'a dyn Field,
    /// `h`, into the solid.
    pub by: f64,
    /// `w`.
    pub cover: Cover,
}

impl Field for Moved<'_> {
    fn value(&self, p: DVec3) -> f64 {
        self.field.value(p - self.by * self.cover.at(p))
    }

    /// By central differences.
    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        (
            self.value(p),
            slope(1e-4 * self.cover.radius, p, |p| self.value(p)),
        )
    }

    fn jet(&self, p: DVec3) -> Jet {
        let (value, gradient) = self.value_gradient(p);
        Jet {
            value,
            gradient,
            hessian: DMat3::ZERO,
        }
    }

    fn bounds(&self, b: &Aabb) -> Interval {
        match self.cover.reaches(b) {
            true => {
                let reach = self.by.abs() * (1.0 + 1e-12);
                self.field.bounds(&Aabb::new(b.min - reach, b.max + reach))
            }
            false => self.field.bounds(b),
        }
    }

    fn frame_values(&self, frame: &Frame, lo: [i64; 3], count: [usize; 3], out: &mut [f64]) {
        if count.contains(&0) {
            return;
        }
        let last = std::array::from_fn(|a| lo[a] + count[a] as i64 - 1);
        if !self.cover.reaches(&frame.world_box(lo, last)) {
            return self.field.frame_values(frame, lo, count, out);
        }
        for (n, value) in out.iter_mut().enumerate() {
            let at = [n / count[2] / count[1], n / count[2] % count[1], n % count[2]];
            *value = self.value(frame.node(std::array::from_fn(|a| lo[a] + at[a] as i64)));
        }
    }
}
