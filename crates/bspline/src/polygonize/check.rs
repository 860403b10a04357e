//! What is right and wrong with a triangle mesh.

use glam::DVec3;
use rayon::prelude::*;

use super::Mesh;
use crate::Aabb;

/// Topology and size of a mesh.
///
/// Triangles that repeat a vertex or name one that does not exist are counted and otherwise left out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MeshCheck {
    /// Vertices stored.
    pub vertices: u64,
    /// Triangles stored.
    pub triangles: u64,
    /// Vertices that no triangle uses.
    pub unused_vertices: u64,
    /// Vertices with a coordinate that is infinite or not a number.
    pub non_finite_vertices: u64,
    /// Vertices at the very place of another (each beyond the first counts).
    pub duplicate_vertices: u64,
    /// Triangles that name a vertex that does not exist.
    pub invalid_triangles: u64,
    /// Triangles with a repeated vertex or without area.
    pub degenerate_triangles: u64,
    /// Triangles with the same three vertices as another (each beyond the first counts).
    pub duplicate_triangles: u64,
    /// Edges, each counted once.
    pub edges: u64,
    /// Edges with one triangle.
    pub boundary_edges: u64,
    /// Edges with three triangles or more.
    pub non_manifold_edges: u64,
    /// Edges whose two triangles run along them in the same direction.
    pub misoriented_edges: u64,
    /// Vertices whose triangles do not form one fan, open or closed.
    pub non_manifold_vertices: u64,
    /// Connected components (connected through vertices).
    pub components: u64,
    /// Vertices in use - edges + triangles.
    pub euler_characteristic: i64,
    /// Sum of the triangles' areas.
    pub area: f64,
    /// Volume enclosed, positive where normals point outward; of meaning for closed meshes only.
    pub volume: f64,
    /// Smallest box round all vertices, `None` without vertices.
    pub bounding_box: Option<Aabb>,
}

impl MeshCheck {
    /// Whether every edge has two triangles at least; true for a mesh without triangles.
    pub fn is_closed(&self) -> bool {
        self.boundary_edges == 0
    }

    /// Whether the mesh is an oriented 2-manifold, possibly with border, of finite vertices, each in use and at its
    /// own place, without degenerate or duplicate triangles.
    pub fn is_manifold(&self) -> bool {
        let faults = [
            self.unused_vertices,
            self.non_finite_vertices,
            self.duplicate_vertices,
            self.invalid_triangles,
            self.degenerate_triangles,
            self.duplicate_triangles,
            self.non_manifold_edges,
            self.misoriented_edges,
            self.non_manifold_vertices,
        ];
        faults.iter().all(|&n| n == 0)
    }

    /// [`Self::is_closed`] and [`Self::is_manifold`].
    pub fn is_closed_manifold(&self) -> bool {
        self.is_closed() && self.is_manifold()
    }
}

