//! The connected parts of a mesh, their volumes, and which of them are cavities of which.

use bspline::polygonize::Mesh;
use glam::DVec3;
use rayon::prelude::*;

/// A connected part of a mesh.
#[derive(Clone, Debug)]
pub struct Part {
    /// Enclosed volume, world units cubed; below 0 where the normals point inwards. An open part is closed by cones
    /// to the middle of its rims.
    pub volume: f64,
    /// Number of its triangles.
    pub triangle_count: usize,
    /// Whether it has a rim.
    pub is_open: bool,
    /// For a cavity, the part that holds the solid around it.
    pub owner: Option<usize>,
    first_triangle: usize,
}

/// A mesh taken apart.
pub struct Pieces {
    /// Parts, in the order of their first triangles.
    pub parts: Vec<Part>,
    /// The part of each triangle.
    pub part_of: Vec<u32>,
}

impl Pieces {
    /// Takes `mesh` apart at vertices that no triangles share.
    pub fn of(mesh: &Mesh) -> Self {
        let mut pieces = connected(mesh);
        let rims = rims(mesh, &pieces);
        let origins: Vec<DVec3> = (pieces.parts.iter().zip(&rims))
            .map(|(part, rim)| rim.unwrap_or(mesh.corners(part.first_triangle)[0]))
            .collect();
        for (t, &part) in pieces.part_of.iter().enumerate() {
            let [a, b, c] = mesh.corners(t).map(|p| p - origins[part as usize]);
            pieces.parts[part as usize].volume += a.dot(b.cross(c)) / 6.0;
        }
        for (part, rim) in pieces.parts.iter_mut().zip(&rims) {
            part.is_open = rim.is_some();
        }
        find_owners(mesh, &mut pieces);
        pieces
    }
}

/// How many parts are narrower than `width` on every axis, and for each triangle whether it belongs to one; none if there is
/// no other.
pub fn of_narrow_parts(mesh: &Mesh, width: f64) -> (usize, Vec<bool>) {
    let pieces = connected(mesh);
    let mut boxes = vec![(DVec3::INFINITY, DVec3::NEG_INFINITY); pieces.parts.len()];
    if boxes.len() > 1 {
        for (t, &part) in pieces.part_of.iter().enumerate() {
            let (low, high) = &mut boxes[part as usize];
            for p in mesh.corners(t) {
                (*low, *high) = (low.min(p), high.max(p));
            }
        }
    }
    let is_narrow = |(low, high): &(DVec3, DVec3)| (*high - *low).max_element() < width;
    let mut narrow: Vec<bool> = boxes.iter().map(is_narrow).collect();
    if !narrow.contains(&false) {
        narrow.fill(false);
    }
    let count = narrow.iter().filter(|n| **n).count();
    (
        count,
        pieces.part_of.iter().map(|&p| narrow[p as usize]).collect(),
    )
}

/// Parts by union and find over the vertices, smaller numbers as roots.
fn connected(mesh: &Mesh) -> Pieces {
    let mut parent: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    fn root(parent: &mut [u32], mut v: u32) -> u32 {
        while parent[v as usize] != v {
            let above = parent[parent[v as usize] as usize];
            parent[v as usize] = above;
            v = above;
        }
        v
    }
    for &[a, b, c] in &mesh.triangles {
        for (p, q) in [(a, b), (b, c)] {
            let (p, q) = (root(&mut parent, p), root(&mut parent, q));
            parent[p.max(q) as usize] = p.min(q);
        }
    }
    let mut number = vec![u32::MAX; mesh.positions.len()];
    let mut parts: Vec<Part> = Vec::new();
    let part_of = (mesh.triangles.iter().enumerate())
        .map(|(t, corners)| {
            let slot = &mut number[root(&mut parent, corners[0]) as usize];
            if *slot == u32::MAX {
                *slot = parts.len() as u32;
                parts.push(Part {
                    volume: 0.0,
                    triangle_count: 0,
                    is_open: false,
                    owner: None,
                    first_triangle: t,
                });
            }
            parts[*slot as usize].triangle_count += 1;
            *slot
        })
        .collect();
    Pieces { parts, part_of }
}

