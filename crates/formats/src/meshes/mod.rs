//! Meshes and coloured points out: PLY, STL and OBJ.

mod obj;
mod ply;
mod stl;

use std::io::{self, Write};
use std::path::Path;

use glam::DVec3;

pub use ply::save_points;

use crate::{Fault, FormatError, atomic, detect};

/// A triangle mesh to be written; triangles are counterclockwise seen from outside.
#[derive(Clone, Copy, Debug)]
pub struct Mesh<'a> {
    /// Positions in world space.
    pub vertices: &'a [DVec3],
    /// Indices of the corners, from 0.
    pub triangles: &'a [[u32; 3]],
    /// Red, green, blue of each vertex; kept by PLY alone.
    pub colors: Option<&'a [[u8; 3]]>,
}

/// Formats of meshes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshFormat {
    /// Binary little-endian PLY: `float x y z`, `list uchar int vertex_indices`.
    Ply,
    /// Binary STL: single precision, a normal a triangle, no shared vertices.
    Stl,
    /// Wavefront OBJ: text.
    Obj,
}

impl MeshFormat {
    /// The format that a file name asks for.
    ///
    /// # Errors
    /// [`Fault::UnknownKind`] with what is supported.
    pub fn from_path(path: &Path) -> Result<Self, FormatError> {
        let extension = if detect::is_gz_name(path) {
            "gz".into()
        } else {
            detect::extension(path)
        };
        match extension.as_str() {
            "ply" => Ok(Self::Ply),
            "stl" => Ok(Self::Stl),
            "obj" => Ok(Self::Obj),
            other => Err(Fault::UnknownKind {
                found: if other.is_empty() {
                    "a name without an extension".into()
                } else {
                    format!(".{other}")
                },
                purpose: "mesh output",
                supported: ".ply, .stl and .obj",
            }
            .at(path)),
        }
    }
}

/// Writes a mesh in the format of its name, atomically.
///
/// Coordinates are single precision, unless that would move vertices by more than a millionth of the mesh's
/// diagonal (a small thing far from the origin): then PLY says `double` and OBJ prints all digits. STL has
/// single precision alone; the returned notes say when that hurts.
///
/// # Errors
/// [`Fault::UnknownKind`], [`Fault::Output`] for more triangles than the format counts, I/O.
///
/// # Panics
/// If an index is out of range or the colours are not one a vertex.
pub fn save(path: &Path, mesh: &Mesh) -> Result<Vec<String>, FormatError> {
    let format = MeshFormat::from_path(path)?;
    if mesh.vertices.len() > i32::MAX as usize || mesh.triangles.len() > u32::MAX as usize {
        let value = format!(
            "{} vertices and {} triangles",
            mesh.vertices.len(),
            mesh.triangles.len()
        );
        let remedy = "mesh at a lower resolution";
        return Err(Fault::Output {
            what: "a mesh",
            value,
            remedy,
        }
        .at(path));
    }
    atomic::replace(path, |out| write(out, mesh, format))?;
    let mut notes = Vec::new();
    if needs_double(mesh.vertices) {
        notes.push(match format {
            MeshFormat::Stl => "the mesh lies far from the origin for its size; STL rounds it visibly, \
                                PLY and OBJ keep it"
                .into(),
            _ => "the mesh lies far from the origin for its size; written in double precision".to_owned(),
        });
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
    }
}

/// Whether rounding to `f32` moves a vertex by more than a millionth of the diagonal.
fn needs_double(vertices: &[DVec3]) -> bool {
    let Some(first) = vertices.first() else {
        return false;
    };
    let (min, max) = vertices
        .iter()
        .fold((*first, *first), |(lo, hi), v| (lo.min(*v), hi.max(*v)));
    let furthest = min.abs().max(max.abs()).max_element();
    furthest * f64::from(f32::EPSILON) * 0.5 > 1e-6 * (max - min).length()
}

/// Bytes gathered before they are handed on.
const CHUNK: usize = 1 << 16;

/// Hands `bytes` on once there are enough.
fn spill(out: &mut dyn Write, bytes: &mut Vec<u8>) -> io::Result<()> {
    if bytes.len() >= CHUNK {
        out.write_all(bytes)?;
        bytes.clear();
    }
    Ok(())
}

#[cfg(test)]
mod tests;
