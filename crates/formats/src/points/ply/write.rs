//! Binary little-endian PLY.

use std::io::{self, Write};
use std::path::Path;

use glam::DVec3;

use crate::file_name::{extension, is_gz_name};
use crate::meshes::mesh::{CHUNK, Mesh, needs_double, spill};
use crate::{Fault, FormatError, atomic};

/// Writes points with an optional colour each as binary PLY, atomically.
///
/// # Errors
/// [`Fault::UnknownKind`] if the name does not end in `.ply`, I/O.
///
/// # Panics
/// If the colours are not one a point.
pub fn save_points(
    path: &Path,
    points: &[DVec3],
    normals: Option<&[DVec3]>,
    colors: Option<&[[u8; 3]]>,
) -> Result<(), FormatError> {
    if extension(path) != "ply" || is_gz_name(path) {
        let found = path
            .extension()
            .map(|e| format!(".{}", e.to_string_lossy()))
            .unwrap_or_default();
        return Err(Fault::UnknownKind {
            found,
            purpose: "point output",
            supported: ".ply",
        }
        .at(path));
    }
    let double = needs_double(points);
    atomic::replace(path, |out| write_points(out, points, normals, colors, double))
}

/// [`save_points`] to a stream, with coordinates of double precision or not.
pub(crate) fn write_points(
    out: &mut dyn Write,
    points: &[DVec3],
    normals: Option<&[DVec3]>,
    colors: Option<&[[u8; 3]]>,
    double: bool,
) -> io::Result<()> {
    write_vertices(out, points, normals, colors, double, None)
}

pub(crate) fn write(out: &mut dyn Write, mesh: &Mesh) -> io::Result<()> {
    let double = needs_double(mesh.vertices);
    write_vertices(
        out,
        mesh.vertices,
        None,
        mesh.colors,
        double,
        Some(mesh.triangles.len()),
    )?;
    let mut bytes = Vec::with_capacity(CHUNK + 16);
    for t in mesh.triangles {
        let mut row = [3; 13];
        row[1..5].copy_from_slice(&t[0].to_le_bytes());
        row[5..9].copy_from_slice(&t[1].to_le_bytes());
        row[9..13].copy_from_slice(&t[2].to_le_bytes());
        bytes.extend_from_slice(&row);
        spill(out, &mut bytes)?;
    }
    out.write_all(&bytes)
}

fn write_vertices(
    out: &mut dyn Write,
    points: &[DVec3],
    normals: Option<&[DVec3]>,
    colors: Option<&[[u8; 3]]>,
    double: bool,
    faces: Option<usize>,
) -> io::Result<()> {
    assert!(
        normals.is_none_or(|n| n.len() == points.len()),
        "one normal per point"
    );
    assert!(
        colors.is_none_or(|c| c.len() == points.len()),
        "one colour per point"
    );
    let kind = if double { "double" } else { "float" };
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\ncomment isoclay\nelement vertex {}\n",
        points.len()
    )?;
    write!(out, "property {kind} x\nproperty {kind} y\nproperty {kind} z\n")?;
    if normals.is_some() {
        write!(out, "property float nx\nproperty float ny\nproperty float nz\n")?;
    }
    if colors.is_some() {
        write!(
            out,
            "property uchar red\nproperty uchar green\nproperty uchar blue\n"
        )?;
    }
    if let Some(n) = faces {
        write!(out, "element face {n}\nproperty list uchar int vertex_indices\n")?;
    }
    writeln!(out, "end_header")?;
    let mut bytes = Vec::with_capacity(CHUNK + 64);
    for (i, p) in points.iter().enumerate() {
        for x in p.to_array() {
            if double {
                bytes.extend_from_slice(&x.to_le_bytes());
            } else {
                bytes.extend_from_slice(&(x as f32).to_le_bytes());
            }
        }
        if let Some(n) = normals {
            for x in n[i].to_array() {
                bytes.extend_from_slice(&(x as f32).to_le_bytes());
            }
        }
        if let Some(c) = colors {
            bytes.extend_from_slice(&c[i]);
        }
        spill(out, &mut bytes)?;
    }
    out.write_all(&bytes)
}
