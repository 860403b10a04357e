//! The surface of a field, where its object stands.

use bspline::{Aabb, Field, Frame, Jet};
use glam::{DAffine3, DVec3};

use super::grid::Grid;

/// The surface `{f = c}` of a field, seen from the world in which its object is placed.
#[derive(Clone, Copy)]
pub struct Surface<'a> {
    field: &'a dyn Field,
    iso: f64,
    world_from_field: DAffine3,
    field_from_world: DAffine3,
}

impl<'a> Surface<'a> {
    /// Of a field that stands where it is.
    pub fn new(field: &'a dyn Field, iso: f64) -> Self {
        Self {
            field,
            iso,
            world_from_field: DAffine3::IDENTITY,
            field_from_world: DAffine3::IDENTITY,
        }
    }

    /// The same where the field's own world lies elsewhere, turned or stretched. The map can be inverted.
    pub fn placed(self, world_from_field: DAffine3) -> Self {
        Self {
            world_from_field,
            field_from_world: world_from_field.inverse(),
            ..self
        }
    }

    /// The field.
    pub fn field(&self) -> &'a dyn Field {
        self.field
    }

    /// `c`.
    pub fn iso(&self) -> f64 {
        self.iso
    }

    /// Where the object stands.
    pub fn world_from_field(&self) -> &DAffine3 {
        &self.world_from_field
    }

    /// From the world to the field's own.
    pub fn field_from_world(&self) -> &DAffine3 {
        &self.field_from_world
    }

    fn is_moved(&self) -> bool {
        self.world_from_field != DAffine3::IDENTITY
    }

    /// `f − c` and its derivatives at places.
    pub fn jets(&self, places: &[DVec3], out: &mut Vec<Jet>) {
        let none = Jet {
            value: 0.0,
            gradient: DVec3::ZERO,
            hessian: glam::DMat3::ZERO,
        };
        out.clear();
        out.resize(places.len(), none);
        if !self.is_moved() {
            self.field.jets(places, out);
        } else {
            let own: Vec<DVec3> = places
                .iter()
                .map(|p| self.field_from_world.transform_point3(*p))
                .collect();
            self.field.jets(&own, out);
            let m = self.field_from_world.matrix3;
            let t = m.transpose();
            for jet in out.iter_mut() {
                jet.gradient = t * jet.gradient;
                jet.hessian = t * jet.hessian * m;
            }
        }
        for jet in out {
            jet.value -= self.iso;
        }
    }

    /// `f − c` and its gradient.
    pub fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let (value, gradient) = self
            .field
            .value_gradient(self.field_from_world.transform_point3(p));
        (
            value - self.iso,
            self.field_from_world.matrix3.transpose() * gradient,
        )
    }

    /// The grid, as the field is asked along it.
    pub fn frame(&self, grid: &Grid) -> Frame {
        grid.frame(&self.field_from_world)
    }

    /// Box of the world round a box of the field's own.
    pub fn to_world(&self, b: &Aabb) -> Aabb {
        match self.is_moved() {
            true => b.transformed(&self.world_from_field),
            false => *b,
        }
    }

    /// Box of the field's own world round a box of the world.
    pub fn to_field(&self, b: &Aabb) -> Aabb {
        match self.is_moved() {
            true => b.transformed(&self.field_from_world),
            false => *b,
        }
    }
}
