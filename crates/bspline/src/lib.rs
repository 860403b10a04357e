//! Fields made of trivariate B-splines: what a field is and how to ask it.
//!
//! A field `f` is a scalar density over space; the solid it stands for is `{ x : f(x) > c }`, the outward
//! normal `-∇f/|∇f|`. Every field answers value, gradient, Hessian, and a sound interval over a box
//! ([`Field`]).
//!
//! Index order is `(x, y, z)` with `z` fastest in memory, everywhere in this crate.

mod banded;
pub mod basis;
pub mod csg;
pub mod cubic;
mod field;
pub mod hierarchical;
pub mod insertion;
mod interval;
pub mod knots;
mod placed_box;
pub mod polygonize;
pub mod primitives;
mod real;
pub mod restrict;
pub mod tensor;

pub use banded::BandedRows;
pub use basis::Basis;
pub use csg::{Csg, CsgError};
pub use field::{Aabb, Field, Frame, Jet};
pub use hierarchical::HierarchicalSpline;
pub use interval::Interval;
pub use knots::{KnotError, KnotVector};
pub use primitives::{Primitive, PrimitiveError};
pub use real::Real;
pub use tensor::{TensorError, TensorSpline};
