//! From raw faces to a mesh that can be worked on: what is left out is counted.

use glam::DVec3;

use super::mesh::Mesh;
use crate::limits::Budget;
use crate::raw::RawShape;
use crate::{Fault, Unit};

/// A triangle mesh as it was read; nothing is said about whether it is closed, oriented or free of crossings.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    /// Finite positions, each used by a triangle, in the order of the file.
    pub vertices: Vec<DVec3>,
    /// Three different vertices each, counted from 0, in the order of the file.
    pub triangles: Vec<[u32; 3]>,
    /// Red, green, blue of each vertex, where the file has them at the vertices.
    pub colors: Option<Vec<[u8; 3]>>,
    /// Unit of the vertices: millimetres where the file names any, otherwise unknown.
    pub unit: Unit,
    /// Faces in the file, of any number of corners, kept or not.
    pub face_count: usize,
    /// Faces of fewer than three different corners; they were left out.
    pub degenerate_faces: usize,
    /// Faces with a corner that is NaN or infinite; they were left out.
    pub invalid_faces: usize,
    /// Vertices that no kept triangle uses; they were left out.
    pub unused_vertices: usize,
    /// Repairs and doubts, each a sentence with its figures.
    pub notes: Vec<String>,
}

impl TriangleMesh {
    /// The mesh as the writers take it.
    pub fn as_mesh(&self) -> Mesh<'_> {
        Mesh {
            vertices: &self.vertices,
            triangles: &self.triangles,
            colors: self.colors.as_deref(),
            unit: self.unit,
        }
    }

    /// States the unit of the file and converts the vertices to millimetres.
    ///
    /// # Errors
    /// [`Fault::Value`] if `stated` is [`Unit::Unknown`] or the mesh already is in a known unit.
    pub fn to_mm(&mut self, stated: Unit) -> Result<(), Fault> {
        let scale = stated.scale_for("mesh", self.unit)?;
        for v in &mut self.vertices {
            *v *= scale;
        }
        self.unit = Unit::Millimetre;
        Ok(())
    }
}

/// Cleans `raw`.
///
/// # Errors
/// [`Fault::Value`] if no triangle is left.
pub(super) fn finish(raw: RawShape, budget: &mut Budget) -> Result<TriangleMesh, Fault> {
    let RawShape {
        mut positions,
        mut colors,
        mut triangles,
        face_count,
        short_faces,
        unit,
        notes,
        ..
    } = raw;
    let vertex_count = positions.len();
    let triangle_count = triangles.len();
    let (mut degenerate_faces, mut invalid_faces) = (short_faces, 0);
    triangles.retain(|t| {
        let is_degenerate = t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
        let is_invalid = t.iter().any(|v| !positions[*v as usize].is_finite());
        degenerate_faces += usize::from(is_degenerate);
        invalid_faces += usize::from(is_invalid && !is_degenerate);
        !is_degenerate && !is_invalid
    });
    if triangles.is_empty() {
        return Err(Fault::Value {
            what: "the number of usable triangles",
            value: format!("0 of {triangle_count} of {face_count} faces, with {vertex_count} vertices"),
            remedy: "a mesh needs faces; a file of points alone is read as a cloud",
        });
    }
    budget.reserve("vertex numbers", vertex_count as u64, size_of::<u32>())?;
    let mut number = vec![u32::MAX; vertex_count];
    for v in triangles.iter().flatten() {
        number[*v as usize] = 0;
    }
    let mut kept = 0;
    for v in 0..vertex_count {
        if number[v] == 0 {
            number[v] = kept;
            positions[kept as usize] = positions[v];
            if let Some(c) = &mut colors {
                c[kept as usize] = c[v];
            }
            kept += 1;
        }
    }
    positions.truncate(kept as usize);
    if let Some(c) = &mut colors {
        c.truncate(kept as usize);
    }
    for v in triangles.iter_mut().flatten() {
        *v = number[*v as usize];
    }
    let mut mesh = TriangleMesh {
        unused_vertices: vertex_count - positions.len(),
        vertices: positions,
        triangles,
        colors,
        unit,
        face_count,
        degenerate_faces,
        invalid_faces,
        notes,
    };
    note_repairs(&mut mesh, vertex_count);
    Ok(mesh)
}

fn note_repairs(mesh: &mut TriangleMesh, vertex_count: usize) {
    for (count, whole, what) in [
        (
            mesh.invalid_faces,
            mesh.face_count,
            "faces have a corner that is NaN or infinite",
        ),
        (
            mesh.degenerate_faces,
            mesh.face_count,
            "faces have fewer than three different corners",
        ),
        (mesh.unused_vertices, vertex_count, "vertices are used by no face"),
    ] {
        if count > 0 {
            mesh.notes.push(format!("{count} of {whole} {what}; left out"));
        }
    }
}
