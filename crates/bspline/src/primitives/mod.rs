//! Solids with a formula: signed distances where there is one, smooth phantoms otherwise.
//!
//! All are positive inside. The distances are Euclidean, so `|∇f| = 1` wherever the nearest surface point is
//! unique. Where it is not (the medial axis) the gradient is that of one of the nearest points, named by each
//! type, or zero, and the Hessian leaves out the jump. Bounds come from the formula; they are exact for the
//! sphere, the box and the half-space, and right to first order in the size of the box for all.

mod axis;
mod capsule;
mod cuboid;
mod cylinder;
mod gyroid;
mod half_space;
mod pierced_tetrahedron;
mod range;
mod sphere;
mod torus;
mod turn;

pub use capsule::Capsule;
pub use cuboid::Cuboid;
pub use cylinder::Cylinder;
pub use gyroid::Gyroid;
pub use half_space::HalfSpace;
pub use pierced_tetrahedron::PiercedTetrahedron;
pub use sphere::Sphere;
pub use torus::Torus;

use glam::DVec3;

use crate::{Aabb, Field, Frame, Interval, Jet};

/// Why a solid cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PrimitiveError {
    /// A coordinate or length is NaN or infinite.
    #[error("{name} is {value}; it has to be finite")]
    NotFinite {
        /// Name of the parameter.
        name: &'static str,
        /// Value given.
        value: f64,
    },
    /// A length is zero or negative.
    #[error("{name} is {value}; it has to be positive")]
    NotPositive {
        /// Name of the parameter.
        name: &'static str,
        /// Value given.
        value: f64,
    },
    /// A direction has no length, or two points that give one coincide.
    #[error("{name} has length {length}, which gives no direction")]
    NoDirection {
        /// Name of the parameter.
        name: &'static str,
        /// Its length.
        length: f64,
    },
    /// The tube of a torus closes its hole.
    #[error("the tube's radius {minor} has to be less than the ring's radius {major}")]
    ClosedTorus {
        /// Radius of the ring.
        major: f64,
        /// Radius of the tube.
        minor: f64,
    },
    /// A level at which the solid is empty or everything.
    #[error("level {level} is not between {low} and {high}")]
    Level {
        /// Level given.
        level: f64,
        /// Least that makes sense.
        low: f64,
        /// Largest that makes sense.
        high: f64,
    },
}

/// What bounds the gradient of every distance: its length is at most 1.
fn unit_gradient() -> [Interval; 3] {
    crate::vectors::ball(1.0 + 8.0 * f64::EPSILON)
}

fn finite(name: &'static str, v: DVec3) -> Result<DVec3, PrimitiveError> {
    match v.to_array().into_iter().find(|x| !x.is_finite()) {
        Some(value) => Err(PrimitiveError::NotFinite { name, value }),
        None => Ok(v),
    }
}

fn positive(name: &'static str, value: f64) -> Result<f64, PrimitiveError> {
    if !value.is_finite() {
        return Err(PrimitiveError::NotFinite { name, value });
    }
    if value <= 0.0 {
        Err(PrimitiveError::NotPositive { name, value })
    } else {
        Ok(value)
    }
}

/// Any of the solids, for whoever has to store one.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "each variant is the type it holds")]
pub enum Primitive {
    Sphere(Sphere),
    Cuboid(Cuboid),
    Cylinder(Cylinder),
    Capsule(Capsule),
    Torus(Torus),
    HalfSpace(HalfSpace),
    Gyroid(Gyroid),
    PiercedTetrahedron(PiercedTetrahedron),
}

macro_rules! delegate {
    ($($kind:ident),*) => {
        $(impl From<$kind> for Primitive {
            fn from(solid: $kind) -> Self {
                Self::$kind(solid)
            }
        })*

        impl Primitive {
            fn field(&self) -> &dyn Field {
                match self { $(Self::$kind(solid) => solid,)* }
            }
        }
    };
}
delegate!(
    Sphere,
    Cuboid,
    Cylinder,
    Capsule,
    Torus,
    HalfSpace,
    Gyroid,
    PiercedTetrahedron
);

impl Field for Primitive {
    fn value(&self, p: DVec3) -> f64 {
        self.field().value(p)
    }
    fn value_gradient(&self, p: DVec3) -> (f64, DVec3) {
        self.field().value_gradient(p)
    }
    fn jet(&self, p: DVec3) -> Jet {
        self.field().jet(p)
    }
    fn bounds(&self, b: &Aabb) -> Interval {
        self.field().bounds(b)
    }
    fn gradient_bounds(&self, b: &Aabb) -> [Interval; 3] {
        self.field().gradient_bounds(b)
    }
    fn hessian_bound(&self, b: &Aabb) -> f64 {
        self.field().hessian_bound(b)
    }
    fn values_gradients(&self, points: &[DVec3], out: &mut [(f64, DVec3)]) {
        self.field().values_gradients(points, out);
    }
    fn frame_values(&self, frame: &Frame, lo: [i64; 3], count: [usize; 3], out: &mut [f64]) {
        self.field().frame_values(frame, lo, count, out);
    }
    fn frame_bounds(&self, frame: &Frame, lo: [i64; 3], hi: [i64; 3]) -> Interval {
        self.field().frame_bounds(frame, lo, hi)
    }
}
