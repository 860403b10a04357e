//! What the solids of revolution share: everything is a function of the distance to an axis and the height.

use glam::{DMat3, DVec3};

use super::range::{convex, linear};
use super::{PrimitiveError, finite};
use crate::{Aabb, Interval, Jet};

/// Unit vector along `v`.
pub(super) fn direction(name: &'static str, v: DVec3) -> Result<DVec3, PrimitiveError> {
    finite(name, v)?;
    // Scaled first, so that neither tiny nor huge vectors lose their length to the squares.
    let largest = v.abs().max_element();
    let unit = v / largest;
    if !(unit.is_finite() && largest > f64::MIN_POSITIVE) {
        return Err(PrimitiveError::NoDirection {
            name,
            length: largest,
        });
    }
    Ok(unit / unit.length())
}

/// A point and a unit vector.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axis {
    pub origin: DVec3,
    pub direction: DVec3,
}

/// A point in the coordinates of an axis.
#[derive(Clone, Copy)]
pub(super) struct Meridian {
    /// Distance to the axis.
    pub radius: f64,
    /// Height above the origin.
    pub height: f64,
    /// Unit vector away from the axis; zero on it.
    pub outward: DVec3,
}

/// A function of radius and height with its derivatives there.
#[derive(Clone, Copy, Default)]
pub(super) struct Profile {
    pub value: f64,
    /// By radius and by height.
    pub first: [f64; 2],
    /// `∂²/∂ρ²`, `∂²/∂ρ∂s`, `∂²/∂s²`.
    pub second: [f64; 3],
}

impl Axis {
    pub fn meridian(&self, p: DVec3) -> Meridian {
        let v = p - self.origin;
        let height = self.direction.dot(v);
        let away = v - self.direction * height;
        let radius = away.length();
        Meridian {
            radius,
            height,
            outward: if radius > 0.0 { away / radius } else { DVec3::ZERO },
        }
    }

    /// Gradient in space.
    pub fn gradient(&self, at: &Meridian, f: &Profile) -> DVec3 {
        at.outward * f.first[0] + self.direction * f.first[1]
    }

    /// Value, gradient and Hessian in space; on the axis itself the terms that divide by the radius are left out.
    pub fn jet(&self, at: &Meridian, f: &Profile) -> Jet {
        let outer = |a: DVec3, b: DVec3| DMat3::from_cols(a * b.x, a * b.y, a * b.z);
        let (e, a) = (at.outward, self.direction);
        let mut hessian =
            outer(e, e) * f.second[0] + (outer(e, a) + outer(a, e)) * f.second[1] + outer(a, a) * f.second[2];
        if at.radius > 0.0 {
            hessian += (DMat3::IDENTITY - outer(e, e) - outer(a, a)) * (f.first[0] / at.radius);
        }
        Jet {
            value: f.value,
            gradient: self.gradient(at, f),
            hessian,
        }
    }

    /// Range of the distance to the axis over the box; the upper end is exact.
    pub fn radius_range(&self, b: &Aabb) -> [f64; 2] {
        let [low, high] = convex(b, |p| {
            let at = self.meridian(p);
            (at.radius, at.outward)
        });
        [low.max(0.0), high]
    }

    /// Ranges of the components of the unit vector away from the axis, each of them exact but for the box's turn.
    pub fn outward_range(&self, b: &Aabb) -> [Interval; 3] {
        let slack = 16.0 * f64::EPSILON * (b.min.abs().max(b.max.abs()).element_sum() + self.size());
        let away: [Interval; 3] = std::array::from_fn(|a| {
            let [low, high] = linear(
                b,
                self.origin,
                DVec3::AXES[a] - self.direction * self.direction[a],
            );
            Interval {
                lo: low.min(high),
                hi: high.max(low),
            }
            .widened(slack)
        });
        let rest = |a: usize| away[(a + 1) % 3].square() + away[(a + 2) % 3].square();
        std::array::from_fn(|a| away[a].over_hypot(rest(a)))
    }

    /// Range of the height over the box, exact.
    pub fn height_range(&self, b: &Aabb) -> [f64; 2] {
        linear(b, self.origin, self.direction)
    }

    /// Largest length of the axis's own numbers.
    pub fn size(&self) -> f64 {
        self.origin.abs().element_sum()
    }
}
