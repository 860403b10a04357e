//! The `isoclay` program.
fn main() {}
