//! Files in and out: point clouds, volumes, meshes, and the native file of a fitted field.
//!
//! # What is read and written
//! | what | read | written |
//! | --- | --- | --- |
//! | points | PLY (ascii, binary of both endians), PCD (ascii, binary, compressed), LAS, LAZ, E57, XYZ, OBJ; each also gzipped; the vertices of any mesh | PLY, PCD, LAS, LAZ, E57, XYZ |
//! | volumes | NIfTI-1 and -2, NRRD, MetaImage, TIFF stacks, raw voxels, gzipped or not; DICOM series | NIfTI-1, NRRD, MetaImage, VTK ImageData |
//! | meshes | PLY, OBJ, STL (ascii, binary), glTF 2.0 (.gltf, .glb), 3MF, VRML97; each also gzipped | PLY, OBJ, STL, glTF 2.0 (.gltf, .glb), 3MF, VRML97 |
//! | fields | the native file, `docs/format.md` | the same |
//!
//! # Conventions
//! Coordinates are `f64` in world space: for images RAS, in millimetres where the file names its unit, otherwise
//! in the file's own unit, which the result records ([`Unit::Unknown`]). A volume keeps the order of its file:
//! `values[x + nx·(y + ny·z)]`, **x fastest**; a field keeps the order of `bspline`, z fastest.
//!
//! Every reader takes [`ReadLimits`] and holds no more bytes than those allow, whatever a header promises.
//! Every writer goes through [`atomic`]: a target is either the old file or the whole new one.
//!
//! Formats come in families, each a feature of the crate, all on by default: `medical` (DICOM, NIfTI, NRRD, MetaImage),
//! `lidar` (LAS, LAZ, E57) and `cad` (glTF, 3MF, VRML). PLY, OBJ, STL, PCD, XYZ, TIFF, VTK, raw voxels and fields are
//! always there. A file of a family that was left out is refused by name.
//!
//! ```
//! use formats::{ReadLimits, points};
//! let ply = b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
//!             property float z\nend_header\n1 2 3\n";
//! let cloud = points::parse_ply(ply, &ReadLimits::default()).unwrap();
//! assert_eq!(cloud.positions[0].to_array(), [1.0, 2.0, 3.0]);
//! ```
//!
//! # What it cannot do
//! No RGB or complex voxels, one volume of a time series at a time, no textures or materials of meshes. Of a volume, [`volumes`]
//! says more.

// What several families share has fewer users in a build without some of them.
#![cfg_attr(
    not(all(feature = "medical", feature = "lidar", feature = "cad")),
    allow(
        dead_code,
        unused_imports,
        reason = "shared by families that this build leaves out"
    )
)]

pub mod atomic;
mod detect;
mod error;
pub mod field;
mod file_name;
#[cfg(any(feature = "medical", feature = "lidar"))]
mod guard;
mod input;
mod kind;
mod limits;
pub mod meshes;
mod neighbour;
pub mod points;
mod polygon;
mod raw;
mod text;
mod unit;
pub mod volumes;

pub use detect::detect;
pub use error::{Choice, Fault, FormatError};
pub use kind::{Kind, MeshFileFormat, PointFormat};
pub use limits::ReadLimits;
pub use unit::Unit;