/// Checks a mesh; time and memory in proportion to its size, about 0.15 µs per triangle.
pub fn check_mesh(mesh: &Mesh) -> MeshCheck {
    let vertex_count = mesh.positions.len();
    let mut check = MeshCheck {
        vertices: vertex_count as u64,
        triangles: mesh.triangles.len() as u64,
        bounding_box: mesh.bounding_box(),
        non_finite_vertices: mesh.positions.iter().filter(|p| !p.is_finite()).count() as u64,
        duplicate_vertices: duplicate_positions(&mesh.positions),
        ..MeshCheck::default()
    };
    let mut sound = Vec::with_capacity(mesh.triangles.len());
    let center = check.bounding_box.map_or(DVec3::ZERO, |b| b.center());
    for &t in &mesh.triangles {
        if t.iter().any(|&v| v as usize >= vertex_count) {
            check.invalid_triangles += 1;
            continue;
        }
        let [a, b, c] = t.map(|v| mesh.positions[v as usize] - center);
        let normal = (b - a).cross(c - a);
        let repeats = t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
        if repeats || normal == DVec3::ZERO {
            check.degenerate_triangles += 1;
        }
        if !repeats {
            sound.push(t);
            check.area += normal.length() / 2.0;
            check.volume += a.dot(b.cross(c)) / 6.0;
        }
    }

    let corners = CornerTable::new(vertex_count, &sound);
    let faults = (0..vertex_count as u32)
        .into_par_iter()
        .with_min_len(1 << 12)
        .fold(
            || (Faults::default(), Link::default()),
            |(mut faults, mut link), vertex| {
                link.inspect(vertex, corners.of(vertex), &mut faults);
                (faults, link)
            },
        )
        .map(|(faults, _)| faults)
        .reduce(Faults::default, Faults::plus);
    check.unused_vertices = faults.unused;
    check.duplicate_triangles = faults.duplicate_triangles;
    check.edges = faults.edges;
    check.boundary_edges = faults.boundary_edges;
    check.non_manifold_edges = faults.non_manifold_edges;
    check.misoriented_edges = faults.misoriented_edges;
    check.non_manifold_vertices = faults.non_manifold_vertices;
    let used = vertex_count as u64 - faults.unused;
    check.euler_characteristic = used as i64 - faults.edges as i64 + sound.len() as i64;
    check.components = components(vertex_count, &sound) - faults.unused;
    check
}

/// For each vertex `v` the pairs `(a, b)` of all triangles `(v, a, b)`.
struct CornerTable {
    first: Vec<usize>,
    pairs: Vec<[u32; 2]>,
}

impl CornerTable {
    fn new(vertex_count: usize, triangles: &[[u32; 3]]) -> Self {
        let mut first = vec![0; vertex_count + 1];
        for &v in triangles.as_flattened() {
            first[v as usize + 1] += 1;
        }
        for v in 0..vertex_count {
            first[v + 1] += first[v];
        }
        let mut next = first.clone();
        let mut pairs = vec![[0; 2]; 3 * triangles.len()];
        for &[a, b, c] in triangles {
            for (v, pair) in [(a, [b, c]), (b, [c, a]), (c, [a, b])] {
                pairs[next[v as usize]] = pair;
                next[v as usize] += 1;
            }
        }
        Self { first, pairs }
    }

    fn of(&self, vertex: u32) -> &[[u32; 2]] {
        &self.pairs[self.first[vertex as usize]..self.first[vertex as usize + 1]]
    }
}

#[derive(Clone, Copy, Default)]
struct Faults {
    unused: u64,
    duplicate_triangles: u64,
    edges: u64,
    boundary_edges: u64,
    non_manifold_edges: u64,
    misoriented_edges: u64,
    non_manifold_vertices: u64,
}

impl Faults {
    fn plus(self, o: Self) -> Self {
        Self {
            unused: self.unused + o.unused,
            duplicate_triangles: self.duplicate_triangles + o.duplicate_triangles,
            edges: self.edges + o.edges,
            boundary_edges: self.boundary_edges + o.boundary_edges,
            non_manifold_edges: self.non_manifold_edges + o.non_manifold_edges,
            misoriented_edges: self.misoriented_edges + o.misoriented_edges,
            non_manifold_vertices: self.non_manifold_vertices + o.non_manifold_vertices,
        }
    }
}

/// The link of a vertex: its neighbours, joined by the opposite sides of its triangles. Buffers are reused.
#[derive(Default)]
struct Link {
    /// Neighbour, and whether the half-edge runs from it to the vertex.
    ends: Vec<(u32, bool)>,
    neighbours: Vec<u32>,
    parent: Vec<u32>,
    opposite: Vec<[u32; 2]>,
}

