//! Meshes in and out, and coloured points out.

#[cfg(feature = "cad")]
pub(crate) mod gltf;
pub(crate) mod mesh;
mod read;
mod stl;
#[cfg(feature = "cad")]
pub(crate) mod threemf;
mod triangle_mesh;
#[cfg(feature = "cad")]
pub(crate) mod vrml;
mod weld;

use std::io::{self, Write};
use std::path::Path;

pub use mesh::Mesh;
pub(crate) use mesh::{needs_double, rounding_to_single};
pub(crate) use read::parse;
#[cfg(feature = "cad")]
pub use read::{parse_gltf, parse_threemf, parse_vrml};
pub use read::{parse_stl, read};
pub use triangle_mesh::TriangleMesh;

use crate::file_name::{extension, is_gz_name};
pub use crate::points::ply::save_points;
use crate::points::{obj, ply};
use crate::{Fault, FormatError, Unit, atomic};

/// Formats of meshes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshFormat {
    /// Binary little-endian PLY: `float x y z`, `list uchar int vertex_indices`.
    Ply,
    /// Binary STL: single precision, a normal a triangle, no shared vertices.
    Stl,
    /// Wavefront OBJ: text.
    Obj,
    /// Binary glTF 2.0: single precision about an origin, in metres.
    Glb,
    /// glTF 2.0 as text, with the same content in base64.
    Gltf,
    /// 3MF: text in a zip package, with the unit.
    ThreeMf,
    /// VRML97: text.
    Vrml,
}

impl MeshFormat {
    /// The format that a file name asks for.
    ///
    /// # Errors
    /// [`Fault::UnknownKind`] with what is supported.
    pub fn from_path(path: &Path) -> Result<Self, FormatError> {
        let extension = if is_gz_name(path) {
            "gz".into()
        } else {
            extension(path)
        };
        match extension.as_str() {
            "ply" => Ok(Self::Ply),
            "stl" => Ok(Self::Stl),
            "obj" => Ok(Self::Obj),
            "glb" => Ok(Self::Glb),
            "gltf" => Ok(Self::Gltf),
            "3mf" => Ok(Self::ThreeMf),
            "wrl" => Ok(Self::Vrml),
            other => Err(Fault::UnknownKind {
                found: if other.is_empty() {
                    "a name without an extension".into()
                } else {
                    format!(".{other}")
                },
                purpose: "mesh output",
                supported: ".ply, .stl, .obj, .glb, .gltf, .3mf and .wrl",
            }
            .at(path)),
        }
    }
}

/// Writes a mesh in the format of its name, atomically.
///
/// Coordinates are single precision, unless that would move vertices by more than a millionth of the mesh's
/// diagonal (a small thing far from the origin): then PLY says `double`, the text formats print all digits and the
/// node of a glTF file holds the offset. STL has single precision alone. The returned notes say what the format
/// cannot hold. glTF is in metres, 3MF names the unit.
///
/// # Errors
/// [`Fault::UnknownKind`], [`Fault::Output`] for more triangles than the format counts, I/O.
///
/// # Panics
/// If an index is out of range or the colours are not one a vertex.
pub fn save(path: &Path, mesh: &Mesh) -> Result<Vec<String>, FormatError> {
    let format = MeshFormat::from_path(path)?;
    // The counts of PLY, STL and the lengths of a binary glTF container.
    #[cfg(feature = "cad")]
    let is_too_long = format == MeshFormat::Glb && gltf::buffer_bytes(mesh) > u64::from(u32::MAX) - 4096;
    #[cfg(not(feature = "cad"))]
    let is_too_long = false;
    #[cfg(not(feature = "cad"))]
    if !matches!(format, MeshFormat::Ply | MeshFormat::Stl | MeshFormat::Obj) {
        return Err(Fault::left_out("a mesh of this format", "cad").at(path));
    }
    if mesh.vertices.len() > i32::MAX as usize || mesh.triangles.len() > u32::MAX as usize || is_too_long {
        return Err(Fault::Output {
            what: "a mesh",
            value: format!(
                "{} vertices and {} triangles",
                mesh.vertices.len(),
                mesh.triangles.len()
            ),
            remedy: "mesh at a lower resolution",
        }
        .at(path));
    }
    atomic::replace(path, |out| write(out, mesh, format))?;
    let mut notes = Vec::new();
    if needs_double(mesh.vertices) {
        notes.push(match format {
            MeshFormat::Stl => "the mesh lies far from the origin for its size; STL rounds it visibly, \
                                the other formats keep it"
                .into(),
            MeshFormat::Glb | MeshFormat::Gltf => {
                "the mesh lies far from the origin for its size; its node holds the \
                                offset in double precision"
                    .into()
            }
            _ => "the mesh lies far from the origin for its size; written in double precision".to_owned(),
        });
    }
    let taken_for = match format {
        MeshFormat::Glb | MeshFormat::Gltf => "metres",
        MeshFormat::ThreeMf => "millimetres",
        _ => "",
    };
    if mesh.unit == Unit::Unknown && !taken_for.is_empty() {
        notes.push(format!(
            "the unit of the mesh is not known; the file's numbers mean {taken_for}"
        ));
    }
    if mesh.colors.is_some() && !matches!(format, MeshFormat::Ply | MeshFormat::Glb | MeshFormat::Gltf) {
        notes.push("the colours were left out; PLY and glTF keep them".into());
    }
    Ok(notes)
}

/// Writes a mesh to a stream: see [`save`].
///
/// # Errors
/// I/O.
///
/// # Panics
/// As [`save`].
pub fn write(out: &mut dyn Write, mesh: &Mesh, format: MeshFormat) -> io::Result<()> {
    let count = mesh.vertices.len();
    let largest = mesh.triangles.iter().flatten().copied().max();
    assert!(
        largest.is_none_or(|v| (v as usize) < count),
        "vertex index {largest:?} with {count} vertices"
    );
    assert!(
        mesh.colors.is_none_or(|c| c.len() == count),
        "one colour per vertex"
    );
    match format {
        MeshFormat::Ply => ply::write(out, mesh),
        MeshFormat::Stl => stl::write(out, mesh),
        MeshFormat::Obj => obj::write(out, mesh),
        #[cfg(feature = "cad")]
        MeshFormat::Glb => gltf::write_binary(out, mesh),
        #[cfg(feature = "cad")]
        MeshFormat::Gltf => gltf::write_text(out, mesh),
        #[cfg(feature = "cad")]
        MeshFormat::ThreeMf => threemf::write(out, mesh),
        #[cfg(feature = "cad")]
        MeshFormat::Vrml => vrml::write(out, mesh),
        #[cfg(not(feature = "cad"))]
        _ => Err(io::ErrorKind::Unsupported.into()),
    }
}

#[cfg(test)]
mod read_tests;
#[cfg(test)]
mod tests;
