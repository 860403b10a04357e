use std::any::Any;
use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::{CsgError, changed_branches, node_of};
use crate::{Aabb, Field, Frame, Interval, Jet, vectors};

/// `F = f + h·|∇f|`: the solid grown by the length `h` (shrunk, if negative), to first order for any field.
///
/// `-f/|∇f|` is the distance to the surface to first order \[Taubin94\], so the new surface lies where it is `h`: off by at most `h²` times the bending of the field over
/// twice its slope, and exact for distances. C¹ where `f` is C² and `∇f` does not vanish; where it does, the gradient
/// is that of `f`.
#[derive(Clone)]
pub struct Grown {
    field: Arc<dyn Field>,
    by: f64,
}

impl Grown {
    /// `field` grown by the world length `by`.
    ///
    /// # Errors
    /// [`CsgError::NotFinite`].
    pub fn new(field: Arc<dyn Field>, by: f64) -> Result<Self, CsgError> {
        if !by.is_finite() {
            let name = "the length to grow by";
            return Err(CsgError::NotFinite { name, value: by });
        }
        Ok(Self { field, by })
    }

    /// The field before it was grown.
    pub fn field(&self) -> &Arc<dyn Field> {
        &self.field
    }

    /// `h`.
    pub fn by(&self) -> f64 {
        self.by
    }

    fn range(&self, value: Interval, b: &Aabb) -> Interval {
        value + Interval::point(self.by) * vectors::length(self.field.gradient_bounds(b))
    }
}

impl Field for Grown {
    fn value(&self, p: DVec3) -> f64 {
        let (value, gradient) = self.field.value_gradient(p);
        value + self.by * gradient.length()
    }

    /// `∇F = ∇f + h·∇²f n`, `n = ∇f/|∇f|`.
    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let f = self.field.jet(p);
        let n = f.gradient.normalize_or_zero();
        (
            f.value + self.by * f.gradient.length(),
            f.gradient + self.by * (f.hessian * n),
        )
    }

    /// `∇²F = ∇²f + h (H (1 - nnᵀ) H / |∇f| + ∂H/∂n)`, `H = ∇²f`; its change along `n` by a central difference over
    /// `h/512`: no field tells third derivatives.
    fn jet(&self, p: DVec3) -> Jet {
        let f = self.field.jet(p);
        let (value, gradient) = self.value_gradient(p);
        let slope = f.gradient.length();
        let n = f.gradient.normalize_or_zero();
        let step = self.by.abs() / 1024.0;
        if n == DVec3::ZERO || step == 0.0 {
            return Jet {
                value,
                gradient,
                hessian: f.hessian,
            };
        }
        let across = DMat3::IDENTITY - DMat3::from_cols(n * n.x, n * n.y, n * n.z);
        let (ahead, behind) = (self.field.jet(p + n * step), self.field.jet(p - n * step));
        let third = (ahead.hessian - behind.hessian) * (0.5 / step);
        Jet {
            value,
            gradient,
            hessian: f.hessian + (f.hessian * across * f.hessian * (1.0 / slope) + third) * self.by,
        }
    }

    fn changed_boxes(&self, before: &dyn Field, within: &Aabb) -> Vec<Aabb> {
        let before = node_of::<Self>(before).filter(|before| before.by == self.by);
        changed_branches(
            before.map(|before| std::iter::once((&self.field, &before.field))),
            within,
        )
    }

    fn as_any(&self) -> Option<&dyn Any> {
        Some(self)
    }

    fn bounds(&self, b: &Aabb) -> Interval {
        self.range(self.field.bounds(b), b)
    }

    fn frame_bounds(&self, frame: &Frame, lo: [i64; 3], hi: [i64; 3]) -> Interval {
        self.range(self.field.frame_bounds(frame, lo, hi), &frame.world_box(lo, hi))
    }
}
