use bspline::hierarchical::Lattice;
use bspline::polygonize::Mesh;
use fitting::Leaf;
use glam::DVec3;
use rayon::prelude::*;
use rustc_hash::FxHashMap;

/// Which parts of the surface of a cloud are invented: those too far from every leaf that holds samples.
pub struct Sampled {
    /// Edge of a bucket, and the farthest distance that can be told.
    reach: f64,
    /// Corners of the boxes of leaves with samples, world units.
    boxes: Vec<(DVec3, DVec3)>,
    /// Boxes that meet a bucket.
    buckets: FxHashMap<[i32; 3], Vec<u32>>,
}

impl Sampled {
    /// An index over the leaves with samples, for distances up to `reach` (world units, above 0). Boxes of leaves are
    /// taken as upright, as those of clouds are.
    pub fn new(lattice: &Lattice, leaves: &[Leaf], reach: f64) -> Self {
        let boxes: Vec<(DVec3, DVec3)> = leaves
            .iter()
            .filter(|l| l.sample_count > 0)
            .map(|l| {
                let scale = 1.0 / (1u64 << l.level) as f64;
                let corner = DVec3::from_array(l.cell.map(f64::from)) * scale;
                let [a, b] = [corner, corner + scale].map(|q| lattice.world_from_lattice.transform_point3(q));
                (a.min(b), a.max(b))
            })
            .collect();
        let mut sampled = Self {
            reach,
            boxes,
            buckets: FxHashMap::default(),
        };
        for (i, (low, high)) in sampled.boxes.iter().enumerate() {
            let [first, last] = [*low, *high].map(|p| bucket(p, reach));
            for x in first[0]..=last[0] {
                for y in first[1]..=last[1] {
                    for z in first[2]..=last[2] {
                        sampled.buckets.entry([x, y, z]).or_default().push(i as u32);
                    }
                }
            }
        }
        sampled
    }

    /// Whether a leaf with samples lies within reach of `p`.
    fn reaches(&self, p: DVec3) -> bool {
        let own = bucket(p, self.reach);
        let near = |key: &[i32; 3]| {
            let list = self.buckets.get(key).map_or(&[][..], Vec::as_slice);
            list.iter().any(|&i| {
                let (low, high) = self.boxes[i as usize];
                p.distance_squared(p.clamp(low, high)) <= self.reach * self.reach
            })
        };
        near(&own)
            || (0..27).any(|k| {
                let step = [k / 9 - 1, k / 3 % 3 - 1, k % 3 - 1];
                near(&std::array::from_fn(|a| own[a] + step[a]))
            })
    }

    /// Whether each triangle is invented, by its centre.
    pub fn invented(&self, mesh: &Mesh) -> Vec<bool> {
        (0..mesh.triangles.len())
            .into_par_iter()
            .with_min_len(4096)
            .map(|t| !self.reaches(mesh.corners(t).iter().sum::<DVec3>() / 3.0))
            .collect()
    }
}

fn bucket(p: DVec3, edge: f64) -> [i32; 3] {
    (p / edge).floor().to_array().map(|x| x as i32)
}

/// Area of a triangle.
fn area(mesh: &Mesh, t: usize) -> f64 {
    let [a, b, c] = mesh.corners(t);
    0.5 * (b - a).cross(c - a).length()
}

/// Area of the whole mesh.
pub fn total_area(mesh: &Mesh) -> f64 {
    (0..mesh.triangles.len()).map(|t| area(mesh, t)).sum()
}

/// Share of the area whose triangles are marked.
pub fn share(mesh: &Mesh, marked: &[bool]) -> f64 {
    let part: f64 = (0..mesh.triangles.len())
        .filter(|&t| marked[t])
        .map(|t| area(mesh, t))
        .sum();
    part / total_area(mesh).max(f64::MIN_POSITIVE)
}

/// Drops the marked triangles, and the vertices that none of the others uses.
pub fn drop_marked(mesh: &mut Mesh, marked: &[bool]) {
    let mut marks = marked.iter();
    mesh.triangles.retain(|_| !marks.next().copied().unwrap_or(false));
    let mut number = vec![u32::MAX; mesh.positions.len()];
    let mut kept = Vec::new();
    for corner in mesh.triangles.iter_mut().flatten() {
        let slot = &mut number[*corner as usize];
        if *slot == u32::MAX {
            *slot = kept.len() as u32;
            kept.push(mesh.positions[*corner as usize]);
        }
        *corner = *slot;
    }
    mesh.positions = kept;
}
