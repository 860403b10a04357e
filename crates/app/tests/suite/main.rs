//! The program, run as a user would. One binary: each file of its own would be linked with all that is tested.

mod command_line;
mod common;
mod convert;
mod dicom;
mod dynamics_charts;
mod failures;
mod licences;
mod phantoms;
mod real_data;
mod simulate;
mod unoriented;
