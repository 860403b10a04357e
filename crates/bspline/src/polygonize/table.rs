//! Which triangles cross a cell, for each of the 256 ways its corners can lie inside or outside.
//!
//! The table is made from a rule, not written down:
//!
//! 1. On every face of the cube, each run of inside corners (in cyclic order) is cut off from the rest by one
//!    segment. On an ambiguous face (two inside corners across the diagonal) this separates the inside corners.
//!    The rule reads the four signs of the face alone, so two cells that share a face agree.
//! 2. The segments join end to end into loops round the cell.
//! 3. Each loop is triangulated so that no diagonal lies in a face of the cube: otherwise the neighbour
//!    could make the same edge and it would have more than two triangles. Among the triangulations left, the one
//!    with the shortest diagonals (on edge midpoints) is taken. Every loop that occurs has one.
//!
//! So every edge of the mesh has two triangles, every vertex one fan: the mesh is a closed oriented manifold. The
//! triangles of a cell do not pass through each other either, wherever the vertices lie on their edges (seen in all
//! 256 cases at random positions), so neither does the mesh.
//!
//! Corner `(x, y, z)` of a cell has number `4x + 2y + z`. Edge `4a + r` runs along axis `a`; `r` is made of the
//! other two coordinates of the edge, the earlier axis as the high bit.

use std::sync::LazyLock;

/// Edge of a cell, `0..12`.
pub(super) type Edge = u8;

/// The triangles of all 256 cases.
pub(super) struct CaseTable {
    /// Case `c` has the triangles `first[c] .. first[c + 1]`.
    first: [u16; 257],
    /// Triangles as edges of the cell, counter-clockwise seen from outside the solid.
    triangles: Vec<[Edge; 3]>,
}

impl CaseTable {
    /// The table, built at its first use.
    pub fn get() -> &'static Self {
        static TABLE: LazyLock<CaseTable> = LazyLock::new(CaseTable::build);
        &TABLE
    }

    /// Triangles of the case whose bit `4x + 2y + z` says that corner `(x, y, z)` is inside.
    #[inline(always)]
    pub fn triangles(&self, case: usize) -> &[[Edge; 3]] {
        &self.triangles[self.first[case] as usize..self.first[case + 1] as usize]
    }

    /// Number of triangles of a case.
    #[inline(always)]
    pub fn count(&self, case: usize) -> u32 {
        (self.first[case + 1] - self.first[case]) as u32
    }

    fn build() -> Self {
        let mut first = [0; 257];
        let mut triangles = Vec::new();
        for case in 0..256 {
            for polygon in loops(case) {
                let cut = triangulate(&polygon).expect("every loop has a triangulation inside the cell");
                triangles.extend(cut);
            }
            first[case + 1] = triangles.len() as u16;
        }
        Self { first, triangles }
    }
}

/// Axis of an edge and its lower corner.
pub(super) const fn edge_place(edge: usize) -> (usize, [usize; 3]) {
    let (high, low) = (edge >> 1 & 1, edge & 1);
    match edge / 4 {
        0 => (0, [0, high, low]),
        1 => (1, [high, 0, low]),
        _ => (2, [high, low, 0]),
    }
}

/// Edge between two corners that differ in one coordinate.
pub(super) fn edge_between(a: usize, b: usize) -> Edge {
    let c = a & b;
    let (x, y, z) = (c >> 2 & 1, c >> 1 & 1, c & 1);
    (match a ^ b {
        4 => 2 * y + z,
        2 => 4 + 2 * x + z,
        1 => 8 + 2 * x + y,
        _ => unreachable!("corners {a} and {b} are not neighbours"),
    }) as Edge
}

/// Corners of the face `2a + side`, counter-clockwise seen from outside the cube.
pub(super) fn face_corners(face: usize) -> [usize; 4] {
    let (axis, side) = (face / 2, face % 2);
    let bit = |axis: usize, on: usize| on << (2 - axis % 3);
    let corner = |u: usize, v: usize| bit(axis, side) | bit(axis + 1, u) | bit(axis + 2, v);
    let order = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
    if side == 1 {
        order
    } else {
        [order[0], order[3], order[2], order[1]]
    }
}

/// The directed segments of a case on one face: each from the edge where the walk round the face enters a run
/// of inside corners to the edge where it leaves it.
pub(super) fn face_segments(case: usize, face: usize) -> Vec<[Edge; 2]> {
    let corners = face_corners(face);
    let inside = |i: usize| case >> corners[i % 4] & 1 == 1;
    let edge = |i: usize| edge_between(corners[i % 4], corners[(i + 1) % 4]);
    let mut segments = Vec::new();
    for start in 0..4 {
        if !inside(start + 3) && inside(start) {
            let last = (start..start + 4)
                .take_while(|&i| inside(i))
                .last()
                .expect("the run has a first corner");
            segments.push([edge(start + 3), edge(last)]);
        }
    }
    segments
}

