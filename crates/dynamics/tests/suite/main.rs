//! All tests of the crate from outside, in one program: each further one would compile the solvers once more.

mod analytic;
mod bunny;
mod choice;
mod common;
mod constraints;
mod increment;
mod lattice;
mod masked;
mod motion;
mod paint;
mod plasticity;
mod region;
mod replay;
mod response;
mod solve;
mod sparse;
mod springs;
mod stability;
mod tensor_region;
