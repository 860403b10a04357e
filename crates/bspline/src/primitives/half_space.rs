use glam::{DMat3, DVec3};

use super::range::{linear, outward};
use super::{PrimitiveError, finite};
use crate::{Aabb, Field, Interval, Jet};

/// `f = -n·(x - o)`: the side of a plane that its normal points away from.
#[derive(Clone, Debug, PartialEq)]
pub struct HalfSpace {
    point: DVec3,
    normal: DVec3,
}

impl HalfSpace {
    /// The side behind the plane through `point` with outward normal `normal`, of any length.
    ///
    /// # Errors
    /// [`PrimitiveError::NotFinite`], [`PrimitiveError::NoDirection`].
    pub fn new(point: DVec3, normal: DVec3) -> Result<Self, PrimitiveError> {
        Ok(Self {
            point: finite("point", point)?,
            normal: super::axis::direction("normal", normal)?,
        })
    }
}

impl Field for HalfSpace {
    fn value(&self, p: DVec3) -> f64 {
        -self.normal.dot(p - self.point)
    }

    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        (self.value(p), -self.normal)
    }

    fn jet(&self, p: DVec3) -> Jet {
        Jet {
            value: self.value(p),
            gradient: -self.normal,
            hessian: DMat3::ZERO,
        }
    }

    /// Exact.
    fn bounds(&self, b: &Aabb) -> Interval {
        let [low, high] = linear(b, self.point, -self.normal);
        outward(b, self.point.abs().element_sum(), low, high)
    }

    fn gradient_bounds(&self, _: &Aabb) -> [Interval; 3] {
        (-self.normal).to_array().map(Interval::point)
    }

    fn hessian_bound(&self, _: &Aabb) -> f64 {
        0.0
    }
}