/// The closed loops of crossed edges of a case.
///
/// Two faces share each edge and walk along it in opposite directions, so that each crossed edge is the end of
/// one segment and the start of another.
pub(super) fn loops(case: usize) -> Vec<Vec<Edge>> {
    let mut next = [None; 12];
    for face in 0..6 {
        for [from, to] in face_segments(case, face) {
            next[from as usize] = Some(to);
        }
    }
    let mut found = Vec::new();
    for start in 0..12 {
        let mut polygon = Vec::new();
        let mut edge = start;
        while let Some(to) = next[edge].take() {
            polygon.push(edge as Edge);
            edge = to as usize;
        }
        if !polygon.is_empty() {
            found.push(polygon);
        }
    }
    found
}

/// Whether two edges lie in one face of the cube.
fn share_face(a: Edge, b: Edge) -> bool {
    let (axis_a, at_a) = edge_place(a as usize);
    let (axis_b, at_b) = edge_place(b as usize);
    (0..3).any(|n| n != axis_a && n != axis_b && at_a[n] == at_b[n])
}

/// Squared length between the midpoints of two edges, in quarters of a squared cell.
fn length_squared(a: Edge, b: Edge) -> u32 {
    let middle = |e: Edge| {
        let (axis, at) = edge_place(e as usize);
        let mut twice = at.map(|x| 2 * x as i32);
        twice[axis] = 1;
        twice
    };
    let (p, q) = (middle(a), middle(b));
    (0..3).map(|n| ((p[n] - q[n]) * (p[n] - q[n])) as u32).sum()
}

