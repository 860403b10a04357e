//! Triangles of a mesh that pass through each other.

use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

use super::Mesh;

/// Cells that the triangles are put into, per triangle.
const ENTRIES: u64 = 8;

/// Cells along the longest side of the mesh, at most: keys have 21 bits for each coordinate.
const MOST_CELLS: f64 = 2_097_151.0;

/// Triangles, and pairs of them, looked at together.
const BATCH: usize = 1024;

/// Pairs of triangles without a common corner of which a side of one passes through the other.
///
/// Touching counts for nothing, and neither do triangles that lie in one plane. Takes about 1 µs a triangle.
///
/// # Panics
/// If a triangle names a vertex that does not exist.
pub fn self_intersections(mesh: &Mesh) -> u64 {
    let Some(around) = mesh.bounding_box().filter(|b| b.size().is_finite()) else {
        return 0;
    };
    let count = mesh.triangles.len();
    let longest = around.size().max_element();
    let extents = (0..count).into_par_iter().with_min_len(BATCH).map(|t| {
        let [a, b, c] = mesh.corners(t);
        (a.max(b).max(c) - a.min(b).min(c)).max_element()
    });
    let mean = extents.collect::<Vec<_>>().iter().sum::<f64>() / count as f64;
    if mean.is_nan() || mean <= 0.0 {
        return 0;
    }
    let mut cell = (1.5 * mean).max(longest / MOST_CELLS);
    let boxes = |cell: f64| {
        let place = move |p: DVec3| ((p - around.min) / cell).floor().as_u64vec3();
        move |t: usize| {
            let [a, b, c] = mesh.corners(t);
            (place(a.min(b).min(c)), place(a.max(b).max(c)))
        }
    };
    let entries = |cell: f64| -> u64 {
        let of = boxes(cell);
        (0..count)
            .into_par_iter()
            .with_min_len(BATCH)
            .map(|t| {
                let (lo, hi) = of(t);
                (hi - lo + 1).to_array().iter().product::<u64>()
            })
            .sum()
    };
    // A few triangles much larger than the others would lie in most of the cells.
    while entries(cell) > ENTRIES * count as u64 {
        cell *= 2.0;
    }
    let of = boxes(cell);
    let mut placed: Vec<(u64, u32)> = (0..count)
        .into_par_iter()
        .with_min_len(BATCH)
        .flat_map_iter(|t| {
            let (lo, hi) = of(t);
            let keys = (lo.x..=hi.x).flat_map(move |x| {
                (lo.y..=hi.y).flat_map(move |y| (lo.z..=hi.z).map(move |z| x << 42 | y << 21 | z))
            });
            keys.map(move |key| (key, t as u32))
        })
        .collect();
    placed.par_sort_unstable();
    let runs: Vec<Range<usize>> = runs(&placed);
    runs.par_iter()
        .with_min_len(64)
        .map(|run| {
            let inside = &placed[run.clone()];
            let pairs = inside.iter().enumerate().flat_map(|(n, (key, s))| {
                inside[n + 1..]
                    .iter()
                    .map(move |(_, t)| (*key, *s as usize, *t as usize))
            });
            pairs
                .filter(|&(key, s, t)| cross(mesh, s, t) && is_first(key, of(s).0, of(t).0))
                .count() as u64
        })
        .sum()
}

/// Stretches of one key.
fn runs(placed: &[(u64, u32)]) -> Vec<Range<usize>> {
    let mut start = 0;
    let chunks = placed.chunk_by(|a, b| a.0 == b.0);
    chunks
        .map(|chunk| {
            let run = start..start + chunk.len();
            start = run.end;
            run
        })
        .collect()
}

/// Whether a cell is the one that a pair of triangles counts in: the first that both lie in.
fn is_first(key: u64, a: glam::U64Vec3, b: glam::U64Vec3) -> bool {
    let first = a.max(b);
    key == first.x << 42 | first.y << 21 | first.z
}

fn cross(mesh: &Mesh, s: usize, t: usize) -> bool {
    if mesh.triangles[s].iter().any(|v| mesh.triangles[t].contains(v)) {
        return false;
    }
    let (p, q) = (mesh.corners(s), mesh.corners(t));
    let ends = |[a, b, c]: [DVec3; 3]| (a.min(b).min(c), a.max(b).max(c));
    let ((p_low, p_high), (q_low, q_high)) = (ends(p), ends(q));
    if !(p_low.cmple(q_high).all() && q_low.cmple(p_high).all()) {
        return false;
    }
    (0..3).any(|k| pierces(p[k], p[(k + 1) % 3], q) || pierces(q[k], q[(k + 1) % 3], p))
}

/// Whether the segment from `p` to `q` passes through a triangle.
fn pierces(p: DVec3, q: DVec3, [a, b, c]: [DVec3; 3]) -> bool {
    let volume = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| (b - a).cross(c - a).dot(d - a);
    if volume(a, b, c, p) * volume(a, b, c, q) >= 0.0 {
        return false;
    }
    let turns = [volume(p, q, a, b), volume(p, q, b, c), volume(p, q, c, a)];
    turns.iter().all(|t| *t > 0.0) || turns.iter().all(|t| *t < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Triangles in a box, of two sizes.
    fn soup(count: u32) -> Mesh {
        let mut state = 7u64;
        let mut unit = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let mut mesh = Mesh::default();
        for t in 0..count {
            let center = DVec3::new(unit(), unit(), unit());
            let size = if t % 50 == 0 { 1.5 } else { 0.3 };
            for _ in 0..3 {
                mesh.positions
                    .push(center + size * (DVec3::new(unit(), unit(), unit()) - 0.5));
            }
            mesh.triangles.push([3 * t, 3 * t + 1, 3 * t + 2]);
        }
        mesh
    }

    #[test]
    fn all_pairs_are_found_and_each_counts_once() {
        let mesh = soup(700);
        let all = (0..700).flat_map(|s| (s + 1..700).map(move |t| (s, t)));
        let expected = all.filter(|&(s, t)| cross(&mesh, s, t)).count() as u64;
        assert!(expected > 100, "{expected} pairs");
        assert_eq!(self_intersections(&mesh), expected);
    }

    #[test]
    fn neighbours_and_empty_meshes_have_none() {
        assert_eq!(self_intersections(&Mesh::default()), 0);
        let mut pair = soup(1);
        pair.positions.push(DVec3::splat(3.0));
        pair.triangles.push([0, 2, 3]);
        assert_eq!(self_intersections(&pair), 0);
    }
}