/// Middle of the vertices on the rims of each part: those of edges without a neighbour.
fn rims(mesh: &Mesh, pieces: &Pieces) -> Vec<Option<DVec3>> {
    // Both directions of an edge under one key, with the triangle to find its part again.
    let mut edges: Vec<(u64, u32)> = (mesh.triangles.par_iter().enumerate())
        .flat_map_iter(|(t, &[a, b, c])| {
            [(a, b), (b, c), (c, a)]
                .map(|(p, q)| ((u64::from(p.min(q)) << 32) | u64::from(p.max(q)), t as u32))
        })
        .collect();
    edges.par_sort_unstable();
    let mut sums = vec![(DVec3::ZERO, 0u32); pieces.parts.len()];
    for same in edges.chunk_by(|a, b| a.0 == b.0).filter(|same| same.len() == 1) {
        let (key, triangle) = same[0];
        let sum = &mut sums[pieces.part_of[triangle as usize] as usize];
        for v in [key >> 32, key & 0xffff_ffff] {
            sum.0 += mesh.positions[v as usize];
            sum.1 += 1;
        }
    }
    sums.into_iter()
        .map(|(sum, n)| (n > 0).then(|| sum / f64::from(n)))
        .collect()
}

/// Gives every closed part of negative volume to the smallest solid part around it.
fn find_owners(mesh: &Mesh, pieces: &mut Pieces) {
    let is_cavity = |p: &Part| p.volume < 0.0 && !p.is_open;
    let cavities: Vec<usize> = (0..pieces.parts.len())
        .filter(|&i| is_cavity(&pieces.parts[i]))
        .collect();
    if cavities.is_empty() {
        return;
    }
    let is_solid: Vec<bool> = pieces
        .parts
        .iter()
        .map(|p| p.volume > 0.0 && !p.is_open)
        .collect();
    let shadows = Shadows::new(mesh, |t| is_solid[pieces.part_of[t] as usize]);
    let owners: Vec<Option<usize>> = cavities
        .par_iter()
        .map(|&cavity| {
            let corners = mesh.corners(pieces.parts[cavity].first_triangle);
            let p = corners.iter().sum::<DVec3>() / 3.0;
            let mut crossed: Vec<u32> = shadows.crossed(mesh, p).map(|t| pieces.part_of[t]).collect();
            crossed.sort_unstable();
            // Inside of what the ray leaves once more often than it enters.
            (crossed.chunk_by(|a, b| a == b))
                .filter(|same| same.len() % 2 == 1)
                .map(|same| same[0] as usize)
                .min_by(|&a, &b| pieces.parts[a].volume.total_cmp(&pieces.parts[b].volume))
        })
        .collect();
    for (cavity, owner) in cavities.into_iter().zip(owners) {
        pieces.parts[cavity].owner = owner;
    }
}

/// Triangles by where their shadows along x fall, for rays along x.
struct Shadows {
    low: DVec3,
    cells_per_length: DVec3,
    cells: usize,
    /// Triangles of cell `i` are `triangles[starts[i]..starts[i + 1]]`.
    starts: Vec<usize>,
    triangles: Vec<u32>,
}

impl Shadows {
    fn new(mesh: &Mesh, wanted: impl Fn(usize) -> bool) -> Self {
        let around = mesh.bounding_box().expect("a mesh with cavities has vertices");
        let cells = ((mesh.triangles.len() as f64).sqrt() * 0.5).clamp(1.0, 1024.0) as usize;
        let mut shadows = Self {
            low: around.min,
            cells_per_length: cells as f64 / around.size().max(DVec3::splat(f64::MIN_POSITIVE)),
            cells,
            starts: vec![0; cells * cells + 1],
            triangles: Vec::new(),
        };
        let wanted: Vec<u32> = (0..mesh.triangles.len())
            .filter(|&t| wanted(t))
            .map(|t| t as u32)
            .collect();
        for &t in &wanted {
            shadows.for_cells(mesh, t, |cell, s| s.starts[cell + 1] += 1);
        }
        for i in 0..cells * cells {
            shadows.starts[i + 1] += shadows.starts[i];
        }
        shadows.triangles = vec![0; shadows.starts[cells * cells]];
        let mut next = shadows.starts.clone();
        for &t in &wanted {
            shadows.for_cells(mesh, t, |cell, s| {
                s.triangles[next[cell]] = t;
                next[cell] += 1;
            });
        }
        shadows
    }

    fn cell(&self, p: DVec3) -> [usize; 2] {
        let q = (p - self.low) * self.cells_per_length;
        [q.y, q.z].map(|x| (x.max(0.0) as usize).min(self.cells - 1))
    }

    fn for_cells(&mut self, mesh: &Mesh, t: u32, mut visit: impl FnMut(usize, &mut Self)) {
        let [a, b, c] = mesh.corners(t as usize);
        let (from, to) = (self.cell(a.min(b).min(c)), self.cell(a.max(b).max(c)));
        for y in from[0]..=to[0] {
            for z in from[1]..=to[1] {
                visit(y * self.cells + z, self);
            }
        }
    }

