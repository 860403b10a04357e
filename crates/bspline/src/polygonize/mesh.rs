use glam::DVec3;

use crate::Aabb;

/// A triangle mesh in world coordinates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions.
    pub positions: Vec<DVec3>,
    /// Outward unit normals, one a vertex; empty unless asked for.
    pub normals: Vec<DVec3>,
    /// Vertex indices, counter-clockwise seen from outside the solid.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Corner positions of triangle `index`.
    #[inline]
    pub fn corners(&self, index: usize) -> [DVec3; 3] {
        let ([a, b, c], p) = (self.triangles[index], &self.positions);
        [p[a as usize], p[b as usize], p[c as usize]]
    }

    /// Smallest box round all vertices, `None` without vertices.
    pub fn bounding_box(&self) -> Option<Aabb> {
        let first = *self.positions.first()?;
        let (min, max) = self
            .positions
            .iter()
            .fold((first, first), |(lo, hi), &p| (lo.min(p), hi.max(p)));
        Some(Aabb { min, max })
    }
}
