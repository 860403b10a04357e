//! One block of B-splines on three knot vectors of its own, anywhere in space [Hua04 eqs. 1 and 3].
//!
//! ```
//! use bspline::{Field, KnotVector, TensorSpline};
//! use glam::{DAffine3, DVec3};
//!
//! // Degree 3 along x on knots of one's choice, degrees 2 and 1 on uniform ones.
//! let x = KnotVector::new(3, vec![0.0, 0.0, 0.0, 0.0, 0.2, 0.7, 1.0, 1.0, 1.0, 1.0])?;
//! let y = KnotVector::clamped_uniform(2, 4, 0.0, 1.0)?;
//! let z = KnotVector::uniform(1, 3, 0.0, 1.0)?;
//! let knots = [x, y, z];
//! // Coefficients at the Greville abscissae reproduce linear functions.
//! let place = |ijk: [usize; 3]| TensorSpline::<f64>::greville(&knots, ijk);
//! let coefficients = TensorSpline::<f64>::indices(&knots).map(|ijk| place(ijk).dot(DVec3::new(1.0, 2.0, 3.0)));
//! let f = TensorSpline::new(knots.clone(), coefficients.collect(), DAffine3::IDENTITY, 1.0)?;
//! assert!((f.value(DVec3::splat(0.5)) - 3.0).abs() < 1e-14);
//! let finer = f.insert_knot(0, 0.5)?;
//! assert!((finer.value(DVec3::splat(0.3)) - 1.8).abs() < 1e-14);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod bounds;
mod difference;
mod evaluate;
mod grid;
mod identity;
mod kernel;
mod refine;
mod spline;

pub use difference::{TensorDiff, TensorDiffError};
pub use spline::{TensorError, TensorSpline};
