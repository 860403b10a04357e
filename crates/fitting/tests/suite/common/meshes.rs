//! Triangle meshes of known shape.

use std::f64::consts::PI;

use fitting::phantoms::SplitMix64;
use glam::DVec3;

#[derive(Clone, Debug, Default)]
pub struct Mesh {
    pub vertices: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Both meshes in one.
    pub fn with(mut self, other: &Self) -> Self {
        let first = self.vertices.len() as u32;
        self.vertices.extend(&other.vertices);
        self.triangles
            .extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
        self
    }

    pub fn moved(mut self, by: DVec3) -> Self {
        self.vertices.iter_mut().for_each(|v| *v += by);
        self
    }

    pub fn inside_out(mut self) -> Self {
        self.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        self
    }

    /// Turns over a share of the triangles; how many.
    pub fn flip_some(&mut self, share: f64, seed: u64) -> usize {
        let mut random = SplitMix64::new(seed);
        let mut count = 0;
        for t in &mut self.triangles {
            if random.uniform() < share {
                t.swap(1, 2);
                count += 1;
            }
        }
        count
    }

    pub fn remove_some(&mut self, share: f64, seed: u64) {
        let mut random = SplitMix64::new(seed);
        self.triangles.retain(|_| random.uniform() >= share);
    }
}

/// A grid of quads over two angles, split into triangles that face the same way.
fn closed_grid(n: [usize; 2], is_pole: bool, at: impl Fn(f64, f64) -> DVec3) -> Mesh {
    let rows = n[0] + usize::from(is_pole);
    let mut mesh = Mesh::default();
    for i in 0..rows {
        for j in 0..n[1] {
            mesh.vertices
                .push(at(i as f64 / n[0] as f64, j as f64 / n[1] as f64));
        }
    }
    let index = |i: usize, j: usize| ((i % rows) * n[1] + j % n[1]) as u32;
    for i in 0..n[0] {
        for j in 0..n[1] {
            let [a, b, c, d] = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
            for t in [[a, b, c], [a, c, d]] {
                // At a pole one of the two has no area.
                let p = t.map(|v| mesh.vertices[v as usize]);
                if p[0] != p[1] && p[1] != p[2] && p[2] != p[0] {
                    mesh.triangles.push(t);
                }
            }
        }
    }
    mesh
}

/// Unit sphere with `n` bands of latitude.
pub fn sphere(n: usize) -> Mesh {
    closed_grid([n, 2 * n], true, |u, v| {
        let (a, b) = (PI * u, 2.0 * PI * v);
        // Both poles are single places.
        let ring = if u == 0.0 || u == 1.0 { 0.0 } else { a.sin() };
        DVec3::new(ring * b.cos(), ring * b.sin(), a.cos())
    })
}

/// Torus of radii 1 and 0.4 about z.
pub fn torus(n: usize) -> Mesh {
    ring(2 * n, n)
}

/// [`torus`] of `around` times `across` pairs of triangles.
pub fn ring(around: usize, across: usize) -> Mesh {
    closed_grid([around, across], false, |u, v| {
        let (a, b) = (2.0 * PI * u, 2.0 * PI * v);
        let r = 1.0 + 0.4 * b.cos();
        DVec3::new(r * a.cos(), r * a.sin(), 0.4 * b.sin())
    })
}

/// Box of twelve triangles.
pub fn cuboid(low: DVec3, high: DVec3) -> Mesh {
    let corner = |i: usize| {
        let pick = |bit: usize, a: usize| if i >> bit & 1 == 1 { high[a] } else { low[a] };
        DVec3::new(pick(0, 0), pick(1, 1), pick(2, 2))
    };
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    Mesh {
        vertices: (0..8).map(corner).collect(),
        triangles: quads
            .iter()
            .flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]])
            .collect(),
    }
}

/// Surface of the cubes of edge `2 half/n` whose centres are `inside`, in a box from `-half` to `half`.
pub fn cubes(n: usize, half: f64, inside: impl Fn(DVec3) -> bool) -> Mesh {
    let edge = 2.0 * half / n as f64;
    let is_in = |c: [i64; 3]| {
        let p = DVec3::from_array(c.map(|x| (x as f64 + 0.5) * edge - half));
        c.iter().all(|&x| (0..n as i64).contains(&x)) && inside(p)
    };
    let mut mesh = Mesh::default();
    let mut index = std::collections::BTreeMap::new();
    for i in 0..(n * n * n) as i64 {
        let side = n as i64;
        let cell = [i / (side * side), i / side % side, i % side];
        if !is_in(cell) {
            continue;
        }
        for (axis, step) in (0..3).flat_map(|axis| [(axis, 0), (axis, 1)]) {
            let mut beside = cell;
            beside[axis] += 2 * step - 1;
            if is_in(beside) {
                continue;
            }
            let mut square = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[u, v]| {
                let mut corner = cell;
                corner[axis] += step;
                corner[(axis + 1) % 3] += u;
                corner[(axis + 2) % 3] += v;
                *index.entry(corner).or_insert_with(|| {
                    mesh.vertices
                        .push(DVec3::from_array(corner.map(|x| x as f64 * edge - half)));
                    mesh.vertices.len() as u32 - 1
                })
            });
            if step == 0 {
                square.reverse();
            }
            let [a, b, c, d] = square;
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}
