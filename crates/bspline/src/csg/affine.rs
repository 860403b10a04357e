use std::any::Any;
use std::sync::Arc;

use glam::{DAffine3, DVec3};

use super::{CsgError, changed_branches, node_of};
use crate::{Aabb, Field, Frame, Interval, Jet, vectors};

/// `f(x) = g(T⁻¹x)` for an invertible affine `T`, the `s_i(T_i(x))` of [Hua04 eqs. 3 and 4].
///
/// Values are carried unchanged: a distance stays one only under rigid maps.
#[derive(Clone)]
pub struct Affine {
    field: Arc<dyn Field>,
    world_from_local: DAffine3,
    local_from_world: DAffine3,
}

impl Affine {
    /// `field` carried by `world_from_local`.
    ///
    /// # Errors
    /// [`CsgError::NotFinite`]; [`CsgError::NotInvertible`] if the determinant is below 1e-12 of the product of
    /// the columns' lengths: half the digits of the inverse would be gone.
    pub fn new(field: Arc<dyn Field>, world_from_local: DAffine3) -> Result<Self, CsgError> {
        if let Some(value) = world_from_local
            .to_cols_array()
            .into_iter()
            .find(|x| !x.is_finite())
        {
            return Err(CsgError::NotFinite {
                name: "an entry of the map",
                value,
            });
        }
        let m = world_from_local.matrix3;
        let lengths = [m.x_axis, m.y_axis, m.z_axis].map(DVec3::length);
        let units = [
            m.x_axis / lengths[0],
            m.y_axis / lengths[1],
            m.z_axis / lengths[2],
        ];
        let determinant = units[0].cross(units[1]).dot(units[2]);
        let local_from_world = world_from_local.inverse();
        // A zero column makes the determinant NaN, which is refused as well.
        if !(determinant.abs() >= 1e-12 && local_from_world.is_finite()) {
            return Err(CsgError::NotInvertible { determinant });
        }
        Ok(Self {
            field,
            world_from_local,
            local_from_world,
        })
    }

    /// The field before it was moved.
    pub fn field(&self) -> &Arc<dyn Field> {
        &self.field
    }

    /// Where it was moved.
    pub fn world_from_local(&self) -> &DAffine3 {
        &self.world_from_local
    }

    fn in_world(&self, local: Jet) -> Jet {
        let m = self.local_from_world.matrix3;
        Jet {
            value: local.value,
            gradient: m.transpose() * local.gradient,
            hessian: m.transpose() * local.hessian * m,
        }
    }

    fn local_frame(&self, frame: &Frame) -> Frame {
        Frame {
            world_from_grid: self.local_from_world * frame.world_from_grid,
            cells: frame.cells,
        }
    }
}

impl Field for Affine {
    fn value(&self, p: DVec3) -> f64 {
        self.field.value(self.local_from_world.transform_point3(p))
    }

    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let (value, gradient) = self
            .field
            .value_gradient(self.local_from_world.transform_point3(p));
        (value, self.local_from_world.matrix3.transpose() * gradient)
    }

    fn jet(&self, p: DVec3) -> Jet {
        self.in_world(self.field.jet(self.local_from_world.transform_point3(p)))
    }

    fn bounds(&self, b: &Aabb) -> Interval {
        self.field.bounds(&b.transformed(&self.local_from_world))
    }

    fn gradient_bounds(&self, b: &Aabb) -> [Interval; 3] {
        let local = self.field.gradient_bounds(&b.transformed(&self.local_from_world));
        vectors::transformed(self.local_from_world.matrix3.transpose(), local)
    }

    fn bounds_along(&self, from: DVec3, to: DVec3) -> Interval {
        let [from, to] = [from, to].map(|p| self.local_from_world.transform_point3(p));
        self.field.bounds_along(from, to)
    }

    fn changed_boxes(&self, before: &dyn Field, within: &Aabb) -> Vec<Aabb> {
        let before =
            node_of::<Self>(before).filter(|before| before.world_from_local == self.world_from_local);
        let local = within.transformed(&self.local_from_world);
        let pair = before.map(|before| std::iter::once((&self.field, &before.field)));
        let boxes = changed_branches(pair, &local);
        boxes
            .iter()
            .map(|b| b.transformed(&self.world_from_local))
            .collect()
    }

    fn as_any(&self) -> Option<&dyn Any> {
        Some(self)
    }

    fn hessian_bound(&self, b: &Aabb) -> f64 {
        // `‖Mᵀ H M‖ <= ‖M‖² ‖H‖`.
        let m = self.local_from_world.matrix3.to_cols_array();
        let stretch = m.iter().map(|x| x * x).sum::<f64>() * (1.0 + 1e-12);
        match self.field.hessian_bound(&b.transformed(&self.local_from_world)) {
            0.0 => 0.0,
            bound => stretch * bound,
        }
    }

    fn jets(&self, points: &[DVec3], out: &mut [Jet]) {
        let local: Vec<DVec3> = points
            .iter()
            .map(|p| self.local_from_world.transform_point3(*p))
            .collect();
        self.field.jets(&local, out);
        for jet in out {
            *jet = self.in_world(*jet);
        }
    }

    fn values_gradients(&self, points: &[DVec3], out: &mut [(f64, DVec3)]) {
        let local: Vec<DVec3> = points
            .iter()
            .map(|p| self.local_from_world.transform_point3(*p))
            .collect();
        self.field.values_gradients(&local, out);
        let transpose = self.local_from_world.matrix3.transpose();
        out.iter_mut()
            .for_each(|(_, gradient)| *gradient = transpose * *gradient);
    }

    fn frame_values(&self, frame: &Frame, lo: [i64; 3], count: [usize; 3], out: &mut [f64]) {
        self.field.frame_values(&self.local_frame(frame), lo, count, out);
    }

    fn frame_bounds(&self, frame: &Frame, lo: [i64; 3], hi: [i64; 3]) -> Interval {
        self.field.frame_bounds(&self.local_frame(frame), lo, hi)
    }

    fn frame_bounds_about(&self, frame: &Frame, lo: [i64; 3], hi: [i64; 3], level: f64) -> Interval {
        self.field
            .frame_bounds_about(&self.local_frame(frame), lo, hi, level)
    }
}
