//! Painted materials and loads on which the solvers are judged, and the judgement: the error of the increment.

mod patterns;

pub use patterns::{Pattern, loads, spring_weights};
