//! Constraints on the densities of a patch: springs that pull, and equations that hold.
//!
//! A constraint is a row `r` on the free coefficients, `r·p = c`. A *constraint spring* has the energy
//! `½k(σ(r·p - c))²` and joins the forces and the matrix of a step as a term of rank one [Hua04 §6.3]. A *hard* constraint
//! [Hua04 eq. 14, `Ld + b = 0`] is held by every step. The paper eliminates variables, which works for well-chosen pivots only;
//! here the rows are made orthonormal with pivoting, which drops the ones that others imply and refuses those that
//! contradict them, and conjugate gradients run in the null space of the rest.

mod constraint;
mod held;
mod hold;
mod independent;

pub use constraint::{Constraint, ConstraintError, Hold, On, curve};
pub(crate) use held::Held;
