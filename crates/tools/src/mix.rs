//! Fields that become other fields bit by bit.

use std::sync::Arc;

use bspline::{Aabb, Field, Frame, Interval, Jet};
use glam::{DMat3, DVec3};

use crate::fade::{STEEPEST, fade};

/// `1` where a field is `full` or more, `0` where it is `none` or less, smooth between.
#[derive(Clone)]
pub struct Faded {
    field: Arc<dyn Field>,
    none: f64,
    full: f64,
}

impl Faded {
    /// # Panics
    /// Unless `none < full`.
    pub fn new(field: Arc<dyn Field>, none: f64, full: f64) -> Self {
        assert!(none < full, "a fade needs a width");
        Self { field, none, full }
    }

    fn at(&self, value: f64) -> [f64; 3] {
        let width = self.full - self.none;
        let [value, first, second] = fade((self.full - value) / width);
        [value, -first / width, second / (width * width)]
    }
}

impl Field for Faded {
    fn value(&self, p: DVec3) -> f64 {
        self.at(self.field.value(p))[0]
    }

    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let (value, gradient) = self.field.value_gradient(p);
        let [value, first, _] = self.at(value);
        (value, gradient * first)
    }

    fn jet(&self, p: DVec3) -> Jet {
        let f = self.field.jet(p);
        let [value, first, second] = self.at(f.value);
        Jet {
            value,
            gradient: f.gradient * first,
            hessian: f.hessian * first + outer(f.gradient, f.gradient) * second,
        }
    }

    fn bounds(&self, b: &Aabb) -> Interval {
        let range = self.field.bounds(b);
        let [lo, hi] = [range.lo, range.hi].map(|v| self.at(v)[0]);
        let all = Interval::new(lo.min(hi), hi).widened(4.0 * STEEPEST * f64::EPSILON);
        Interval::new(all.lo.max(0.0), all.hi.min(1.0))
    }
}

/// `f + w·(g - f)`: `f` to the bit where `w` is 0, `g` where it is 1.
#[derive(Clone, Copy)]
pub struct Mixed<'a> {
    /// `f`.
    pub from: &'a dyn Field,
    /// `g`.
    pub to: &'a dyn Field,
    /// `w`, between 0 and 1.
    pub weight: &'a dyn Field,
}

impl Field for Mixed<'_> {
    fn value(&self, p: DVec3) -> f64 {
        match self.weight.value(p) {
            0.0 => self.from.value(p),
            1.0 => self.to.value(p),
            w => mixed(w, self.from.value(p), self.to.value(p)),
        }
    }

    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let (w, dw) = self.weight.value_gradient(p);
        let (f, df) = self.from.value_gradient(p);
        let (g, dg) = self.to.value_gradient(p);
        (mixed(w, f, g), df + w * (dg - df) + (g - f) * dw)
    }

    fn jet(&self, p: DVec3) -> Jet {
        let (w, f, g) = (self.weight.jet(p), self.from.jet(p), self.to.jet(p));
        let (by, slope) = (g.value - f.value, g.gradient - f.gradient);
        Jet {
            value: mixed(w.value, f.value, g.value),
            gradient: f.gradient + w.value * slope + by * w.gradient,
            hessian: f.hessian
                + (g.hessian - f.hessian) * w.value
                + outer(slope, w.gradient)
                + outer(w.gradient, slope)
                + w.hessian * by,
        }
    }

    fn bounds(&self, b: &Aabb) -> Interval {
        let w = self.weight.bounds(b);
        let f = self.from.bounds(b);
        if w.hi == 0.0 {
            return f;
        }
        let g = self.to.bounds(b);
        let hull = f.hull(g);
        hull.widened(4.0 * f64::EPSILON * hull.lo.abs().max(hull.hi.abs()))
            .intersection(f + w * (g - f))
    }

    fn frame_values(&self, frame: &Frame, lo: [i64; 3], count: [usize; 3], out: &mut [f64]) {
        if count.contains(&0) {
            return;
        }
        let last = std::array::from_fn(|a| lo[a] + count[a] as i64 - 1);
        let w = self.weight.frame_bounds(frame, lo, last);
        match (w.lo, w.hi) {
            (_, 0.0) => self.from.frame_values(frame, lo, count, out),
            (1.0, _) => self.to.frame_values(frame, lo, count, out),
            _ => {
                let mut others = [(); 2].map(|()| vec![0.0; out.len()]);
                let [to, weight] = &mut others;
                self.from.frame_values(frame, lo, count, out);
                self.to.frame_values(frame, lo, count, to);
                self.weight.frame_values(frame, lo, count, weight);
                for ((f, g), w) in out.iter_mut().zip(to).zip(weight) {
                    *f = mixed(*w, *f, *g);
                }
            }
        }
    }
}

fn mixed(w: f64, f: f64, g: f64) -> f64 {
    match w {
        0.0 => f,
        1.0 => g,
        w => f + w * (g - f),
    }
}

/// `a bᵀ`.
fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}
