use bspline::polygonize::{Mesh, check_mesh, self_intersections};
use serde::Serialize;

use super::quantity::{human_count, human_number};

/// What those mind who print a mesh or compute on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct MeshQuality {
    /// Connected pieces of the surface.
    pub pieces: u64,
    /// Edges with one triangle.
    pub open_edges: u64,
    /// Edges of more than two triangles, or of two that face opposite ways, and vertices of more than one fan.
    pub faults: u64,
    /// Pairs of triangles that pass through each other.
    pub self_intersections: u64,
    /// Smallest angles of the triangles, in degrees: median and first percentile.
    pub smallest_angle_median: f64,
    pub smallest_angle_p1: f64,
    /// Area, in the unit of the mesh squared.
    pub area: f64,
    /// Volume enclosed, in the unit of the mesh cubed; none of an open mesh.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume: Option<f64>,
}

impl MeshQuality {
    /// Checks a mesh.
    pub fn of(mesh: &Mesh) -> Self {
        let check = check_mesh(mesh);
        let mut angles: Vec<f64> = (0..mesh.triangles.len())
            .map(|t| smallest_angle(mesh, t))
            .collect();
        let mut rank = |share: f64| {
            let n = (share * angles.len() as f64) as usize;
            if angles.is_empty() {
                return 0.0;
            }
            *angles.select_nth_unstable_by(n, f64::total_cmp).1
        };
        Self {
            pieces: check.components,
            open_edges: check.boundary_edges,
            faults: check.non_manifold_edges + check.misoriented_edges + check.non_manifold_vertices,
            self_intersections: self_intersections(mesh),
            smallest_angle_median: rank(0.5),
            smallest_angle_p1: rank(0.01),
            area: check.area,
            volume: check.is_closed().then_some(check.volume),
        }
    }

    /// For people.
    pub fn rows(&self) -> [(&'static str, Option<String>); 7] {
        let count = |n: u64| Some(human_count(n as usize));
        [
            ("pieces", count(self.pieces)),
            ("open edges", count(self.open_edges)),
            ("faulty edges and vertices", count(self.faults)),
            ("triangles through each other", count(self.self_intersections)),
            (
                "smallest angle",
                Some(format!(
                    "median {:.1}°, 1 % below {:.1}°",
                    self.smallest_angle_median, self.smallest_angle_p1
                )),
            ),
            ("area", Some(human_number(self.area))),
            ("volume", self.volume.map(human_number)),
        ]
    }
}

/// In degrees.
fn smallest_angle(mesh: &Mesh, triangle: usize) -> f64 {
    let [a, b, c] = mesh.corners(triangle);
    let angle = |p: glam::DVec3, q: glam::DVec3, r: glam::DVec3| {
        let (u, v) = (q - p, r - p);
        libm::atan2(u.cross(v).length(), u.dot(v))
    };
    angle(a, b, c)
        .min(angle(b, c, a))
        .min(angle(c, a, b))
        .to_degrees()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn a_tetrahedron_through_another_is_told() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        let mut mesh = Mesh::default();
        for shift in [0.0, 0.1] {
            let first = mesh.positions.len() as u32;
            mesh.positions
                .extend(corners.map(|p| p + shift * DVec3::new(1.0, 1.3, 0.7)));
            mesh.triangles.extend(faces.map(|t| t.map(|v| v + first)));
        }
        let quality = MeshQuality::of(&mesh);
        assert_eq!((quality.pieces, quality.open_edges, quality.faults), (2, 0, 0));
        assert!(quality.self_intersections > 0);
        assert!((quality.volume.expect("closed") - 1.0 / 3.0).abs() < 1e-12);
        assert!((quality.smallest_angle_p1 - 45.0).abs() < 1e-9 && quality.smallest_angle_median < 61.0);
        mesh.triangles.pop();
        assert_eq!(MeshQuality::of(&mesh).volume, None);
    }
}
