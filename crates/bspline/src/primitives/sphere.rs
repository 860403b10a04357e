use glam::{DMat3, DVec3};

use super::range::{absolute, outward};
use super::{PrimitiveError, finite, positive, unit_gradient};
use crate::{Aabb, Field, Interval, Jet};

/// `f = r - |x - c|`. At the centre gradient and Hessian are given as zero.
#[derive(Clone, Debug, PartialEq)]
pub struct Sphere {
    center: DVec3,
    radius: f64,
}

impl Sphere {
    /// # Errors
    /// [`PrimitiveError::NotFinite`], [`PrimitiveError::NotPositive`].
    pub fn new(center: DVec3, radius: f64) -> Result<Self, PrimitiveError> {
        Ok(Self {
            center: finite("centre", center)?,
            radius: positive("radius", radius)?,
        })
    }
}

impl Field for Sphere {
    #[inline(always)]
    fn value(&self, p: DVec3) -> f64 {
        self.radius - (p - self.center).length()
    }

    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let v = p - self.center;
        let distance = v.length();
        let out = if distance > 0.0 { v / distance } else { DVec3::ZERO };
        (self.radius - distance, -out)
    }

    fn jet(&self, p: DVec3) -> Jet {
        let (value, gradient) = self.value_gradient(p);
        let distance = (p - self.center).length();
        let hessian = if distance > 0.0 {
            (DMat3::from_cols(
                gradient * gradient.x,
                gradient * gradient.y,
                gradient * gradient.z,
            ) - DMat3::IDENTITY)
                * (1.0 / distance)
        } else {
            DMat3::ZERO
        };
        Jet {
            value,
            gradient,
            hessian,
        }
    }

    /// Exact: from the nearest and the farthest point of the box.
    fn bounds(&self, b: &Aabb) -> Interval {
        let (low, high) = (b.min - self.center, b.max - self.center);
        let axes: [[f64; 2]; 3] = std::array::from_fn(|a| absolute([low[a], high[a]]));
        let length = |end: usize| DVec3::from_array(axes.map(|r| r[end])).length();
        let size = self.center.abs().element_sum() + self.radius;
        outward(b, size, self.radius - length(1), self.radius - length(0))
    }

    /// `-v/|v|` in interval arithmetic: each component exact.
    fn gradient_bounds(&self, b: &Aabb) -> [Interval; 3] {
        let slack = 4.0 * f64::EPSILON * (b.min.abs().max(b.max.abs()) + self.center.abs());
        let (low, high) = (b.min - self.center, b.max - self.center);
        if !(low.is_finite() && high.is_finite()) {
            return unit_gradient();
        }
        let v: [Interval; 3] = std::array::from_fn(|a| Interval::new(low[a], high[a]).widened(slack[a]));
        let rest = |a: usize| v[(a + 1) % 3].square() + v[(a + 2) % 3].square();
        std::array::from_fn(|a| -v[a].over_hypot(rest(a)))
    }

    /// `√2/|x - c|` at the point nearest to the centre.
    fn hessian_bound(&self, b: &Aabb) -> f64 {
        std::f64::consts::SQRT_2 / (self.radius - self.bounds(b).hi).max(0.0) * (1.0 + 1e-12)
    }
}
