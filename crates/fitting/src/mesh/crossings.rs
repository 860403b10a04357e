//! Pairs of triangles that cross.

use std::collections::BTreeMap;

use glam::DVec3;
use rayon::prelude::*;

use super::nearest::STACK;
use super::topology::Faces;
use super::tree::TriangleTree;

/// Triangles that are compared with their surroundings; of more, every second, third, ... is.
const MOST_LOOKED_AT: usize = 2_000_000;
/// Neighbours that one triangle is compared with.
const MOST_NEIGHBOURS: usize = 4096;

/// What was found.
pub(crate) struct Crossings {
    /// Pairs that cross.
    pub pairs: usize,
    /// Whether only a share of the pairs was looked at.
    pub sampled: bool,
    /// Triangles that cross each triangle, all as indices of the tree.
    pub partners: BTreeMap<u32, Vec<u32>>,
}

/// Looks for pairs without a common corner of which an edge of one passes through the other. Pairs that lie in one
/// plane are not counted.
pub(crate) fn crossings(faces: &Faces, tree: &TriangleTree, face_of: &[u32]) -> Crossings {
    let stride = face_of.len().div_ceil(MOST_LOOKED_AT).max(1);
    let found: Vec<(Vec<u32>, bool)> = (0..face_of.len())
        .into_par_iter()
        .step_by(stride)
        .with_min_len(256)
        .map(|t| partners(faces, tree, face_of, t, stride > 1))
        .collect();
    let mut out = Crossings {
        pairs: 0,
        sampled: stride > 1,
        partners: BTreeMap::new(),
    };
    for (i, (partners, cut_off)) in found.iter().enumerate() {
        out.sampled |= cut_off;
        out.pairs += partners.len();
        let t = (i * stride) as u32;
        for &p in partners {
            out.partners.entry(t).or_default().push(p);
            out.partners.entry(p).or_default().push(t);
        }
    }
    for list in out.partners.values_mut() {
        list.sort_unstable();
        list.dedup();
    }
    out
}

/// Triangles later in the tree (or all, where some are skipped) that cross triangle `t`; whether the search was cut
/// off.
fn partners(faces: &Faces, tree: &TriangleTree, face_of: &[u32], t: usize, all: bool) -> (Vec<u32>, bool) {
    let own = &tree.corners[t];
    let own_corners = faces.corners[face_of[t] as usize];
    let min = own[0].min(own[1]).min(own[2]);
    let max = own[0].max(own[1]).max(own[2]);
    let (mut out, mut looked_at) = (Vec::new(), 0);
    let mut stack = [0u32; STACK];
    let mut height = 1;
    while height > 0 {
        height -= 1;
        let at = stack[height];
        let node = &tree.nodes[at as usize];
        if !node.touches(min, max) {
            continue;
        }
        if node.count == 0 {
            stack[height] = node.first;
            stack[height + 1] = at + 1;
            height += 2;
            continue;
        }
        for other in node.first..node.first + node.count {
            if other as usize == t || (!all && (other as usize) < t) {
                continue;
            }
            let corners = faces.corners[face_of[other as usize] as usize];
            if corners.iter().any(|v| own_corners.contains(v)) {
                continue;
            }
            looked_at += 1;
            if looked_at > MOST_NEIGHBOURS {
                return (out, true);
            }
            if cross(own, &tree.corners[other as usize]) {
                out.push(other);
            }
        }
    }
    (out, false)
}

/// Whether an edge of one triangle passes through the other.
pub(crate) fn cross(a: &[DVec3; 3], b: &[DVec3; 3]) -> bool {
    // Six times the volume of a tetrahedron.
    let volume = |p: DVec3, q: DVec3, r: DVec3, s: DVec3| (q - p).cross(r - p).dot(s - p);
    // One triangle on one side of the other's plane is the common case.
    let sides = |t: &[DVec3; 3], u: &[DVec3; 3]| u.map(|p| volume(t[0], t[1], t[2], p));
    let apart = |s: [f64; 3]| s.iter().all(|&v| v > 0.0) || s.iter().all(|&v| v < 0.0);
    let (of_b, of_a) = (sides(a, b), sides(b, a));
    if apart(of_b) || apart(of_a) {
        return false;
    }
    let pierces = |t: &[DVec3; 3], u: &[DVec3; 3], side: [f64; 3]| {
        (0..3).any(|i| {
            let j = (i + 1) % 3;
            if side[i] * side[j] >= 0.0 {
                return false;
            }
            let turn: [f64; 3] = std::array::from_fn(|k| volume(u[i], u[j], t[k], t[(k + 1) % 3]));
            turn.iter().all(|&v| v > 0.0) || turn.iter().all(|&v| v < 0.0)
        })
    };
    pierces(a, b, of_b) || pierces(b, a, of_a)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_cross_where_an_edge_of_one_passes_through_the_other() {
        let flat = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let upright = |x: f64| {
            [
                DVec3::new(x, 0.2, -0.5),
                DVec3::new(x, 0.2, 0.5),
                DVec3::new(x, 0.3, 0.6),
            ]
        };
        assert!(cross(&flat, &upright(0.3)));
        assert!(cross(&upright(0.3), &flat));
        assert!(!cross(&flat, &upright(0.9)), "beside it");
        let above = flat.map(|p| p + DVec3::Z * 1e-9);
        assert!(!cross(&flat, &above), "parallel");
    }
}
