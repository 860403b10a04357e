//! Normals at the edges and corners of a surface, which tell its two sides.
//!
//! Where the nearest point is on an edge or a corner, the angle-weighted mean of the normals there tells inside from
//! outside \[Baerentzen05\].

use glam::DVec3;

use super::nearest::Feature;
use super::topology::{Faces, area_vector};
use super::tree::TriangleTree;

/// No triangle beyond that edge, or more than one.
const NONE: u32 = u32::MAX;

/// Neighbours of the triangles of a tree, and normals of its corners.
///
/// Only whole triangles of the mesh that cross no other are known here: of them alone it is known what lies beside them.
pub(crate) struct Normals {
    /// Beyond the edges from the first to the second corner, from there to the third, and back.
    beyond: Vec<[u32; 3]>,
    /// Vertices of each triangle; [`NONE`] of one that is not known.
    corners: Vec<[u32; 3]>,
    /// Of each vertex; zero where the triangles round it are no single fan of known ones.
    vertices: Vec<DVec3>,
}

impl Normals {
    /// `face_of` is the face of each triangle of the tree, if it is known; `used` are all faces that count.
    pub fn new(
        faces: &Faces,
        tree: &TriangleTree,
        used: &[u32],
        face_of: impl Fn(u32) -> Option<u32>,
    ) -> Self {
        let mut place = vec![NONE; faces.corners.len()];
        let corners: Vec<[u32; 3]> = tree
            .ids
            .iter()
            .zip(0..)
            .map(|(&id, t)| match face_of(id) {
                Some(face) => {
                    place[face as usize] = t;
                    faces.corners[face as usize]
                }
                None => [NONE; 3],
            })
            .collect();
        let mut beyond = vec![[NONE; 3]; corners.len()];
        for edge in faces.sides().chunk_by(|a, b| a.0 == b.0) {
            let [a, b] = edge else { continue };
            let [s, t] = [a, b].map(|side| place[side.1 as usize]);
            if a.2 == b.2 || s == NONE || t == NONE {
                continue;
            }
            for (from, side, to) in [(s, a, t), (t, b, s)] {
                let ends = [(side.0 >> 32) as u32, side.0 as u32];
                let start = if side.2 { ends[0] } else { ends[1] };
                let k = corners[from as usize].iter().position(|&v| v == start);
                beyond[from as usize][k.expect("a side starts at a corner")] = to;
            }
        }
        let mut out = Self {
            beyond,
            corners,
            vertices: vec![DVec3::ZERO; faces.vertices.len()],
        };
        out.weigh(tree);
        // What else meets at a vertex may be surface too.
        for face in used.iter().map(|&f| f as usize).filter(|&f| place[f] == NONE) {
            faces.corners[face]
                .iter()
                .for_each(|&v| out.vertices[v as usize] = DVec3::ZERO);
        }
        out
    }

    /// Sums the normals of each vertex.
    fn weigh(&mut self, tree: &TriangleTree) {
        let mut round = vec![0u32; self.vertices.len()];
        let mut first = vec![NONE; self.vertices.len()];
        for (t, ids) in self.corners.iter().enumerate().filter(|(_, ids)| ids[0] != NONE) {
            let points = &tree.corners[t];
            let normal = area_vector(points).normalize_or_zero();
            for k in 0..3 {
                let [p, q, r] = [k, (k + 1) % 3, (k + 2) % 3].map(|k| points[k]);
                let (a, b) = (q - p, r - p);
                let angle = libm::atan2(a.cross(b).length(), a.dot(b));
                self.vertices[ids[k] as usize] += normal * angle;
                round[ids[k] as usize] += 1;
                first[ids[k] as usize] = t as u32;
            }
        }
        for v in 0..self.vertices.len() {
            if first[v] != NONE && self.fan(v as u32, first[v], round[v]) != Some(round[v]) {
                self.vertices[v] = DVec3::ZERO;
            }
        }
    }

    /// Triangles passed on the way round vertex `v` from triangle `first` back to it, if it is one.
    fn fan(&self, v: u32, first: u32, most: u32) -> Option<u32> {
        let mut t = first;
        for count in 1..=most {
            let k = self.corners[t as usize].iter().position(|&c| c == v)?;
            t = self.beyond[t as usize][k];
            if t == NONE {
                return None;
            }
            if t == first {
                return Some(count);
            }
        }
        None
    }

    /// A vector that points outwards at a place of triangle `t`, if the surface has two sides there for sure.
    pub fn at(&self, tree: &TriangleTree, t: u32, feature: Feature) -> Option<DVec3> {
        if self.corners[t as usize][0] == NONE {
            return None;
        }
        let unit = |t: u32| area_vector(&tree.corners[t as usize]).normalize_or_zero();
        let normal = match feature {
            Feature::Inner => unit(t),
            Feature::Edge(k) => match self.beyond[t as usize][k as usize] {
                NONE => return None,
                other => unit(t) + unit(other),
            },
            Feature::Corner(k) => self.vertices[self.corners[t as usize][k as usize] as usize],
        };
        // Sheets that fold back on themselves have none.
        (normal.length_squared() > 1e-6).then_some(normal)
    }
}
