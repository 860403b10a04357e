//! A soup of triangles made ready: checked, merged, scaled to the unit box, each sheet facing one way.

use glam::DVec3;
use rayon::prelude::*;

use super::MeshDefects;
use crate::FitError;

/// Margin of the box round the mesh, as a multiple of its longest side.
const BOX_SCALE: f64 = 1.15;
/// Twice the area of a triangle, in squares of its longest edge, below which it has none.
const NO_AREA: f64 = 1e-14;

/// Triangles in the unit box; those without area are kept for what they join.
#[derive(Clone, Debug)]
pub(crate) struct Faces {
    /// Corner of the box in world units.
    pub origin: DVec3,
    /// Edge of the box in world units.
    pub scale: f64,
    /// Diagonal of the mesh's own box in world units.
    pub diagonal: f64,
    /// Positions in the unit box.
    pub vertices: Vec<DVec3>,
    /// Corners; counterclockwise seen from the side that its sheet takes for its outside.
    pub corners: Vec<[u32; 3]>,
    /// Sheet of each triangle: triangles joined by edges that have two of them.
    pub sheets: Vec<u32>,
    /// Number of sheets.
    pub sheet_count: usize,
}

/// A side of a triangle: key of the edge, triangle, whether it runs from the lower to the higher vertex.
pub(crate) type Side = (u64, u32, bool);

impl Faces {
    /// Checks and merges.
    ///
    /// # Errors
    /// [`FitError::Degenerate`] with the index and value at fault.
    pub fn prepare(
        positions: &[DVec3],
        triangles: &[[u32; 3]],
        defects: &mut MeshDefects,
    ) -> Result<Self, FitError> {
        defects.triangles = triangles.len();
        let [min, max] = checked_extent(positions, triangles)?;
        let longest = (max - min).max_element();
        let magnitude = min.abs().max(max.abs()).max_element();
        if longest <= 1e-12 * magnitude || longest == 0.0 {
            return Err(FitError::Degenerate(format!(
                "all {} triangles lie at {min}: a mesh needs an area",
                triangles.len()
            )));
        }
        let scale = BOX_SCALE * longest;
        let origin = (min + max) * 0.5 - scale * 0.5;
        let (same, merged) = merged_vertices(positions, triangles);
        defects.merged_vertices = merged;
        let vertices: Vec<DVec3> = positions.iter().map(|p| (*p - origin) / scale).collect();
        let joined: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|v| same[v as usize])).collect();
        let mut corners: Vec<[u32; 3]> = joined
            .iter()
            .copied()
            .filter(|&[a, b, c]| a != b && b != c && c != a)
            .collect();
        let collapsed = joined.len() - corners.len();
        defects.duplicate_faces = drop_duplicates(&mut corners);
        let flat = corners.iter().filter(|c| !has_area(&vertices, c)).count();
        defects.degenerate_faces = collapsed + flat;
        if flat == corners.len() {
            return Err(FitError::Degenerate(format!(
                "none of the {} triangles has an area: give a mesh with faces",
                triangles.len()
            )));
        }
        let mut faces = Self {
            origin,
            scale,
            diagonal: (max - min).length(),
            vertices,
            corners,
            sheets: Vec::new(),
            sheet_count: 0,
        };
        defects.components = faces.component_count();
        faces.orient_sheets(defects);
        Ok(faces)
    }

    /// Positions of the corners of triangle `face`.
    pub fn points(&self, face: usize) -> [DVec3; 3] {
        self.corners[face].map(|v| self.vertices[v as usize])
    }

    /// Whether triangle `face` has an area.
    pub fn has_area(&self, face: usize) -> bool {
        has_area(&self.vertices, &self.corners[face])
    }

    /// Turns triangle `face` over.
    pub fn flip(&mut self, face: usize) {
        self.corners[face].swap(1, 2);
    }

    /// All sides, those of one edge together.
    pub fn sides(&self) -> Vec<Side> {
        let mut sides: Vec<Side> = (0..self.corners.len())
            .into_par_iter()
            .flat_map_iter(|face| {
                let [a, b, c] = self.corners[face];
                [[a, b], [b, c], [c, a]].map(|[from, to]| {
                    let key = u64::from(from.min(to)) << 32 | u64::from(from.max(to));
                    (key, face as u32, from < to)
                })
            })
            .collect();
        sides.par_sort_unstable();
        sides
    }

    fn component_count(&self) -> usize {
        let mut root: Vec<u32> = (0..self.vertices.len() as u32).collect();
        for &[a, b, c] in &self.corners {
            for v in [b, c] {
                let (p, q) = (find(&mut root, a), find(&mut root, v));
                root[p.max(q) as usize] = p.min(q);
            }
        }
        let mut used: Vec<u32> = self.corners.iter().map(|c| find(&mut root, c[0])).collect();
        used.sort_unstable();
        used.dedup();
        used.len()
    }

    /// Numbers the sheets, and turns over the triangles that stand against the larger area of their sheet.
    fn orient_sheets(&mut self, defects: &mut MeshDefects) {
        let sides = self.sides();
        let mut neighbours = vec![[(u32::MAX, false); 3]; self.corners.len()];
        let mut filled = vec![0u8; self.corners.len()];
        for edge in sides.chunk_by(|a, b| a.0 == b.0) {
            match edge {
                [_] => defects.boundary_edges += 1,
                [a, b] => {
                    for (from, to) in [(a, b), (b, a)] {
                        let slot = &mut filled[from.1 as usize];
                        // Two sides that run the same way belong to triangles that face opposite ways.
                        neighbours[from.1 as usize][*slot as usize] = (to.1, a.2 == b.2);
                        *slot += 1;
                    }
                }
                _ => defects.non_manifold_edges += 1,
            }
        }
        const UNSEEN: u32 = u32::MAX;
        self.sheets = vec![UNSEEN; self.corners.len()];
        let mut turned = vec![false; self.corners.len()];
        let mut queue = Vec::new();
        for seed in 0..self.corners.len() {
            if self.sheets[seed] != UNSEEN {
                continue;
            }
            let sheet = self.sheet_count as u32;
            self.sheet_count += 1;
            self.sheets[seed] = sheet;
            queue.clear();
            queue.push(seed as u32);
            let mut next = 0;
            while next < queue.len() {
                let face = queue[next] as usize;
                next += 1;
                for &(other, against) in &neighbours[face] {
                    if other == u32::MAX {
                        continue;
                    }
                    let other = other as usize;
                    if self.sheets[other] == UNSEEN {
                        self.sheets[other] = sheet;
                        turned[other] = turned[face] ^ against;
                        queue.push(other as u32);
                    } else if turned[other] != turned[face] ^ against && face < other {
                        defects.non_orientable_edges += 1;
                    }
                }
            }
            let area = |turned_ones: bool| -> f64 {
                let chosen = queue.iter().filter(|&&f| turned[f as usize] == turned_ones);
                chosen
                    .map(|&f| area_vector(&self.points(f as usize)).length())
                    .sum()
            };
            let minority = area(true) <= area(false);
            for &face in &queue {
                if turned[face as usize] == minority {
                    self.corners[face as usize].swap(1, 2);
                    defects.flipped_faces += 1;
                }
            }
        }
    }
}