impl Link {
    fn inspect(&mut self, vertex: u32, pairs: &[[u32; 2]], faults: &mut Faults) {
        if pairs.is_empty() {
            faults.unused += 1;
            return;
        }
        self.ends.clear();
        self.ends
            .extend(pairs.iter().flat_map(|&[a, b]| [(a, false), (b, true)]));
        self.ends.sort_unstable();
        self.neighbours.clear();
        let mut is_fan = true;
        for same in self.ends.chunk_by(|a, b| a.0 == b.0) {
            let neighbour = same[0].0;
            self.neighbours.push(neighbour);
            is_fan &= same.len() <= 2;
            // Each edge is judged at its smaller vertex.
            if vertex < neighbour {
                faults.edges += 1;
                match same {
                    [_] => faults.boundary_edges += 1,
                    [a, b] => faults.misoriented_edges += (a.1 == b.1) as u64,
                    _ => faults.non_manifold_edges += 1,
                }
            }
        }

        // At most two sides at each neighbour and all connected: the link is one path or one cycle.
        let count = self.neighbours.len();
        self.parent.clear();
        self.parent.extend(0..count as u32);
        let mut parts = count;
        for pair in pairs {
            let [a, b] = pair.map(|w| {
                let at = self.neighbours.binary_search(&w).expect("collected above");
                root(&mut self.parent, at as u32)
            });
            if a != b {
                self.parent[a.max(b) as usize] = a.min(b);
                parts -= 1;
            }
        }
        faults.non_manifold_vertices += (!is_fan || parts != 1) as u64;

        self.opposite.clear();
        self.opposite.extend(
            pairs
                .iter()
                .filter(|p| vertex < p[0] && vertex < p[1])
                .map(|&[a, b]| [a.min(b), a.max(b)]),
        );
        self.opposite.sort_unstable();
        faults.duplicate_triangles += self.opposite.windows(2).filter(|w| w[0] == w[1]).count() as u64;
    }
}

/// Representative of a set in a union-find forest, halving the path.
fn root(parent: &mut [u32], mut v: u32) -> u32 {
    while parent[v as usize] != v {
        let up = parent[parent[v as usize] as usize];
        parent[v as usize] = up;
        v = up;
    }
    v
}

/// Connected components, a vertex without triangles being one of its own.
fn components(vertex_count: usize, triangles: &[[u32; 3]]) -> u64 {
    let mut parent: Vec<u32> = (0..vertex_count as u32).collect();
    let mut count = vertex_count as u64;
    for &[a, b, c] in triangles {
        for (v, w) in [(a, b), (b, c)] {
            let (v, w) = (root(&mut parent, v), root(&mut parent, w));
            if v != w {
                parent[v.max(w) as usize] = v.min(w);
                count -= 1;
            }
        }
    }
    count
}

