//! A mesh to be written, and what its writers share.

use std::io::{self, Write};

use glam::DVec3;

use crate::Unit;

/// A triangle mesh to be written; triangles are counterclockwise seen from outside.
#[derive(Clone, Copy, Debug)]
pub struct Mesh<'a> {
    /// Positions in world space.
    pub vertices: &'a [DVec3],
    /// Indices of the corners, from 0.
    pub triangles: &'a [[u32; 3]],
    /// Red, green, blue of each vertex; kept by PLY and glTF.
    pub colors: Option<&'a [[u8; 3]]>,
    /// Unit of the positions.
    pub unit: Unit,
}

/// Whether rounding to `f32` moves a vertex by more than a millionth of the diagonal.
pub(crate) fn needs_double(vertices: &[DVec3]) -> bool {
    let Some(first) = vertices.first() else {
        return false;
    };
    let (min, max) = vertices
        .iter()
        .fold((*first, *first), |(lo, hi), v| (lo.min(*v), hi.max(*v)));
    let furthest = min.abs().max(max.abs()).max_element();
    furthest * f64::from(f32::EPSILON) * 0.5 > 1e-6 * (max - min).length()
}

/// Furthest that rounding to `f32` moves a coordinate.
pub(crate) fn rounding_to_single(points: &[DVec3]) -> f64 {
    points
        .iter()
        .map(|p| (*p - p.as_vec3().as_dvec3()).abs().max_element())
        .fold(0.0, f64::max)
}

/// Bytes gathered before they are handed on.
pub(crate) const CHUNK: usize = 1 << 16;

/// Hands `bytes` on once there are enough.
pub(crate) fn spill(out: &mut dyn Write, bytes: &mut Vec<u8>) -> io::Result<()> {
    if bytes.len() >= CHUNK {
        out.write_all(bytes)?;
        bytes.clear();
    }
    Ok(())
}
