//! The questions of [`Field`], answered by a tensor spline.

use glam::{DMat3, DVec3};

use super::kernel::Cell;
use super::spline::TensorSpline;
use super::{bounds, grid};
use crate::{Aabb, Basis, Field, Frame, Interval, Jet, Real};

impl<T: Real> TensorSpline<T> {
    /// The functions and coefficients at parameter `q`, with derivatives up to `order`.
    #[inline]
    fn cell(&self, q: DVec3, order: usize) -> Cell<'_, T> {
        let [_, ny, nz] = self.shape();
        Cell {
            coefficients: &self.coefficients,
            stride: [ny * nz, nz],
            basis: std::array::from_fn(|a| Basis::at(&self.knots[a], q[a], order)),
        }
    }

    /// Value and gradient by world coordinates at `q`, or beyond it.
    #[inline]
    fn in_world(&self, cell: &Cell<'_, T>, q: DVec3, beyond: DVec3) -> (f64, DVec3) {
        let (value, gradient) = cell.value_gradient();
        let gradient = self.place.local_from_world.matrix3.transpose() * vector(gradient);
        self.place.extend((value.as_f64(), gradient), q, beyond)
    }

    /// Value at parameter `q`, which is not clamped: the polynomials of the outermost spans continue.
    pub fn value_at_parameter(&self, q: DVec3) -> T {
        self.cell(q, 0).value()
    }
}

fn vector<T: Real>(v: [T; 3]) -> DVec3 {
    DVec3::from_array(v.map(T::as_f64))
}

impl<T: Real> Field for TensorSpline<T> {
    fn value(&self, p: DVec3) -> f64 {
        let (q, beyond) = self.place.clamp(p);
        self.cell(q, 0).value().as_f64() - self.place.slope * beyond.length()
    }

    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let (q, beyond) = self.place.clamp(p);
        self.in_world(&self.cell(q, 1), q, beyond)
    }

    /// Points on one line of a grid have the functions of two axes in common, which are found once.
    fn values_gradients(&self, points: &[DVec3], out: &mut [(f64, DVec3)]) {
        assert_eq!(points.len(), out.len(), "one output slot per point");
        let Some(first) = points.first() else { return };
        let mut last = self.place.clamp(*first).0;
        let mut cell = self.cell(last, 1);
        for (p, o) in points.iter().zip(out) {
            let (q, beyond) = self.place.clamp(*p);
            for a in 0..3 {
                if q[a] != last[a] {
                    cell.basis[a] = cell.basis[a].moved_to(&self.knots[a], q[a], 1);
                }
            }
            last = q;
            *o = self.in_world(&cell, q, beyond);
        }
    }

    fn jet(&self, p: DVec3) -> Jet {
        let (q, beyond) = self.place.clamp(p);
        let cell = self.cell(q, 2);
        let (value, gradient) = cell.value_gradient();
        let [xx, yy, zz, xy, xz, yz] = cell.second().map(T::as_f64);
        let hessian = DMat3::from_cols(
            DVec3::new(xx, xy, xz),
            DVec3::new(xy, yy, yz),
            DVec3::new(xz, yz, zz),
        );
        let m = self.place.local_from_world.matrix3;
        let inside = Jet {
            value: value.as_f64(),
            gradient: m.transpose() * vector(gradient),
            hessian: m.transpose() * hessian * m,
        };
        self.place.extend_jet(inside, q, beyond)
    }

    fn bounds(&self, b: &Aabb) -> Interval {
        bounds::over_parameters(self, &b.transformed(&self.place.local_from_world))
    }

    fn gradient_bounds(&self, b: &Aabb) -> [Interval; 3] {
        bounds::of_gradient(self, b)
    }

    fn frame_values(&self, frame: &Frame, lo: [i64; 3], count: [usize; 3], out: &mut [f64]) {
        grid::frame_values(self, frame, lo, count, out);
    }

    fn frame_bounds(&self, frame: &Frame, lo: [i64; 3], hi: [i64; 3]) -> Interval {
        bounds::over_parameters(self, &self.place.frame_box(frame, lo, hi))
    }
}
