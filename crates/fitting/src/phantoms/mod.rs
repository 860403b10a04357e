//! Inputs of known shape and noise, made by formula: for tests, benchmarks and charts.

mod head;
mod random;

pub use head::head;
pub use random::Random;