/// Vertices at the same place as one before them in sorted order.
fn duplicate_positions(positions: &[DVec3]) -> u64 {
    // Adding 0 makes both zeros one.
    let mut keys: Vec<[u64; 3]> = positions
        .iter()
        .map(|p| (*p + DVec3::ZERO).to_array().map(f64::to_bits))
        .collect();
    keys.par_sort_unstable();
    keys.windows(2).filter(|w| w[0] == w[1]).count() as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(positions: &[[f64; 3]], triangles: &[[u32; 3]]) -> Mesh {
        Mesh {
            positions: positions.iter().map(|&p| p.into()).collect(),
            normals: Vec::new(),
            triangles: triangles.to_vec(),
        }
    }

    const CORNERS: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    const TETRAHEDRON: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

    #[test]
    fn a_tetrahedron_is_a_closed_manifold() {
        let c = check_mesh(&mesh(&CORNERS, &TETRAHEDRON));
        assert!(c.is_closed_manifold(), "{c:?}");
        assert_eq!((c.edges, c.components, c.euler_characteristic), (6, 1, 2));
        assert!((c.volume - 1.0 / 6.0).abs() < 1e-15);
        assert!((c.area - (1.5 + 3f64.sqrt() / 2.0)).abs() < 1e-14);
        assert_eq!(
            c.bounding_box,
            Some(Aabb {
                min: DVec3::ZERO,
                max: DVec3::ONE
            })
        );
    }

    #[test]
    fn an_empty_mesh_is_closed_and_has_no_box() {
        let c = check_mesh(&Mesh::default());
        assert!(c.is_closed_manifold() && c.bounding_box.is_none() && c.components == 0);
    }

    #[test]
    fn each_fault_is_found_and_only_it() {
        let hole = check_mesh(&mesh(&CORNERS, &TETRAHEDRON[..3]));
        assert!(!hole.is_closed() && hole.is_manifold() && hole.boundary_edges == 3);

        let mut triangles = TETRAHEDRON.to_vec();
        triangles[3].swap(0, 1);
        let turned = check_mesh(&mesh(&CORNERS, &triangles));
        assert!(turned.is_closed() && turned.misoriented_edges == 3 && turned.non_manifold_vertices == 0);

        let mut triangles = TETRAHEDRON.to_vec();
        triangles.push([2, 3, 1]);
        let twice = check_mesh(&mesh(&CORNERS, &triangles));
        assert_eq!((twice.duplicate_triangles, twice.non_manifold_edges), (1, 3));

        let mut triangles = TETRAHEDRON.to_vec();
        triangles.extend([[1, 1, 2], [0, 1, 9]]);
        let odd = check_mesh(&mesh(&CORNERS, &triangles));
        assert_eq!((odd.degenerate_triangles, odd.invalid_triangles), (1, 1));
        assert!(odd.is_closed() && !odd.is_manifold() && odd.euler_characteristic == 2);

        let mut corners = CORNERS.to_vec();
        corners.extend([[-0.0, 1.0, 0.0], [f64::NAN, 0.0, 0.0]]);
        let extra = check_mesh(&mesh(&corners, &TETRAHEDRON));
        assert_eq!(
            (
                extra.unused_vertices,
                extra.duplicate_vertices,
                extra.non_finite_vertices
            ),
            (2, 1, 1)
        );
        assert_eq!((extra.components, extra.euler_characteristic), (1, 2));
        let flat = check_mesh(&mesh(&[[0.0; 3], [1.0; 3], [2.0; 3]], &[[0, 1, 2]]));
        assert_eq!((flat.degenerate_triangles, flat.boundary_edges), (1, 3));
    }

    #[test]
    fn two_solids_that_touch_are_not_manifold() {
        // A second tetrahedron on the first one's vertex 3.
        let mut corners = CORNERS.to_vec();
        corners.extend([[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0]]);
        let other = |map: [u32; 4]| TETRAHEDRON.map(|t| t.map(|v| map[v as usize]));
        let mut triangles = TETRAHEDRON.to_vec();
        triangles.extend(other([4, 6, 5, 3]));
        let point = check_mesh(&mesh(&corners, &triangles));
        assert!(point.is_closed() && point.non_manifold_vertices == 1 && point.non_manifold_edges == 0);
        assert_eq!(point.components, 1);
        assert!((point.volume - 2.0 / 6.0).abs() < 1e-14);

        // And one on its edge 2-3: four triangles there.
        let mut corners = CORNERS.to_vec();
        corners.extend([[-1.0, 1.0, 1.0], [-1.0, 2.0, 1.0]]);
        let mut triangles = TETRAHEDRON.to_vec();
        triangles.extend(other([2, 3, 4, 5]));
        let edge = check_mesh(&mesh(&corners, &triangles));
        assert!(
            edge.is_closed() && edge.non_manifold_edges == 1 && edge.non_manifold_vertices == 2,
            "{edge:?}"
        );
    }

    #[test]
    fn components_and_genus_are_counted() {
        // A torus of 7 vertices: the smallest there is.
        let positions: Vec<[f64; 3]> = (0..7)
            .map(|n| [n as f64, (n * n) as f64, (n * n * n) as f64])
            .collect();
        let torus: Vec<[u32; 3]> = (0..7)
            .flat_map(|i| [[i, (i + 1) % 7, (i + 3) % 7], [i, (i + 3) % 7, (i + 2) % 7]])
            .collect();
        let c = check_mesh(&mesh(&positions, &torus));
        assert!(
            c.is_closed() && c.non_manifold_vertices == 0 && c.misoriented_edges == 0,
            "{c:?}"
        );
        assert_eq!((c.euler_characteristic, c.components), (0, 1));
    }
}
