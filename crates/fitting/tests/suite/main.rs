//! Fits of clouds, meshes, volumes and fields. One binary: each file of its own would be linked with all that is tested.

mod common;
mod field;
mod hard_clouds;
mod mesh;
mod meshes_that_go_wrong;
mod orient;
mod points;
mod points_that_go_wrong;
mod volume;
mod volumes_that_go_wrong;
