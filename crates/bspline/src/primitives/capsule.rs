use glam::DVec3;

use super::axis::{Axis, Meridian, Profile, direction};
use super::range::{absolute, convex, outward};
use super::{PrimitiveError, finite, positive, unit_gradient};
use crate::{Aabb, Field, Interval, Jet};

/// `f = r - distance to a segment`. On the segment gradient and Hessian are given as zero across it.
#[derive(Clone, Debug, PartialEq)]
pub struct Capsule {
    axis: Axis,
    half_length: f64,
    radius: f64,
}

impl Capsule {
    /// From the ends of the segment.
    ///
    /// # Errors
    /// [`PrimitiveError::NotFinite`], [`PrimitiveError::NotPositive`], and [`PrimitiveError::NoDirection`] if
    /// the ends coincide (take a sphere).
    pub fn new(from: DVec3, to: DVec3, radius: f64) -> Result<Self, PrimitiveError> {
        let (from, to) = (finite("first end", from)?, finite("second end", to)?);
        let direction = direction("axis", to - from)?;
        Ok(Self {
            axis: Axis {
                origin: from * 0.5 + to * 0.5,
                direction,
            },
            half_length: (to - from).length() * 0.5,
            radius: positive("radius", radius)?,
        })
    }

    /// Distance to the segment, less the radius.
    fn distance(&self, radius: f64, height: f64) -> f64 {
        let beyond = (height.abs() - self.half_length).max(0.0);
        (radius * radius + beyond * beyond).sqrt() - self.radius
    }

    fn profile(&self, at: &Meridian) -> Profile {
        let beyond = (at.height.abs() - self.half_length).max(0.0);
        let d = (at.radius * at.radius + beyond * beyond).sqrt();
        let value = -self.distance(at.radius, at.height);
        if d == 0.0 {
            return Profile {
                value,
                ..Profile::default()
            };
        }
        let (a, b) = (at.radius / d, beyond / d * at.height.signum());
        let second = if beyond > 0.0 {
            [-b * b / d, a * b / d, -a * a / d]
        } else {
            [0.0; 3]
        };
        Profile {
            value,
            first: [-a, -b],
            second,
        }
    }
}

impl Field for Capsule {
    fn value(&self, p: DVec3) -> f64 {
        let at = self.axis.meridian(p);
        -self.distance(at.radius, at.height)
    }

    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let at = self.axis.meridian(p);
        let f = self.profile(&at);
        (f.value, self.axis.gradient(&at, &f))
    }

    fn jet(&self, p: DVec3) -> Jet {
        let at = self.axis.meridian(p);
        self.axis.jet(&at, &self.profile(&at))
    }

    /// The formula on the ranges of radius and height, cut with what convexity says.
    fn bounds(&self, b: &Aabb) -> Interval {
        let ([r0, r1], [s0, s1]) = (self.axis.radius_range(b), absolute(self.axis.height_range(b)));
        let [low, high] = convex(b, |p| {
            let (value, gradient) = self.value_gradient(p);
            (-value, -gradient)
        });
        let (low, high) = (low.max(self.distance(r0, s0)), high.min(self.distance(r1, s1)));
        outward(b, self.axis.size() + self.half_length + self.radius, -high, -low)
    }

    fn gradient_bounds(&self, _: &Aabb) -> [Interval; 3] {
        unit_gradient()
    }

    /// `√2/d` at the point nearest to the segment.
    fn hessian_bound(&self, b: &Aabb) -> f64 {
        std::f64::consts::SQRT_2 / (self.radius - self.bounds(b).hi).max(0.0) * (1.0 + 1e-12)
    }
}
