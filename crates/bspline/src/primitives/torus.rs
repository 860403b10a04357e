use glam::DVec3;

use super::axis::{Axis, Meridian, Profile, direction};
use super::range::{absolute, outward};
use super::{PrimitiveError, finite, positive, unit_gradient};
use crate::{Aabb, Field, Interval, Jet};

/// `f = r - √((ρ - R)² + s²)`, radius and height from the axis: a tube round a ring.
///
/// On the ring gradient and Hessian are given as zero; on the axis the gradient keeps its part along it.
#[derive(Clone, Debug, PartialEq)]
pub struct Torus {
    axis: Axis,
    major: f64,
    minor: f64,
}

impl Torus {
    /// Ring of radius `major` round `axis` (any length) through `center`, tube of radius `minor < major`.
    ///
    /// # Errors
    /// [`PrimitiveError::NotFinite`], [`PrimitiveError::NotPositive`], [`PrimitiveError::NoDirection`], and
    /// [`PrimitiveError::ClosedTorus`] where the distance would not be one.
    pub fn new(center: DVec3, axis: DVec3, major: f64, minor: f64) -> Result<Self, PrimitiveError> {
        let (origin, direction) = (finite("centre", center)?, direction("axis", axis)?);
        let (major, minor) = (
            positive("ring's radius", major)?,
            positive("tube's radius", minor)?,
        );
        if minor >= major {
            return Err(PrimitiveError::ClosedTorus { major, minor });
        }
        Ok(Self {
            axis: Axis { origin, direction },
            major,
            minor,
        })
    }

    fn value_at(&self, off_ring: f64, height: f64) -> f64 {
        self.minor - (off_ring * off_ring + height * height).sqrt()
    }

    fn profile(&self, at: &Meridian) -> Profile {
        let u = at.radius - self.major;
        let d = (u * u + at.height * at.height).sqrt();
        let value = self.value_at(u, at.height);
        if d == 0.0 {
            return Profile {
                value,
                ..Profile::default()
            };
        }
        let (a, b) = (u / d, at.height / d);
        Profile {
            value,
            first: [-a, -b],
            second: [-b * b / d, a * b / d, -a * a / d],
        }
    }
}

impl Field for Torus {
    fn value(&self, p: DVec3) -> f64 {
        let at = self.axis.meridian(p);
        self.value_at(at.radius - self.major, at.height)
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

    /// The formula on the ranges of radius and height, cut with the Lipschitz bound about the centre.
    fn bounds(&self, b: &Aabb) -> Interval {
        let [r0, r1] = self.axis.radius_range(b);
        let (u, s) = (
            absolute([r0 - self.major, r1 - self.major]),
            absolute(self.axis.height_range(b)),
        );
        let (center, reach) = (self.value(b.center()), 0.5 * b.size().length());
        let low = self.value_at(u[1], s[1]).max(center - reach);
        let high = self.value_at(u[0], s[0]).min(center + reach);
        outward(b, self.axis.size() + self.major + self.minor, low, high)
    }

    /// `-(u e + s a)/√(u² + s²)` in interval arithmetic, `u` the distance off the ring's radius, `s` the height.
    fn gradient_bounds(&self, b: &Aabb) -> [Interval; 3] {
        if !(b.min.is_finite() && b.max.is_finite()) {
            return unit_gradient();
        }
        let slack = 64.0
            * f64::EPSILON
            * (b.min.abs().max(b.max.abs()).element_sum() + self.axis.size() + self.major);
        let range = |[lo, hi]: [f64; 2]| Interval::new(lo, hi).widened(slack);
        let [r0, r1] = self.axis.radius_range(b);
        let (u, s) = (
            range([r0 - self.major, r1 - self.major]),
            range(self.axis.height_range(b)),
        );
        let (across, along) = (u.over_hypot(s.square()), s.over_hypot(u.square()));
        let outward = self.axis.outward_range(b);
        let unit = unit_gradient();
        std::array::from_fn(|a| {
            let exact = -(outward[a] * across + Interval::point(self.axis.direction[a]) * along);
            exact.intersection(unit[a])
        })
    }

    /// The curvatures of the tube, `1/d` off the ring, and of the ring, at most `1/ρ`.
    fn hessian_bound(&self, b: &Aabb) -> f64 {
        let off_ring = (self.minor - self.bounds(b).hi).max(0.0);
        let off_axis = self.axis.radius_range(b)[0].max(0.0);
        (1.0 / off_ring).hypot(1.0 / off_axis) * (1.0 + 1e-9)
    }
}
