//! Point clouds in, with the normals that a fit needs, and out.

mod cloud;
#[cfg(feature = "lidar")]
mod e57;
#[cfg(feature = "lidar")]
mod las;
mod normals;
pub(crate) mod obj;
mod part;
pub(crate) mod pcd;
pub(crate) mod ply;
mod revise;
mod save;
mod xyz;

use std::path::Path;

pub use cloud::{NormalSource, PointCloud};
#[cfg(feature = "lidar")]
pub use e57::parse_e57;
#[cfg(feature = "lidar")]
pub use las::parse_las;
pub use obj::parse_obj;
pub use part::{CloudPart, read_part};
pub use pcd::parse_pcd;
pub use ply::parse_ply;
pub use revise::{CloudChanges, Placed, save_revised};
pub use save::save;
pub use xyz::parse_xyz;

use crate::detect::kind_of;
use crate::kind::{CLOUDS, Kind, PointFormat};
use crate::limits::Budget;
use crate::raw::Wanted;
use crate::{Fault, FormatError, ReadLimits, input, meshes};

/// Reads a cloud; the format is told by content first, then by name, and `.gz` by its content.
///
/// # Errors
/// Every [`Fault`] of reading: see the parsers of the single formats.
pub fn read(path: &Path, limits: &ReadLimits) -> Result<PointCloud, FormatError> {
    read_faulty(path, limits).map_err(|fault| fault.at(path))
}

fn read_faulty(path: &Path, limits: &ReadLimits) -> Result<PointCloud, Fault> {
    let mut budget = Budget::new(limits);
    let bytes = input::open(path)?.read_all(&mut budget)?;
    read_bytes(&bytes, path, &mut budget)
}

/// Reads the bytes of a file with this name.
fn read_bytes(bytes: &[u8], path: &Path, budget: &mut Budget) -> Result<PointCloud, Fault> {
    let raw = match kind_of(bytes, path)? {
        Kind::Cloud(PointFormat::Ply) => ply::parse(bytes, Wanted::Cloud, budget),
        Kind::Cloud(PointFormat::Xyz) => xyz::parse(bytes, budget),
        Kind::Cloud(PointFormat::Pcd) => pcd::parse(bytes, budget),
        #[cfg(feature = "lidar")]
        Kind::Cloud(PointFormat::Las) => las::parse(bytes, budget),
        #[cfg(feature = "lidar")]
        Kind::Cloud(PointFormat::E57) => e57::parse(bytes, budget),
        #[cfg(not(feature = "lidar"))]
        kind @ Kind::Cloud(PointFormat::Las | PointFormat::E57) => Err(Fault::left_out(kind, "lidar")),
        Kind::Cloud(PointFormat::Obj) => obj::parse(bytes, Wanted::Cloud, budget),
        Kind::Mesh(format) => meshes::parse(bytes, format, path, budget),
        other => Err(Fault::UnknownKind {
            found: format!("a {other}"),
            purpose: "point cloud",
            supported: CLOUDS,
        }),
    }?;
    normals::finish(raw, budget)
}
