use glam::DVec3;

use super::axis::{Axis, Meridian, Profile, direction};
use super::range::{absolute, convex, outward};
use super::{PrimitiveError, finite, positive, unit_gradient};
use crate::{Aabb, Field, Interval, Jet};

/// A solid cylinder between two flat caps, with its exact distance inside and outside.
///
/// With `q = (ρ - r, |s| - h)`, radius and height from the middle: the box's formula in the plane. Inside, where
/// side and cap are equally near, the gradient is that of the side; on the axis and in the middle plane it is
/// zero along the direction that has no side.
#[derive(Clone, Debug, PartialEq)]
pub struct Cylinder {
    axis: Axis,
    half_length: f64,
    radius: f64,
}

impl Cylinder {
    /// From the centres of the two caps.
    ///
    /// # Errors
    /// [`PrimitiveError::NotFinite`], [`PrimitiveError::NotPositive`], and [`PrimitiveError::NoDirection`] if
    /// the ends coincide.
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

    fn distance(&self, radius: f64, height: f64) -> f64 {
        let (u, v) = (radius - self.radius, height.abs() - self.half_length);
        let (a, b) = (u.max(0.0), v.max(0.0));
        (a * a + b * b).sqrt() + u.max(v).min(0.0)
    }

    fn profile(&self, at: &Meridian) -> Profile {
        let value = -self.distance(at.radius, at.height);
        let (u, v) = (at.radius - self.radius, at.height.abs() - self.half_length);
        let up = if at.height == 0.0 { 0.0 } else { at.height.signum() };
        if u > 0.0 && v > 0.0 {
            let d = (u * u + v * v).sqrt();
            let (a, b) = (u / d, v / d);
            // The rim: distance to a point of the meridian plane.
            return Profile {
                value,
                first: [-a, -b * up],
                second: [-b * b / d, a * b * up / d, -a * a / d],
            };
        }
        let first = if u >= v { [-1.0, 0.0] } else { [0.0, -up] };
        Profile {
            value,
            first,
            ..Profile::default()
        }
    }
}

impl Field for Cylinder {
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

    /// `1/ρ` where the side alone is nearest, 0 at one cap, `1/ρ` and `1/d` outside; infinite about the medial axis and
    /// the rims.
    fn hessian_bound(&self, b: &Aabb) -> f64 {
        let ([r0, r1], height) = (self.axis.radius_range(b), self.axis.height_range(b));
        let [s0, s1] = absolute(height);
        let size = self.axis.size() + self.half_length + self.radius;
        let slack = 1e-12 * (b.min.abs().max(b.max.abs()).element_sum() + size);
        let (u, v) = (
            [r0 - self.radius, r1 - self.radius],
            [s0 - self.half_length, s1 - self.half_length],
        );
        let round = 1.0 / (r0 - slack).max(0.0) * (1.0 + 1e-9);
        let one_side = height[0] > slack || height[1] < -slack;
        let out = -self.bounds(b).hi;
        if v[1] + slack < 0.0 && v[1] + slack < u[0] {
            round
        } else if u[1] + slack < 0.0 && u[1] + slack < v[0] && one_side {
            0.0
        } else if out > 0.0 {
            (1.0 / out).hypot(round) * (1.0 + 1e-9)
        } else {
            f64::INFINITY
        }
    }
}
