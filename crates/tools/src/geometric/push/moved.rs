//! A field whose surface a brush has moved along its normal.

use bspline::{Aabb, Field, Frame, Interval, Jet};
use glam::{DMat3, DVec3};

use crate::fade::fade;
use crate::geometric::band::FULL;

/// Share of a step's time, and of its strength, in which a brush acts on a place: 0 to 1.
pub(super) struct Cover {
    pub places: Vec<DVec3>,
    /// Of the time, at each of them.
    pub share: f64,
    pub radius: f64,
}

impl Cover {
    pub fn at(&self, p: DVec3) -> f64 {
        let weight = |place: &DVec3| {
            let beyond = p.distance(*place) / self.radius - FULL;
            fade(beyond / (1.0 - FULL))[0]
        };
        self.share * self.places.iter().map(weight).sum::<f64>()
    }

    fn reaches(&self, b: &Aabb) -> bool {
        let radius = self.radius * self.radius;
        let near = |place: &DVec3| place.distance_squared(place.clamp(b.min, b.max)) < radius;
        self.places.iter().any(near)
    }
}

/// `f(x + h·w·∇f/|∇f|)`: every place takes the value that lies `h·w` deeper. The surface moves out by `h·w` along its normal, on
/// densities that are no distances too.
pub(super) struct Moved<'a> {
    pub field: &'a dyn Field,
    /// `h`.
    pub by: f64,
    /// Slope below which there is no direction.
    pub flat: f64,
    /// `w`.
    pub cover: Cover,
}

impl Field for Moved<'_> {
    fn value(&self, p: DVec3) -> f64 {
        let weight = self.cover.at(p);
        if weight == 0.0 {
            return self.field.value(p);
        }
        let (_, slope) = self.field.value_gradient(p);
        let length = slope.length().max(self.flat);
        self.field.value(p + self.by * weight / length * slope)
    }

    /// By central differences.
    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        let step = 1e-4 * self.cover.radius;
        let slope = DVec3::AXES.map(|a| (self.value(p + step * a) - self.value(p - step * a)) / (2.0 * step));
        (self.value(p), DVec3::from_array(slope))
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
        match self.cover.reaches(b) {
            true => {
                let reach = self.by.abs() * (1.0 + 1e-12);
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
        if !self.cover.reaches(&frame.world_box(lo, last)) {
            return self.field.frame_values(frame, lo, count, out);
        }
        for (n, value) in out.iter_mut().enumerate() {
            let at = [n / count[2] / count[1], n / count[2] % count[1], n % count[2]];
            *value = self.value(frame.node(std::array::from_fn(|a| lo[a] + at[a] as i64)));
        }
    }
}
