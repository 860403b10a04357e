//! No code: its manifest turns on what some dependency of some artefact asks for, in all of them.
//!
//! Cargo builds a crate once for each set of features. The program, its tests and the Python package have most crates in common; with the
//! same features everywhere these are built once, else three times. `one_set_of_features` in `crates/app/tests/suite/licences.rs` tells what
//! is missing here.
