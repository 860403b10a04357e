//! A field whose matter a tool has moved.

use bspline::hierarchical::Lattice;
use bspline::{Aabb, Field, Frame, HierarchicalSpline, Interval, Jet, Real};
use glam::{DAffine3, DMat3, DVec3};

use crate::slope::slope;

/// Which way matter goes, and how far.
pub(super) trait Displacement: Send + Sync {
    /// Of what is at a place now.
    fn at(&self, p: DVec3) -> DVec3;

    /// No displacement is longer.
    fn most(&self) -> f64;

    /// Whether anything in a box may have moved.
    fn reaches(&self, b: &Aabb) -> bool;
}

/// `f(x − d(x))`: every place takes the value that lies behind it, or where that would be beyond the box of the field, the last in it: there a
/// field falls to the outside of every solid, which is no matter.
pub(super) struct Moved<'a, D> {
    field: &'a dyn Field,
    lattice: &'a Lattice,
    lattice_from_world: &'a DAffine3,
    by: D,
    /// Of the differences that its slope is taken from, a length.
    step: f64,
}

impl<'a, D: Displacement> Moved<'a, D> {
    /// `field` moved; its slope is taken from differences over the length `step`.
    pub fn new<T: Real>(field: &'a HierarchicalSpline<T>, by: D, step: f64) -> Self {
        Self {
            field,
            lattice: field.lattice(),
            lattice_from_world: field.lattice_from_world(),
            by,
            step,
        }
    }
}

impl<D: Displacement> Field for Moved<'_, D> {
    fn value(&self, p: DVec3) -> f64 {
        let by = self.by.at(p);
        if by == DVec3::ZERO {
            return self.field.value(p);
        }
        let extent = self.lattice.extent();
        let [own, behind] = [p, p - by].map(|p| self.lattice_from_world.transform_point3(p));
        let last = behind.clamp(own.min(DVec3::ZERO), own.max(extent));
        self.field.value(match last == behind {
            true => p - by,
            false => self.lattice.world_from_lattice.transform_point3(last),
        })
    }

    /// By central differences.
    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        (self.value(p), slope(self.step, p, |p| self.value(p)))
    }

    fn jet(&self, p: DVec3) -> Jet {
        let (value, gradient) = self.value_gradient(p);
        Jet {
            value,
            gradient,
            hessian: DMat3::ZERO,
        }
    }

    fn bounds(&self, b: &Aabb) -> Interval {
        match self.by.reaches(b) {
            true => {
                let reach = self.by.most() * (1.0 + 1e-12);
                self.field.bounds(&Aabb::new(b.min - reach, b.max + reach))
            }
            false => self.field.bounds(b),
        }
    }

    fn frame_values(&self, frame: &Frame, lo: [i64; 3], count: [usize; 3], out: &mut [f64]) {
        if count.contains(&0) {
            return;
        }
        let last = std::array::from_fn(|a| lo[a] + count[a] as i64 - 1);
        if !self.by.reaches(&frame.world_box(lo, last)) {
            return self.field.frame_values(frame, lo, count, out);
        }
        for (n, value) in out.iter_mut().enumerate() {
            let at = [n / count[2] / count[1], n / count[2] % count[1], n % count[2]];
            *value = self.value(frame.node(std::array::from_fn(|a| lo[a] + at[a] as i64)));
        }
    }
}
