use bspline::{Aabb, Field, Interval, Jet};
use glam::{DMat3, DVec3};

use crate::scene::formula::Formula;
use crate::scene::operations::Slope;
use crate::slope::slope;

/// Points on each axis at which a formula is asked whether it is finite.
const ASKED: usize = 33;

/// What a formula `g` of place makes a solid: `g/√(|∇g|² + (g/R)²)`, 0 where `g` is, about the distance from there
/// \[Taubin94\], and nowhere more than `R`. Where `g` is not finite, and where it is 0 and even, as a comparison is that does not hold, it is
/// `-R`, outside.
#[derive(Clone, Debug)]
pub struct FormulaSolid {
    formula: Formula,
    most: f64,
}

impl FormulaSolid {
    /// The solid where a formula of `x`, `y` and `z` is above 0; `within` is where that counts.
    ///
    /// # Errors
    /// A sentence, for what is no formula, reads the density, or is not finite at one of many places.
    pub fn new(text: &str, within: &Aabb) -> Result<Self, String> {
        let formula = Formula::parse(text)?;
        if formula.reads_density() {
            return Err(format!("the formula {text:?} reads d; here are x, y and z alone"));
        }
        let step = within.size() / (ASKED - 1) as f64;
        for n in 0..ASKED * ASKED * ASKED {
            let at = [n / ASKED / ASKED, n / ASKED % ASKED, n % ASKED];
            let p = within.min + step * DVec3::from_array(at.map(|i| i as f64));
            formula.at(p, 0.0)?;
        }
        Ok(Self {
            formula,
            most: within.size().length(),
        })
    }
}

impl FormulaSolid {
    /// Whether the formula is above 0 a millionth of `R` beside a place, along an axis: no plateau of 0 lies there.
    fn is_above_beside(&self, p: DVec3) -> bool {
        let step = 1e-6 * self.most;
        let beside = DVec3::AXES
            .into_iter()
            .flat_map(|axis| [p - step * axis, p + step * axis]);
        let value = |at: DVec3| self.formula.of([at.x, at.y, at.z]);
        beside.map(value).any(|value| value > 0.0)
    }
}

impl Field for FormulaSolid {
    fn value(&self, p: DVec3) -> f64 {
        let along = |a: usize| Slope {
            value: p[a],
            gradient: DVec3::AXES[a],
        };
        let Slope { value, gradient } = self.formula.of([0, 1, 2].map(along));
        let distance = value / (gradient.length_squared() + (value / self.most).powi(2)).sqrt();
        if distance.is_finite() && value != 0.0 {
            distance
        } else if value.is_finite() && value != 0.0 {
            // Without a slope, as at the tip of a cone: the side is known.
            value.clamp(-self.most, self.most)
        } else if value == 0.0 && (gradient != DVec3::ZERO || self.is_above_beside(p)) {
            -f64::MIN_POSITIVE
        } else {
            -self.most
        }
    }

    /// By central differences over a millionth of `R`.
    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        (self.value(p), slope(1e-6 * self.most, p, |p| self.value(p)))
    }

    /// By central differences over a ten-thousandth of `R`.
    fn jet(&self, p: DVec3) -> Jet {
        let (value, gradient) = self.value_gradient(p);
        let column = |a: usize| slope(1e-4 * self.most, p, |p| self.value_gradient(p).1[a]);
        let h = DMat3::from_cols(column(0), column(1), column(2));
        Jet {
            value,
            gradient,
            hessian: (h + h.transpose()) * 0.5,
        }
    }

    /// On which side the formula is; how far is not told.
    fn bounds(&self, b: &Aabb) -> Interval {
        let range = |a: usize| Interval::new(b.min[a], b.max[a]);
        let value = self.formula.of([0, 1, 2].map(range));
        let most = self.most * (1.0 + 1e-12);
        // Where something is not finite the interval is the whole line.
        let (lo, hi) = (
            if value.lo > 0.0 { f64::MIN_POSITIVE } else { -most },
            if value.hi <= 0.0 { -f64::MIN_POSITIVE } else { most },
        );
        Interval::new(lo, hi)
    }
}
