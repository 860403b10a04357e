//! Splines, fields of trees, and what polygonizes them. One binary: each file of its own would be linked with all that is tested.

mod basis;
mod blends;
mod common;
mod csg;
mod edits;
mod hierarchical;
mod local;
mod polygonize;
mod primitives;
mod remesh;
mod restrict;
mod tensor;