/// Triangulation of a polygon with the least sum of squared diagonals, none of which lies in a face of the cube.
fn triangulate(polygon: &[Edge]) -> Option<Vec<[Edge; 3]>> {
    let n = polygon.len();
    let weight = |i: usize, j: usize| {
        if j - i == 1 || (i == 0 && j == n - 1) {
            Some(0)
        } else if share_face(polygon[i], polygon[j]) {
            None
        } else {
            Some(length_squared(polygon[i], polygon[j]))
        }
    };
    // best[i][j]: least weight of the part between corners i and j, and the apex over its side ij.
    let mut best = vec![vec![None; n]; n];
    for i in 0..n - 1 {
        best[i][i + 1] = Some((0, i));
    }
    for span in 2..n {
        for i in 0..n - span {
            let j = i + span;
            let Some(own) = weight(i, j) else { continue };
            best[i][j] = (i + 1..j)
                .filter_map(|k| Some((own + best[i][k]?.0 + best[k][j]?.0, k)))
                .min_by_key(|&(total, _)| total);
        }
    }
    let mut triangles = Vec::new();
    let mut open = vec![(0, n - 1)];
    while let Some((i, j)) = open.pop() {
        if j - i > 1 {
            let (_, k) = best[i][j]?;
            triangles.push([polygon[i], polygon[k], polygon[j]]);
            open.extend([(i, k), (k, j)]);
        }
    }
    Some(triangles)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use std::collections::BTreeMap;

    fn crossed(case: usize) -> Vec<Edge> {
        (0..12)
            .filter(|&e| {
                let (axis, at) = edge_place(e as usize);
                let low = 4 * at[0] + 2 * at[1] + at[2];
                (case >> low ^ case >> (low | 4 >> axis)) & 1 == 1
            })
            .collect()
    }

    /// Directed edges of the triangles of a case with how often each occurs.
    fn directed(case: usize) -> BTreeMap<[Edge; 2], usize> {
        let mut count = BTreeMap::new();
        for t in CaseTable::get().triangles(case) {
            for i in 0..3 {
                *count.entry([t[i], t[(i + 1) % 3]]).or_insert(0) += 1;
            }
        }
        count
    }

    #[test]
    fn every_loop_has_a_triangulation_and_uses_every_crossed_edge_once() {
        for case in 0..256 {
            let mut used: Vec<Edge> = loops(case).into_iter().flatten().collect();
            used.sort();
            assert_eq!(used, crossed(case), "case {case}");
            for polygon in loops(case) {
                let t = triangulate(&polygon).unwrap_or_else(|| panic!("case {case}, loop {polygon:?}"));
                assert_eq!(t.len(), polygon.len() - 2);
            }
        }
    }

    #[test]
    fn inside_the_cell_every_side_has_its_opposite_and_no_other_lies_in_a_face() {
        for case in 0..256 {
            let sides = directed(case);
            let border: Vec<[Edge; 2]> = (0..6).flat_map(|f| face_segments(case, f)).collect();
            for (&[a, b], &count) in &sides {
                assert_eq!(count, 1, "case {case}: side {a}{b} twice in one direction");
                if border.contains(&[a, b]) {
                    assert!(
                        !sides.contains_key(&[b, a]),
                        "case {case}: border side {a}{b} used inside"
                    );
                } else {
                    assert!(
                        sides.contains_key(&[b, a]),
                        "case {case}: side {a}{b} is open inside the cell"
                    );
                    assert!(!share_face(a, b), "case {case}: diagonal {a}{b} lies in a face");
                }
            }
            assert!(
                border.iter().all(|s| sides.contains_key(s)),
                "case {case}: a face segment has no triangle"
            );
        }
    }

    #[test]
    fn neighbouring_cells_meet_in_opposite_segments() {
        for axis in 0..3 {
            let (mine, theirs) = (2 * axis + 1, 2 * axis);
            let bit = 4 >> axis;
            // The neighbour sees the shared edge at side 0 of the axis where this cell has it at side 1.
            let across = |e: Edge| {
                let (along, mut at) = edge_place(e as usize);
                assert_eq!(at[axis], 1);
                at[axis] = 0;
                let low = 4 * at[0] + 2 * at[1] + at[2];
                edge_between(low, low | 4 >> along)
            };
            for case in 0..256 {
                for other in 0..256 {
                    let agrees = (0..8)
                        .filter(|c| c & bit == 0)
                        .all(|c| case >> (c | bit) & 1 == other >> c & 1);
                    if !agrees {
                        continue;
                    }
                    let mut a: Vec<[Edge; 2]> = face_segments(case, mine)
                        .iter()
                        .map(|&[p, q]| [across(q), across(p)])
                        .collect();
                    let mut b = face_segments(other, theirs);
                    a.sort();
                    b.sort();
                    assert_eq!(a, b, "axis {axis}, cases {case} and {other}");
                }
            }
        }
    }

    #[test]
    fn ambiguous_faces_separate_the_inside_corners() {
        // Corners 0 and 3 of the face x = 0 are across its diagonal.
        let segments = face_segments(0b1001, 0);
        assert_eq!(segments.len(), 2);
        for [a, b] in segments {
            let shared = (0..4).filter(|&c| {
                let touches = |e: Edge| {
                    let (axis, at) = edge_place(e as usize);
                    let low = 4 * at[0] + 2 * at[1] + at[2];
                    c == low || c == low | 4 >> axis
                };
                touches(a) && touches(b)
            });
            assert!(shared.into_iter().all(|c| c == 0 || c == 3));
        }
    }

    #[test]
    fn triangles_face_away_from_the_inside() {
        // One inside corner: the triangle's normal must point away from it.
        for corner in 0..8 {
            let triangles = CaseTable::get().triangles(1 << corner);
            assert_eq!(triangles.len(), 1);
            let p = triangles[0].map(|e| {
                let (axis, at) = edge_place(e as usize);
                let mut p = DVec3::new(at[0] as f64, at[1] as f64, at[2] as f64);
                p[axis] = 0.5;
                p
            });
            let c = DVec3::new(
                (corner >> 2) as f64,
                (corner >> 1 & 1) as f64,
                (corner & 1) as f64,
            );
            assert!(
                (p[1] - p[0]).cross(p[2] - p[0]).dot(p[0] - c) > 0.0,
                "corner {corner}"
            );
        }
    }

    /// Whether the segment `pq` passes through the inside of a triangle.
    fn pierces(p: DVec3, q: DVec3, t: [DVec3; 3]) -> bool {
        let volume = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| (b - a).cross(c - a).dot(d - a);
        if volume(t[0], t[1], t[2], p) * volume(t[0], t[1], t[2], q) >= 0.0 {
            return false;
        }
        let turns = [0, 1, 2].map(|i| volume(p, q, t[i], t[(i + 1) % 3]));
        turns.iter().all(|&v| v > 0.0) || turns.iter().all(|&v| v < 0.0)
    }

    #[test]
    fn triangles_of_a_cell_do_not_pass_through_each_other() {
        let across = [DVec3::ZERO, DVec3::X, DVec3::Y];
        assert!(pierces(
            DVec3::new(0.2, 0.2, -1.0),
            DVec3::new(0.2, 0.2, 1.0),
            across
        ));
        assert!(!pierces(
            DVec3::new(0.7, 0.7, -1.0),
            DVec3::new(0.7, 0.7, 1.0),
            across
        ));
        let mut state = 1u64;
        let mut random = || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            ((state >> 11) as f64 / (1u64 << 53) as f64).clamp(1e-3, 1.0 - 1e-3)
        };
        for case in 0..256 {
            let triangles = CaseTable::get().triangles(case);
            for _ in 0..400 {
                let vertices: [DVec3; 12] = std::array::from_fn(|e| {
                    let (axis, at) = edge_place(e);
                    let mut p = DVec3::from_array(at.map(|x| x as f64));
                    p[axis] = random();
                    p
                });
                for s in triangles {
                    for t in triangles {
                        for i in 0..3 {
                            let side = [s[i], s[(i + 1) % 3]];
                            let [p, q] = side.map(|e| vertices[e as usize]);
                            let apart = !t.contains(&side[0]) && !t.contains(&side[1]);
                            let pierced = apart && pierces(p, q, t.map(|e| vertices[e as usize]));
                            assert!(!pierced, "case {case}: {s:?} and {t:?}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn table_is_small() {
        let most = (0..256).map(|c| CaseTable::get().count(c)).max();
        assert_eq!(most, Some(5));
        assert_eq!(
            CaseTable::get().triangles(0).len() + CaseTable::get().triangles(255).len(),
            0
        );
    }
}
