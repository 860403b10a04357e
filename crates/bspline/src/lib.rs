//! Fields made of trivariate B-splines: what a field is and how to ask it.
//!
//! A field `f` is a scalar density over space; the solid it stands for is `{ x : f(x) > c }`, the outward
//! normal `-∇f/|∇f|`. Every field answers value, gradient, Hessian, and a sound interval over a box
//! ([`Field`]).
//!
//! | type | what |
//! | --- | --- |
//! | [`HierarchicalSpline`] | dyadic levels of cubic B-splines, refined where the data is: what a fit gives |
//! | [`TensorSpline`] | one block of B-splines on three knot vectors, degrees 1 to 5; insertion of knots |
//! | [`Primitive`] | spheres, boxes, cylinders and other formulas |
//! | [`Csg`] | sharp and smooth Boolean operations, affine placement, sums, growth by a length |
//!
//! [`polygonize`] makes triangles of any of them, and follows changes of a field.
//!
//! Index order is `(x, y, z)` with `z` fastest in memory, everywhere in this crate.

mod any_field;
mod banded;
pub mod basis;
pub mod csg;
pub mod cubic;
mod field;
pub mod hierarchical;
pub mod insertion;
mod interval;
pub mod knots;
#[cfg(target_arch = "x86_64")]
pub mod pair;
mod placed_box;
pub mod polygonize;
pub mod primitives;
mod real;
pub mod restrict;
pub mod tensor;
mod vectorized;

pub use any_field::AnyField;
pub use banded::BandedRows;
pub use basis::Basis;
pub use csg::{Csg, CsgError};
pub use field::{Aabb, Field, Frame, Jet};
pub use hierarchical::HierarchicalSpline;
pub use interval::Interval;
pub(crate) use interval::vectors;
pub use knots::{KnotError, KnotVector};
pub use primitives::{Primitive, PrimitiveError};
pub use real::Real;
pub use tensor::{TensorError, TensorSpline};
pub use vectorized::vectorized;
