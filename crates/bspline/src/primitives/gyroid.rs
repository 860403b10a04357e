use std::f64::consts::TAU;

use glam::{DMat3, DVec3};

use super::turn::{ranges, sin_cos};
use super::{PrimitiveError, finite, positive};
use crate::{Aabb, Field, Interval, Jet};

/// `f = (g(k(x - o)) + level)/k`, `g = sin x cos y + sin y cos z + sin z cos x`, `k = 2π/period`.
///
/// Fills space with a labyrinth of one tunnel and one solid; at level 0 they are congruent. Smooth everywhere;
/// no distance: on the surface at level 0, `√2 <= |∇f| <= √3`.
#[derive(Clone, Debug, PartialEq)]
pub struct Gyroid {
    origin: DVec3,
    period: f64,
    level: f64,
}

impl Gyroid {
    /// `level` between -1.5 (nothing left) and 1.5 (no tunnel left), both excluded.
    ///
    /// # Errors
    /// [`PrimitiveError::NotFinite`], [`PrimitiveError::NotPositive`], [`PrimitiveError::Level`].
    pub fn new(origin: DVec3, period: f64, level: f64) -> Result<Self, PrimitiveError> {
        let (low, high) = (-1.5, 1.5);
        if !(low < level && level < high) {
            return Err(PrimitiveError::Level { level, low, high });
        }
        Ok(Self {
            origin: finite("origin", origin)?,
            period: positive("period", period)?,
            level,
        })
    }

    fn sin_cos(&self, p: DVec3) -> ([f64; 3], [f64; 3]) {
        let t = ((p - self.origin) / self.period).to_array().map(sin_cos);
        (t.map(|a| a.0), t.map(|a| a.1))
    }

    fn length(&self) -> f64 {
        self.period / TAU
    }

    /// Intervals of the sines and of the cosines over the box, and what rounding can do to them, if they are known.
    fn ranges(&self, b: &Aabb) -> Option<([[Interval; 3]; 2], f64)> {
        let (low, high) = (
            (b.min - self.origin) / self.period,
            (b.max - self.origin) / self.period,
        );
        if !(low.is_finite() && high.is_finite()) {
            return None;
        }
        // Rounding of the angle, here and in `value`, in turns; beyond 2⁴⁸ turns it hides the sine.
        let turns = low.abs().max(high.abs()).max_element()
            + (b.min.abs().max(b.max.abs()) + self.origin.abs()).max_element() / self.period;
        let slack = 8.0 * f64::EPSILON * (1.0 + turns);
        let axes: [[Interval; 2]; 3] =
            std::array::from_fn(|a| ranges(Interval::new(low[a], high[a]).widened(slack)));
        let rounding = 64.0 * f64::EPSILON * (1.0 + turns);
        Some(([axes.map(|r| r[0]), axes.map(|r| r[1])], rounding))
    }
}

impl Field for Gyroid {
    fn value(&self, p: DVec3) -> f64 {
        let (s, c) = self.sin_cos(p);
        (s[0] * c[1] + s[1] * c[2] + s[2] * c[0] + self.level) * self.length()
    }

    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let (s, c) = self.sin_cos(p);
        let value = (s[0] * c[1] + s[1] * c[2] + s[2] * c[0] + self.level) * self.length();
        let gradient = |a: usize, b: usize, z: usize| c[a] * c[b] - s[z] * s[a];
        (
            value,
            DVec3::new(gradient(0, 1, 2), gradient(1, 2, 0), gradient(2, 0, 1)),
        )
    }

    fn jet(&self, p: DVec3) -> Jet {
        let (value, gradient) = self.value_gradient(p);
        let (s, c) = self.sin_cos(p);
        let k = 1.0 / self.length();
        let diagonal = |a: usize, b: usize, z: usize| -(s[a] * c[b] + s[z] * c[a]) * k;
        let mixed = |a: usize, b: usize| -c[a] * s[b] * k;
        let (xy, yz, zx) = (mixed(0, 1), mixed(1, 2), mixed(2, 0));
        let hessian = DMat3::from_cols(
            DVec3::new(diagonal(0, 1, 2), xy, zx),
            DVec3::new(xy, diagonal(1, 2, 0), yz),
            DVec3::new(zx, yz, diagonal(2, 0, 1)),
        );
        Jet {
            value,
            gradient,
            hessian,
        }
    }

    /// The formula in interval arithmetic, cut with the mean-value form `f(c) + ∇f(b)·(b - c)`.
    fn bounds(&self, b: &Aabb) -> Interval {
        let Some(([s, c], rounding)) = self.ranges(b) else {
            return Interval::EVERYTHING;
        };
        let plain = s[0] * c[1] + s[1] * c[2] + s[2] * c[0];
        let level = Interval::point(self.level);
        let length = Interval::point(self.length()).widened(4.0 * f64::EPSILON * self.length());
        let plain = (plain + level).widened(rounding) * length;

        let center = b.center();
        let half = (b.size() * 0.5).to_array();
        let mean = slopes(s, c)
            .iter()
            .zip(half)
            .fold(Interval::point(self.value(center)), |sum, (g, h)| {
                sum + *g * Interval::new(-h, h).widened(2.0 * f64::EPSILON * center.abs().max_element())
            });
        plain.intersection(mean.widened(rounding * self.length()))
    }

    fn gradient_bounds(&self, b: &Aabb) -> [Interval; 3] {
        match self.ranges(b) {
            Some(([s, c], rounding)) => slopes(s, c).map(|g| g.widened(rounding)),
            None => [Interval::EVERYTHING; 3],
        }
    }

    fn hessian_bound(&self, b: &Aabb) -> f64 {
        let Some(([s, c], rounding)) = self.ranges(b) else {
            return f64::INFINITY;
        };
        let k = 1.0 / self.length();
        let diagonal = |a: usize, b: usize, z: usize| (s[a] * c[b] + s[z] * c[a]).abs().hi;
        let mixed = |a: usize, b: usize| (c[a] * s[b]).abs().hi;
        let on = [diagonal(0, 1, 2), diagonal(1, 2, 0), diagonal(2, 0, 1)];
        let off = [mixed(0, 1), mixed(1, 2), mixed(2, 0)];
        let square = |entries: [f64; 3]| entries.iter().map(|e| (e + 2.0 * rounding).powi(2)).sum::<f64>();
        k * (square(on) + 2.0 * square(off)).sqrt() * (1.0 + 1e-12)
    }
}

/// The gradient from sines and cosines.
fn slopes(s: [Interval; 3], c: [Interval; 3]) -> [Interval; 3] {
    let slope = |a: usize, b: usize, z: usize| c[a] * c[b] - s[z] * s[a];
    [slope(0, 1, 2), slope(1, 2, 0), slope(2, 0, 1)]
}