    /// Triangles that the ray from `p` along +x crosses.
    fn crossed<'a>(&'a self, mesh: &'a Mesh, p: DVec3) -> impl Iterator<Item = usize> + 'a {
        let [y, z] = self.cell(p);
        let cell = y * self.cells + z;
        self.triangles[self.starts[cell]..self.starts[cell + 1]]
            .iter()
            .map(|&t| t as usize)
            .filter(move |&t| is_crossed(mesh.corners(t), p))
    }
}

/// Whether the ray from `p` along +x meets a triangle. A ray through an edge meets exactly one of two neighbours.
fn is_crossed(corners: [DVec3; 3], p: DVec3) -> bool {
    let mut is_inside = false;
    for i in 0..3 {
        let (a, b) = (corners[i], corners[(i + 1) % 3]);
        // The lower end first, so that both neighbours of an edge compute the same number.
        let (low, high) = if (a.z, a.y) < (b.z, b.y) { (a, b) } else { (b, a) };
        if (low.z > p.z) != (high.z > p.z) {
            let y = low.y + (high.y - low.y) * ((p.z - low.z) / (high.z - low.z));
            is_inside ^= p.y < y;
        }
    }
    let [a, b, c] = corners;
    let n = (b - a).cross(c - a);
    is_inside && n.x != 0.0 && a.x - (n.y * (p.y - a.y) + n.z * (p.z - a.z)) / n.x > p.x
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cube with corners at `low` and `low + size`, its normals outwards or, for a cavity, inwards.
    fn cube(mesh: &mut Mesh, low: [f64; 3], size: f64, is_cavity: bool) {
        let first = mesh.positions.len() as u32;
        let corner = |i: u32| DVec3::new((i >> 2) as f64, (i >> 1 & 1) as f64, (i & 1) as f64);
        mesh.positions
            .extend((0..8).map(|i| DVec3::from_array(low) + corner(i) * size));
        for [a, b, c, d] in [
            [0, 1, 3, 2],
            [4, 6, 7, 5],
            [0, 4, 5, 1],
            [2, 3, 7, 6],
            [0, 2, 6, 4],
            [1, 5, 7, 3],
        ] {
            for [p, q, r] in [[a, b, c], [a, c, d]] {
                let [p, q, r] = [p, q, r].map(|v| v + first);
                mesh.triangles.push(if is_cavity { [p, r, q] } else { [p, q, r] });
            }
        }
    }

    fn empty() -> Mesh {
        Mesh {
            positions: Vec::new(),
            normals: Vec::new(),
            triangles: Vec::new(),
        }
    }

    /// Far from the origin, so that volumes about it would lose their digits. The rays from the cavities pass
    /// through edges and corners of the other cubes.
    #[test]
    fn volumes_and_owners_of_nested_cubes() {
        let mut mesh = empty();
        let far = |x: f64| [1e6 + x; 3];
        cube(&mut mesh, far(0.0), 8.0, false);
        cube(&mut mesh, far(1.0), 6.0, true);
        cube(&mut mesh, far(2.0), 4.0, false);
        cube(&mut mesh, far(3.0), 1.0, true);
        cube(&mut mesh, far(20.0), 2.0, false);
        cube(&mut mesh, [1e6 + 30.0, 1e6 + 1.0, 1e6 + 1.0], 4.0, false);
        let pieces = Pieces::of(&mesh);
        let volumes: Vec<f64> = pieces.parts.iter().map(|p| p.volume.round()).collect();
        assert_eq!(volumes, [512.0, -216.0, 64.0, -1.0, 8.0, 64.0]);
        let owners: Vec<_> = pieces.parts.iter().map(|p| p.owner).collect();
        assert_eq!(owners, [None, Some(0), None, Some(2), None, None]);
        assert!(pieces.parts.iter().all(|p| p.triangle_count == 12 && !p.is_open));
    }

    #[test]
    fn narrow_parts_are_told_unless_there_are_no_others() {
        let mut mesh = empty();
        cube(&mut mesh, [0.0; 3], 2.0, false);
        cube(&mut mesh, [0.5; 3], 0.5, true);
        cube(&mut mesh, [4.0; 3], 0.9, false);
        let narrow = of_narrow_parts(&mesh, 1.0);
        assert_eq!(narrow, (2, [[false; 12], [true; 12], [true; 12]].concat()));
        assert_eq!(of_narrow_parts(&mesh, 3.0), (0, vec![false; 36]));
        assert_eq!(of_narrow_parts(&mesh, 0.1), (0, vec![false; 36]));
    }

    #[test]
    fn an_open_part_is_measured_as_if_closed() {
        let mut mesh = empty();
        cube(&mut mesh, [5.0; 3], 2.0, false);
        mesh.triangles.truncate(10);
        let pieces = Pieces::of(&mesh);
        assert!(pieces.parts[0].is_open && (pieces.parts[0].volume - 8.0).abs() < 1e-12);
    }
}