/// Half the cross product of two edges.
pub(crate) fn area_vector(&[a, b, c]: &[DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a) * 0.5
}

fn has_area(vertices: &[DVec3], corners: &[u32; 3]) -> bool {
    let [a, b, c] = corners.map(|v| vertices[v as usize]);
    let longest = (b - a)
        .length_squared()
        .max((c - b).length_squared())
        .max((a - c).length_squared());
    (b - a).cross(c - a).length() > NO_AREA * longest
}

/// Box round the vertices in use.
fn checked_extent(positions: &[DVec3], triangles: &[[u32; 3]]) -> Result<[DVec3; 2], FitError> {
    if triangles.is_empty() {
        return Err(FitError::Degenerate(
            "the mesh has no triangles: give a file with faces, or fit its points as a cloud".into(),
        ));
    }
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for (index, triangle) in triangles.iter().enumerate() {
        for &v in triangle {
            let Some(p) = positions.get(v as usize) else {
                return Err(FitError::Degenerate(format!(
                    "triangle {index} names vertex {v}, but there are {} vertices, counted from 0: the file is damaged",
                    positions.len()
                )));
            };
            if !p.is_finite() || p.abs().max_element() >= 1e150 {
                return Err(FitError::Degenerate(format!(
                    "vertex {v} lies at {p}: every vertex of a triangle needs finite coordinates below 1e150"
                )));
            }
            min = min.min(*p);
            max = max.max(*p);
        }
    }
    Ok([min, max])
}

/// For each vertex the first one at the same place, and how many vertices in use had another before them.
fn merged_vertices(positions: &[DVec3], triangles: &[[u32; 3]]) -> (Vec<u32>, usize) {
    let mut used = vec![false; positions.len()];
    for &v in triangles.iter().flatten() {
        used[v as usize] = true;
    }
    // Adding 0 makes -0 and 0 the same.
    let key = |v: u32| (positions[v as usize] + 0.0).to_array();
    let mut order: Vec<u32> = (0..positions.len() as u32)
        .filter(|&v| used[v as usize])
        .collect();
    order.par_sort_unstable_by(|&a, &b| {
        let (p, q) = (key(a), key(b));
        let by = |axis: usize| p[axis].total_cmp(&q[axis]);
        by(0).then(by(1)).then(by(2)).then(a.cmp(&b))
    });
    let mut same: Vec<u32> = (0..positions.len() as u32).collect();
    let mut merged = 0;
    for group in order.chunk_by(|&a, &b| key(a) == key(b)) {
        for &v in group {
            same[v as usize] = group[0];
        }
        merged += group.len() - 1;
    }
    (same, merged)
}

/// Keeps the first of the triangles that share all three corners, whatever way they face; the number dropped.
fn drop_duplicates(corners: &mut Vec<[u32; 3]>) -> usize {
    let mut keyed: Vec<([u32; 3], u32)> = corners
        .iter()
        .zip(0..)
        .map(|(c, i)| {
            let mut key = *c;
            key.sort_unstable();
            (key, i)
        })
        .collect();
    keyed.par_sort_unstable();
    let mut keep = vec![true; corners.len()];
    for group in keyed.chunk_by(|a, b| a.0 == b.0) {
        for (_, i) in &group[1..] {
            keep[*i as usize] = false;
        }
    }
    let mut flags = keep.iter();
    let before = corners.len();
    corners.retain(|_| *flags.next().expect("one flag a triangle"));
    before - corners.len()
}

fn find(root: &mut [u32], mut v: u32) -> u32 {
    while root[v as usize] != v {
        root[v as usize] = root[root[v as usize] as usize];
        v = root[v as usize];
    }
    v
}
