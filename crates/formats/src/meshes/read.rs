//! Meshes in: one function for any file, and one for the bytes of each format.

use std::path::Path;

use super::stl;
use super::triangle_mesh::{TriangleMesh, finish};
#[cfg(feature = "cad")]
use super::{gltf, threemf, vrml};
use crate::detect::kind_of;
use crate::kind::{Kind, MESHES, MeshFileFormat, PointFormat};
use crate::limits::Budget;
use crate::raw::{RawShape, Wanted};
use crate::{Fault, FormatError, ReadLimits, input, points};

/// Reads a mesh; the format is told by content first, then by name, and `.gz` by its content.
///
/// Polygons are cut into triangles. Corners of STL at the same place become one vertex.
///
/// # Errors
/// Every [`Fault`] of reading; [`Fault::Value`] for a file without any face.
pub fn read(path: &Path, limits: &ReadLimits) -> Result<TriangleMesh, FormatError> {
    read_faulty(path, limits).map_err(|fault| fault.at(path))
}

fn read_faulty(path: &Path, limits: &ReadLimits) -> Result<TriangleMesh, Fault> {
    let mut budget = Budget::new(limits);
    let bytes = input::open(path)?.read_all(&mut budget)?;
    let budget = &mut budget;
    let raw = match kind_of(&bytes, path)? {
        Kind::Cloud(PointFormat::Ply) => points::ply::parse(&bytes, Wanted::Mesh, budget),
        Kind::Cloud(PointFormat::Obj) => points::obj::parse(&bytes, Wanted::Mesh, budget),
        Kind::Mesh(format) => parse(&bytes, format, path, budget),
        other => Err(Fault::UnknownKind {
            found: format!("a {other}"),
            purpose: "mesh",
            supported: MESHES,
        }),
    }?;
    finish(raw, budget)
}

/// Parses a file that can only be a mesh.
#[cfg_attr(
    not(feature = "cad"),
    allow(unused_variables, reason = "only formats of this family name other files")
)]
pub(crate) fn parse(
    bytes: &[u8],
    format: MeshFileFormat,
    path: &Path,
    budget: &mut Budget,
) -> Result<RawShape, Fault> {
    match format {
        MeshFileFormat::Stl => stl::parse(bytes, budget),
        #[cfg(not(feature = "cad"))]
        other => Err(Fault::left_out(Kind::Mesh(other), "cad")),
        #[cfg(feature = "cad")]
        MeshFileFormat::Gltf => gltf::parse(bytes, Some(path), budget),
        #[cfg(feature = "cad")]
        MeshFileFormat::ThreeMf => threemf::parse(bytes, budget),
        #[cfg(feature = "cad")]
        MeshFileFormat::Vrml => vrml::parse(bytes, Some(path), budget),
    }
}

/// Reads the bytes of a glTF file, binary or text, whose buffers are in it.
///
/// # Errors
/// A [`Fault`] naming the node or accessor that contradicts the rest, a part that ends too early, or something
/// that is not read (sparse accessors, compressed buffers).
#[cfg(feature = "cad")]
pub fn parse_gltf(bytes: &[u8], limits: &ReadLimits) -> Result<TriangleMesh, Fault> {
    let mut budget = Budget::new(limits);
    finish(gltf::parse(bytes, None, &mut budget)?, &mut budget)
}

/// Reads the bytes of a 3MF package.
///
/// # Errors
/// A [`Fault`] with the byte of the XML, the object or the part of the package that does not hold, components of
/// themselves or without end, a required extension that is not read.
#[cfg(feature = "cad")]
pub fn parse_threemf(bytes: &[u8], limits: &ReadLimits) -> Result<TriangleMesh, Fault> {
    let mut budget = Budget::new(limits);
    finish(threemf::parse(bytes, &mut budget)?, &mut budget)
}

/// Reads the text of a VRML97 file; files that it inlines are left out with a note.
///
/// # Errors
/// A [`Fault`] with the line for text that breaks the format, an index beyond the points, nodes too deep or too
/// many, a file of VRML 1.0.
#[cfg(feature = "cad")]
pub fn parse_vrml(bytes: &[u8], limits: &ReadLimits) -> Result<TriangleMesh, Fault> {
    let mut budget = Budget::new(limits);
    finish(vrml::parse(bytes, None, &mut budget)?, &mut budget)
}

/// Reads the bytes of an STL file, ascii or binary.
///
/// # Errors
/// A [`Fault`] with the line for text that is no STL, a length that is not the count's, no usable triangle.
pub fn parse_stl(bytes: &[u8], limits: &ReadLimits) -> Result<TriangleMesh, Fault> {
    let mut budget = Budget::new(limits);
    finish(stl::parse(bytes, &mut budget)?, &mut budget)
}
