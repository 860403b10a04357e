use glam::{DMat3, DVec3};

use super::range::{absolute, outward};
use super::{PrimitiveError, finite, positive, unit_gradient};
use crate::{Aabb, Field, Interval, Jet};

/// A box along the axes, with its exact distance inside and outside. Turned boxes are affine nodes of a tree.
///
/// With `q = |x - c| - h`: `-f = |max(q, 0)| + min(max_a q_a, 0)`. Inside, where two faces are equally near, the
/// gradient is that of the first axis; in a plane of symmetry it is zero along that axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Cuboid {
    center: DVec3,
    half_size: DVec3,
}

impl Cuboid {
    /// # Errors
    /// [`PrimitiveError::NotFinite`], [`PrimitiveError::NotPositive`].
    pub fn new(center: DVec3, half_size: DVec3) -> Result<Self, PrimitiveError> {
        finite("centre", center)?;
        for (name, h) in ["half size along x", "half size along y", "half size along z"]
            .into_iter()
            .zip(half_size.to_array())
        {
            positive(name, h)?;
        }
        Ok(Self { center, half_size })
    }

    /// Distance for `q`, negative inside; it never falls when a component of `q` grows.
    fn distance(q: DVec3) -> f64 {
        q.max(DVec3::ZERO).length() + q.max_element().min(0.0)
    }
}

impl Field for Cuboid {
    fn value(&self, p: DVec3) -> f64 {
        -Self::distance((p - self.center).abs() - self.half_size)
    }

    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let v = p - self.center;
        let q = v.abs() - self.half_size;
        let outside = q.max(DVec3::ZERO);
        let length = outside.length();
        let along = if length > 0.0 {
            outside / length
        } else {
            let a = q.max_position();
            DVec3::from_array(std::array::from_fn(|i| f64::from(i == a)))
        };
        // sign(0) = 0: in the plane of symmetry the two sides cancel.
        let side = DVec3::from_array(v.to_array().map(|x| if x == 0.0 { 0.0 } else { x.signum() }));
        (-Self::distance(q), -(along * side))
    }

    fn jet(&self, p: DVec3) -> Jet {
        let (value, gradient) = self.value_gradient(p);
        let outside = ((p - self.center).abs() - self.half_size).max(DVec3::ZERO);
        let length = outside.length();
        if length == 0.0 {
            return Jet {
                value,
                gradient,
                hessian: DMat3::ZERO,
            };
        }
        // Distance to the nearest point of the box, in the directions that lead away from it.
        let free = DMat3::from_diagonal(DVec3::from_array(outside.to_array().map(|x| f64::from(x > 0.0))));
        let outer = DMat3::from_cols(
            gradient * gradient.x,
            gradient * gradient.y,
            gradient * gradient.z,
        );
        Jet {
            value,
            gradient,
            hessian: (outer - free) * (1.0 / length),
        }
    }

    /// Exact: the distance grows with each `|x_a - c_a|`.
    fn bounds(&self, b: &Aabb) -> Interval {
        let (low, high) = (b.min - self.center, b.max - self.center);
        let axes: [[f64; 2]; 3] = std::array::from_fn(|a| absolute([low[a], high[a]]));
        let distance = |end: usize| Self::distance(DVec3::from_array(axes.map(|r| r[end])) - self.half_size);
        let size = (self.center.abs() + self.half_size).element_sum();
        outward(b, size, -distance(1), -distance(0))
    }

    fn gradient_bounds(&self, _: &Aabb) -> [Interval; 3] {
        unit_gradient()
    }

    /// 0 where one face alone is nearest, `√2/d` outside; infinite about the medial axis and the edges.
    fn hessian_bound(&self, b: &Aabb) -> f64 {
        let (low, high) = (b.min - self.center, b.max - self.center);
        let slack = 1e-12 * (self.center.abs() + self.half_size + b.min.abs().max(b.max.abs())).max_element();
        let q: [[f64; 2]; 3] = std::array::from_fn(|a| {
            let [near, far] = absolute([low[a], high[a]]);
            [near - self.half_size[a] - slack, far - self.half_size[a] + slack]
        });
        let rules = |a: usize| {
            let others = [q[(a + 1) % 3][1], q[(a + 2) % 3][1]];
            let one_side = low[a] > slack || high[a] < -slack;
            one_side && others.iter().all(|o| *o < 0.0 && *o < q[a][0])
        };
        let out = -self.bounds(b).hi;
        match (0..3).any(rules) {
            true => 0.0,
            false if out > 0.0 => std::f64::consts::SQRT_2 / out * (1.0 + 1e-12),
            false => f64::INFINITY,
        }
    }
}
