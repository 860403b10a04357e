//! The questions of [`Field`], answered by a hierarchical spline.

use glam::DVec3;

use super::spline::HierarchicalSpline;
use super::{along, batch, bounds, curvature, grid, kernel, slopes, versions};
use crate::{Aabb, Field, Frame, Interval, Jet, Real};

impl<T: Real> Field for HierarchicalSpline<T> {
    fn value(&self, p: DVec3) -> f64 {
        let (q, beyond) = self.place.clamp(p);
        let at = self.place(q);
        kernel::value(at.brick.own_totals(), at.cell, at.t).as_f64() - self.slope() * beyond.length()
    }

    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let (q, beyond) = self.place.clamp(p);
        let at = self.place(q);
        self.place.extend(at.value_gradient(&self.place), q, beyond)
    }

    fn jet(&self, p: DVec3) -> Jet {
        batch::jet_after(self, None, p).0
    }

    fn bounds(&self, b: &Aabb) -> Interval {
        bounds::over_lattice_box(self.roots(), &b.transformed(self.lattice_from_world()), None)
    }

    fn gradient_bounds(&self, b: &Aabb) -> [Interval; 3] {
        slopes::over_world_box(self.roots(), b)
    }

    fn bounds_along(&self, from: DVec3, to: DVec3) -> Interval {
        along::over_segment(self, from, to, self.finest_spacing(), self.rounding_bound())
    }

    fn changed_boxes(&self, before: &dyn Field, within: &Aabb) -> Vec<Aabb> {
        match before.as_any().and_then(|any| any.downcast_ref::<Self>()) {
            Some(before) => versions::changed_boxes(self, before, within),
            None => vec![*within],
        }
    }

    fn as_any(&self) -> Option<&dyn std::any::Any> {
        Some(self)
    }

    fn hessian_bound(&self, b: &Aabb) -> f64 {
        curvature::over_world_box(self, b)
    }

    fn values_gradients(&self, points: &[DVec3], out: &mut [(f64, DVec3)]) {
        batch::values_gradients(self, points, out);
    }

    fn jets(&self, points: &[DVec3], out: &mut [Jet]) {
        batch::jets(self, points, out);
    }

    fn frame_values(&self, frame: &Frame, lo: [i64; 3], count: [usize; 3], out: &mut [f64]) {
        grid::frame_values(self, frame, lo, count, out);
    }

    /// Where `known` is the same version.
    fn frame_values_from(
        &self,
        known: &dyn Field,
        values: &[f64],
        _: &Frame,
        _: [i64; 3],
        _: [usize; 3],
        out: &mut [f64],
    ) -> bool {
        let known = known.as_any().and_then(|any| any.downcast_ref::<Self>());
        let is_same = known.is_some_and(|known| self.is_same_version(known));
        if is_same {
            out.copy_from_slice(values);
        }
        is_same
    }

    fn frame_bounds(&self, frame: &Frame, lo: [i64; 3], hi: [i64; 3]) -> Interval {
        bounds::over_lattice_box(self.roots(), &self.place.frame_box(frame, lo, hi), None)
    }

    fn frame_bounds_about(&self, frame: &Frame, lo: [i64; 3], hi: [i64; 3], level: f64) -> Interval {
        bounds::over_lattice_box(self.roots(), &self.place.frame_box(frame, lo, hi), Some(level))
    }
}
