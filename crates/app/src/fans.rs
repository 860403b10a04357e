//! Vertices where parts of a surface touch in a point alone: rims leave some, and no manifold has any.

use bspline::polygonize::Mesh;
use rayon::prelude::*;

/// Gives each fan of triangles round a vertex a vertex of its own, at the same place.
///
/// Triangles are of one fan if they share an edge at the vertex. The vertex itself stays with the fan of the first of its
/// triangles.
pub fn split(mesh: &mut Mesh) {
    let mut fans = Fans::new(3 * mesh.triangles.len());
    let mut edges: Vec<(u64, u32)> = (mesh.triangles.par_iter().enumerate())
        .flat_map_iter(|(t, corners)| {
            (0..3).map(move |i| {
                let (a, b) = (corners[i], corners[(i + 1) % 3]);
                (
                    u64::from(a.min(b)) << 32 | u64::from(a.max(b)),
                    (3 * t + i) as u32,
                )
            })
        })
        .collect();
    edges.par_sort_unstable();
    let ends = |edge: u32| {
        let (t, i) = (edge / 3, edge % 3);
        let [a, b] = [3 * t + i, 3 * t + (i + 1) % 3];
        if mesh.triangles[t as usize][i as usize] < mesh.triangles[t as usize][(i as usize + 1) % 3] {
            [a, b]
        } else {
            [b, a]
        }
    };
    for pair in edges.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
        for (a, b) in ends(pair[0].1).into_iter().zip(ends(pair[1].1)) {
            fans.join(a, b);
        }
    }
    // The fan that each vertex stays with, and the vertices of the others.
    let mut owner = vec![u32::MAX; mesh.positions.len()];
    let mut vertex_of = vec![u32::MAX; 3 * mesh.triangles.len()];
    for corner in 0..vertex_of.len() as u32 {
        let fan = fans.root(corner);
        let slot = &mut mesh.triangles[corner as usize / 3][corner as usize % 3];
        let first = &mut owner[*slot as usize];
        if *first == u32::MAX {
            *first = fan;
        }
        if *first == fan {
            continue;
        }
        let own = &mut vertex_of[fan as usize];
        if *own == u32::MAX {
            *own = mesh.positions.len() as u32;
            mesh.positions.push(mesh.positions[*slot as usize]);
        }
        *slot = *own;
    }
}

/// Sets of corners, by union and find.
struct Fans(Vec<u32>);

impl Fans {
    fn new(count: usize) -> Self {
        Self((0..count as u32).collect())
    }

    fn root(&mut self, mut c: u32) -> u32 {
        while self.0[c as usize] != c {
            let above = self.0[self.0[c as usize] as usize];
            self.0[c as usize] = above;
            c = above;
        }
        c
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// Two squares of two triangles that touch in the corner 3 alone, and a third that shares an edge with the first.
    #[test]
    fn parts_that_touch_in_a_point_come_apart_there_alone() {
        let at = |x: i32, y: i32| DVec3::new(f64::from(x), f64::from(y), 0.0);
        let mut mesh = Mesh {
            positions: [(0, 0), (1, 0), (0, 1), (1, 1), (2, 1), (1, 2), (2, 2), (2, 0)]
                .map(|(x, y)| at(x, y))
                .to_vec(),
            normals: Vec::new(),
            triangles: vec![[0, 1, 2], [1, 3, 2], [3, 4, 5], [4, 6, 5]],
        };
        let places: Vec<_> = (0..4).map(|t| mesh.corners(t)).collect();
        split(&mut mesh);
        assert_eq!(mesh.triangles, [[0, 1, 2], [1, 3, 2], [8, 4, 5], [4, 6, 5]]);
        assert_eq!((0..4).map(|t| mesh.corners(t)).collect::<Vec<_>>(), places);
        // With a bridge between the two there is one fan, and nothing to split.
        mesh.triangles = vec![[0, 1, 2], [1, 3, 2], [3, 4, 5], [4, 6, 5], [1, 7, 3], [3, 7, 4]];
        let before = mesh.triangles.clone();
        split(&mut mesh);
        assert_eq!((mesh.triangles, mesh.positions.len()), (before, 9));
    }
}
