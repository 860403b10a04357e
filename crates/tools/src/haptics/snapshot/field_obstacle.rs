//! The surface of a field itself, for tools that are points.

use std::sync::Arc;

use bspline::Field;
use glam::{DAffine3, DVec3};

use crate::haptics::Obstacle;

/// Projections of a place onto the tangent planes where it is projected to.
const STEPS: usize = 4;
/// Way, over the node distance told, after which a projection has arrived.
const SETTLED: f64 = 1e-4;

/// Signed distance straight from a field: `(c − f)/|∇f|` at the surface \[Taubin94\], and from near it the way to the closest place of the
/// surface.
///
/// Where `f = c` the distance is 0: a point in contact lies on the surface as exactly as the field tells its value. Away from it by less
/// than the radius of curvature `R` the distance is off by a share of `(φ/R)⁴` at most; farther away it is what the first plane says. Each
/// answer asks the field at most five times and allocates nothing if the field does not.
#[derive(Clone)]
pub struct FieldObstacle<F: ?Sized> {
    field: Arc<F>,
    iso: f64,
    field_from_world: DAffine3,
    /// Shortest knot interval, mm of the world.
    detail: f64,
}

impl<F: Field + ?Sized> FieldObstacle<F> {
    /// The surface `{f = c}` of a field that stands at a place, whose shortest feature is `detail` mm there.
    pub fn new(field: Arc<F>, iso: f64, world_from_field: DAffine3, detail: f64) -> Self {
        Self {
            field,
            iso,
            field_from_world: world_from_field.inverse(),
            detail,
        }
    }

    /// The field.
    pub fn field(&self) -> &Arc<F> {
        &self.field
    }

    /// How deep inside a place is to first order, and the direction into the solid; none where the field is flat.
    fn look(&self, p: DVec3) -> Option<(f64, DVec3)> {
        let (value, gradient) = self
            .field
            .value_gradient(self.field_from_world.transform_point3(p));
        let gradient = self.field_from_world.matrix3.transpose() * gradient;
        let slope = gradient.length();
        (slope > 0.0 && slope.is_finite()).then(|| ((value - self.iso) / slope, gradient / slope))
    }
}

impl<F: Field + ?Sized> Obstacle for FieldObstacle<F> {
    /// Where the field is flat, an arbitrary direction and one `detail`: there is no surface near.
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        let Some((depth, inward)) = self.look(p) else {
            let is_inside = self.field.value(self.field_from_world.transform_point3(p)) > self.iso;
            return (if is_inside { -self.detail } else { self.detail }, DVec3::Z);
        };
        // Into the tangent plane at x: x' = p − ((p − x)·n + e) n, e the depth at x.
        let (mut s, mut n) = (depth, inward);
        for _ in 0..STEPS {
            let x = p - s * n;
            let Some((depth, inward)) = self.look(x) else {
                break;
            };
            let next = (p - x).dot(inward) + depth;
            let step = (next * inward - s * n).length();
            // Away from all that is near, or to the other side: the plane at hand says no more.
            if step > 0.5 * s.abs() + SETTLED * self.detail || (next > 0.0) != (s > 0.0) {
                break;
            }
            (s, n) = (next, inward);
            if step <= SETTLED * self.detail {
                break;
            }
        }
        (-s, -n)
    }

    fn finest(&self) -> f64 {
        0.25 * self.detail
    }
}
