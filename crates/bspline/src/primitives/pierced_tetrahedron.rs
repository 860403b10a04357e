use glam::{DMat3, DVec3};

use super::{PrimitiveError, finite, positive};
use crate::{Aabb, Field, Interval, Jet};

/// A hollow, smooth tetrahedron with a round hole in each of its four faces: a surface of genus 3.
///
/// With `y = (x - o)/size`: `f = (level - (|y|² - 5)² - 8 y₁y₂y₃)·size/16`. A shell about the sphere `|y|² = 5`,
/// thick towards the four corners `(-1,-1,-1)`, `(-1,1,1)`, `(1,-1,1)`, `(1,1,-1)` and open towards their
/// opposites. The factor makes `|∇f|` about 1 on the surface; far away `f` falls as `-|y|⁴`.
#[derive(Clone, Debug, PartialEq)]
pub struct PiercedTetrahedron {
    center: DVec3,
    size: f64,
    level: f64,
}

impl PiercedTetrahedron {
    /// The solid reaches to about `3.8·size` from its centre. `level` sets the thickness of the walls, between 0
    /// (none) and 12 (the holes close), both excluded; 5 is a good middle.
    ///
    /// # Errors
    /// [`PrimitiveError::NotFinite`], [`PrimitiveError::NotPositive`], [`PrimitiveError::Level`].
    pub fn new(center: DVec3, size: f64, level: f64) -> Result<Self, PrimitiveError> {
        let (low, high) = (0.0, 12.0);
        if !(low < level && level < high) {
            return Err(PrimitiveError::Level { level, low, high });
        }
        Ok(Self {
            center: finite("centre", center)?,
            size: positive("size", size)?,
            level,
        })
    }

    fn scale(&self) -> f64 {
        self.size / 16.0
    }
}

impl Field for PiercedTetrahedron {
    fn value(&self, p: DVec3) -> f64 {
        let y = (p - self.center) / self.size;
        let w = y.length_squared() - 5.0;
        (self.level - w * w - 8.0 * (y.x * y.y * y.z)) * self.scale()
    }

    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let y = (p - self.center) / self.size;
        let w = y.length_squared() - 5.0;
        let value = (self.level - w * w - 8.0 * (y.x * y.y * y.z)) * self.scale();
        let others = DVec3::new(y.y * y.z, y.z * y.x, y.x * y.y);
        (value, (y * (4.0 * w) + others * 8.0) * (-1.0 / 16.0))
    }

    fn jet(&self, p: DVec3) -> Jet {
        let (value, gradient) = self.value_gradient(p);
        let y = (p - self.center) / self.size;
        let w = y.length_squared() - 5.0;
        let outer = DMat3::from_cols(y * y.x, y * y.y, y * y.z);
        let swapped = DMat3::from_cols(
            DVec3::new(0.0, y.z, y.y),
            DVec3::new(y.z, 0.0, y.x),
            DVec3::new(y.y, y.x, 0.0),
        );
        let hessian = outer * 8.0 + DMat3::IDENTITY * (4.0 * w) + swapped * 8.0;
        Jet {
            value,
            gradient,
            hessian: hessian * (-1.0 / (16.0 * self.size)),
        }
    }

    /// The formula in interval arithmetic, cut with the mean-value form `f(c) + ∇f(b)·(b - c)`.
    fn bounds(&self, b: &Aabb) -> Interval {
        let (low, high) = (
            (b.min - self.center) / self.size,
            (b.max - self.center) / self.size,
        );
        // Rounding of y, here and in `value`.
        let slack = (b.min.abs().max(b.max.abs()) + self.center.abs()) * (4.0 * f64::EPSILON / self.size);
        if !(low.is_finite() && high.is_finite() && slack.is_finite()) {
            return Interval::EVERYTHING;
        }
        let y: [Interval; 3] = std::array::from_fn(|a| Interval::new(low[a], high[a]).widened(slack[a]));
        let five = Interval::point(5.0);
        let w = y[0].square() + y[1].square() + y[2].square() - five;
        let eight = Interval::point(8.0);
        let (square, product) = (w.square(), y[0] * y[1] * y[2] * eight);
        // The rounding of `value`: some twenty operations on numbers no larger than these.
        let y2 = y.map(|y| y.square().hi).iter().sum::<f64>() + 5.0;
        let rounding = 64.0 * f64::EPSILON * (y2 * y2 + self.level);
        if !rounding.is_finite() {
            return Interval::EVERYTHING;
        }
        let scale = Interval::point(self.scale());
        let plain = (Interval::point(self.level) - square - product).widened(rounding) * scale;

        let half = (b.size() * 0.5).to_array();
        let slopes = slopes(y);
        let mut mean = Interval::point(self.value(b.center())).widened(rounding * self.scale());
        for a in 0..3 {
            mean = mean + slopes[a] * Interval::new(-half[a], half[a]).widened(slack[a] * self.size);
        }
        plain.intersection(mean)
    }

    fn gradient_bounds(&self, b: &Aabb) -> [Interval; 3] {
        let (low, high) = (
            (b.min - self.center) / self.size,
            (b.max - self.center) / self.size,
        );
        let slack = (b.min.abs().max(b.max.abs()) + self.center.abs()) * (4.0 * f64::EPSILON / self.size);
        if !(low.is_finite() && high.is_finite() && slack.is_finite()) {
            return [Interval::EVERYTHING; 3];
        }
        let y: [Interval; 3] = std::array::from_fn(|a| Interval::new(low[a], high[a]).widened(slack[a]));
        let y2 = y.map(|y| y.square().hi).iter().sum::<f64>() + 5.0;
        slopes(y).map(|g| g.widened(64.0 * f64::EPSILON * y2 * y2))
    }

    /// `‖8yyᵀ + 4wI + 8S‖ <= 8|y|² + 4√3|w| + 8√2|y|`, over 16 sizes.
    fn hessian_bound(&self, b: &Aabb) -> f64 {
        let far = (b.min - self.center).abs().max((b.max - self.center).abs()) / self.size;
        let r = far.length();
        let w = (r * r - 5.0).max(5.0);
        let sum = 8.0 * r * r + 4.0 * 3f64.sqrt() * w + 8.0 * std::f64::consts::SQRT_2 * r;
        sum / (16.0 * self.size) * (1.0 + 1e-9)
    }
}

/// The gradient over a box of `y`.
fn slopes(y: [Interval; 3]) -> [Interval; 3] {
    let w = y[0].square() + y[1].square() + y[2].square() - Interval::point(5.0);
    let others = [y[1] * y[2], y[2] * y[0], y[0] * y[1]];
    let (four, eight, share) = (
        Interval::point(4.0),
        Interval::point(8.0),
        Interval::point(-1.0 / 16.0),
    );
    std::array::from_fn(|a| (y[a] * w * four + others[a] * eight) * share)
}
