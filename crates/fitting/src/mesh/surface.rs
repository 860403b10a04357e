//! Which triangles bound the solid `{ w > 1/2 }`, and which way they face.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::MeshDefects;
use super::crossings::crossings;
use super::normals::Normals;
use super::pieces::boundary_pieces;
use super::sides::Sides;
use super::topology::{Faces, area_vector};
use super::tree::TriangleTree;
use super::winding::WindingTree;
use crate::FitError;

/// Triangles of a sheet or patch whose sides are looked at.
const LOOKS: usize = 32;
/// Rounds of turning sheets over; each sees the sheets as the one before left them.
const ROUNDS: usize = 4;
/// An open sheet bounds something where the mean of the winding number on its two sides keeps so far from 0 and 1: of a
/// lone sheet it is 0, of a closed surface 1/2, in the middle of half a sphere 0.35.
const BOUNDS_SOMETHING: f64 = 0.1;

/// The surface of the solid, and what tells inside from outside.
pub(crate) struct Surface {
    /// Triangles and parts of triangles that have the solid on one side and not on the other.
    pub boundary: Arc<TriangleTree>,
    /// Normals of its triangles, edges and corners, where they are sure to tell inside from outside.
    pub normals: Normals,
    /// All triangles that count for the winding number.
    pub winding: WindingTree,
    /// The rim of its holes; none if the winding number is a whole number off the surface.
    pub rim: Option<Rim>,
}

/// Edges at which the surface ends.
pub(crate) struct Rim {
    /// Edges, as triangles whose last two corners coincide.
    edges: TriangleTree,
    /// Boxes of the tree that together hold all edges, and the length in each, every edge as often as it is passed
    /// more one way than the other.
    parts: Vec<(u32, f64)>,
}

/// Turns whole sheets the right way out, leaves out what bounds nothing, and finds the boundary of the solid.
///
/// # Errors
/// [`FitError::Degenerate`] if no triangle bounds a solid.
pub(crate) fn surface(faces: &mut Faces, defects: &mut MeshDefects) -> Result<Surface, FitError> {
    let mut face_of: Vec<u32> = (0..faces.corners.len() as u32)
        .filter(|&f| faces.has_area(f as usize))
        .collect();
    let by_sheet = grouped(&face_of, faces.sheet_count, |f| faces.sheets[f as usize]);
    let open = open_sheets(faces);
    let mut winding = winding_of(faces, &face_of);
    for _ in 0..ROUNDS {
        let wrong: Vec<usize> = (0..faces.sheet_count)
            .into_par_iter()
            .filter(|&s| mean_side(faces, &winding, &by_sheet[s]) < -BOUNDS_SOMETHING)
            .collect();
        if wrong.is_empty() {
            break;
        }
        defects.inside_out += wrong.len();
        let mut turn = vec![false; faces.sheet_count];
        for &s in &wrong {
            turn[s] = true;
        }
        for f in 0..faces.corners.len() {
            if turn[faces.sheets[f] as usize] {
                faces.flip(f);
            }
        }
        winding = winding_of(faces, &face_of);
    }
    let idle: Vec<bool> = (0..faces.sheet_count)
        .into_par_iter()
        .map(|s| {
            let middle = mean_side(faces, &winding, &by_sheet[s]);
            open[s] && !(BOUNDS_SOMETHING..=1.0 - BOUNDS_SOMETHING).contains(&middle)
        })
        .collect();
    if idle.contains(&true) {
        let before = face_of.len();
        face_of.retain(|&f| !idle[faces.sheets[f as usize] as usize]);
        defects.unbounding_faces = before - face_of.len();
        if face_of.is_empty() {
            return Err(bounds_nothing(defects));
        }
        winding = winding_of(faces, &face_of);
    }
    let rim = rim(faces, &idle);
    let tree_faces: Vec<u32> = winding.tree.ids.iter().map(|&i| face_of[i as usize]).collect();
    let found = crossings(faces, &winding.tree, &tree_faces);
    defects.self_intersections = found.pairs;
    defects.intersections_sampled = found.sampled;
    let boundary = boundary(faces, &face_of, &winding, &found.partners, defects);
    let (triangles, known): (Vec<_>, Vec<_>) = boundary.into_iter().unzip();
    if triangles.is_empty() {
        return Err(bounds_nothing(defects));
    }
    let all = triangles.len() == face_of.len() && defects.interior_faces == 0;
    let tree = if all {
        Arc::clone(&winding.tree)
    } else {
        Arc::new(TriangleTree::new(&triangles))
    };
    let normals = Normals::new(faces, &tree, &face_of, |id| known[id as usize]);
    Ok(Surface {
        boundary: tree,
        normals,
        winding,
        rim,
    })
}

/// Boxes of the rim that are looked at one by one.
const RIM_BOXES: usize = 256;

impl Rim {
    /// Distance to the rim, and `Σ l/(4πr²)` over its edges of length `l` at distance `r`, or more.
    pub fn seen_from(&self, p: DVec3) -> (f64, f64) {
        let nearest = self.edges.nearest(p, 0).distance_squared;
        let sum: f64 = self
            .parts
            .iter()
            .map(|(node, length)| length / self.edges.nodes[*node as usize].distance_squared(p).max(nearest))
            .sum();
        (nearest.sqrt(), sum / (4.0 * PI))
    }
}

/// Edges passed more often one way than the other, over the sheets in use.
fn rim(faces: &Faces, idle: &[bool]) -> Option<Rim> {
    let (mut edges, mut lengths) = (Vec::new(), Vec::new());
    for edge in faces.sides().chunk_by(|a, b| a.0 == b.0) {
        let used = edge.iter().filter(|s| !idle[faces.sheets[s.1 as usize] as usize]);
        let excess: i32 = used.map(|s| if s.2 { 1 } else { -1 }).sum();
        if excess != 0 {
            let ends = [edge[0].0 >> 32, edge[0].0 & 0xffff_ffff].map(|v| faces.vertices[v as usize]);
            edges.push([ends[0], ends[1], ends[1]]);
            lengths.push(f64::from(excess.abs()) * ends[0].distance(ends[1]));
        }
    }
    if edges.is_empty() {
        return None;
    }
    let edges = TriangleTree::new(&edges);
    // The first boxes, level by level.
    let mut open = vec![0u32];
    loop {
        let is_inner = |n: &u32| edges.nodes[*n as usize].count == 0;
        if open.len() >= RIM_BOXES || !open.iter().any(is_inner) {
            break;
        }
        let below = |n: u32| {
            if is_inner(&n) {
                vec![n + 1, edges.nodes[n as usize].first]
            } else {
                vec![n]
            }
        };
        open = open.into_iter().flat_map(below).collect();
    }
    let length_in = |n: u32| -> f64 {
        let (mut sum, mut stack) = (0.0, vec![n]);
        while let Some(n) = stack.pop() {
            let node = &edges.nodes[n as usize];
            if node.count == 0 {
                stack.extend([n + 1, node.first]);
            }
            let triangles = node.first..node.first + node.count;
            sum += triangles
                .map(|t| lengths[edges.ids[t as usize] as usize])
                .sum::<f64>();
        }
        sum
    };
    let parts = open.into_iter().map(|n| (n, length_in(n))).collect();
    Some(Rim { edges, parts })
}

fn bounds_nothing(defects: &MeshDefects) -> FitError {
    FitError::Degenerate(format!(
        "the {} triangles enclose nothing: their winding number is nowhere above 1/2; close the surface, or \
         fit it as a cloud",
        defects.triangles
    ))
}

fn winding_of(faces: &Faces, face_of: &[u32]) -> WindingTree {
    let triangles: Vec<[DVec3; 3]> = face_of.par_iter().map(|&f| faces.points(f as usize)).collect();
    WindingTree::new(Arc::new(TriangleTree::new(&triangles)))
}

/// Triangles by group.
fn grouped(list: &[u32], groups: usize, group_of: impl Fn(u32) -> u32) -> Vec<Vec<u32>> {
    let mut out = vec![Vec::new(); groups];
    for &f in list {
        out[group_of(f) as usize].push(f);
    }
    out
}

/// Which sheets have a rim, or an edge that joins them to others.
fn open_sheets(faces: &Faces) -> Vec<bool> {
    let mut open = vec![false; faces.sheet_count];
    for edge in faces.sides().chunk_by(|a, b| a.0 == b.0) {
        if edge.len() != 2 {
            for side in edge {
                open[faces.sheets[side.1 as usize] as usize] = true;
            }
        }
    }
    open
}

/// Mean over some triangles of a group of the winding number between their two sides; 1/2 without any.
fn mean_side(faces: &Faces, winding: &WindingTree, group: &[u32]) -> f64 {
    let stride = group.len().div_ceil(LOOKS).max(1);
    let looks = group.iter().step_by(stride);
    let count = looks.len();
    if count == 0 {
        return 0.5;
    }
    looks
        .map(|&f| sides_of(winding, &faces.points(f as usize)).middle())
        .sum::<f64>()
        / count as f64
}

fn sides_of(winding: &WindingTree, points: &[DVec3; 3]) -> Sides {
    let middle = (points[0] + points[1] + points[2]) / 3.0;
    Sides::at(winding, middle, area_vector(points).normalize_or_zero())
}

/// Triangles with the solid behind them alone, and the face that each is, if it is one that crosses no other. Triangles that
/// cross others are cut where they do.
fn boundary(
    faces: &Faces,
    face_of: &[u32],
    winding: &WindingTree,
    partners: &BTreeMap<u32, Vec<u32>>,
    defects: &mut MeshDefects,
) -> Vec<([DVec3; 3], Option<u32>)> {
    let tree = &winding.tree;
    let mut crosses = vec![false; faces.corners.len()];
    for &t in partners.keys() {
        crosses[face_of[tree.ids[t as usize] as usize] as usize] = true;
    }
    // From crossing to crossing the sides of a sheet do not change.
    let (patch_of, patch_count) = patches(faces, face_of, &crosses);
    if patch_count == 1 && partners.is_empty() {
        return face_of
            .iter()
            .map(|&f| (faces.points(f as usize), Some(f)))
            .collect();
    }
    let uncut: Vec<u32> = face_of
        .iter()
        .copied()
        .filter(|&f| !crosses[f as usize])
        .collect();
    let members = grouped(&uncut, patch_count, |f| patch_of[f as usize]);
    let kept: Vec<bool> = members
        .par_iter()
        .map(|group| {
            let stride = group.len().div_ceil(LOOKS).max(1);
            let looks = group.iter().step_by(stride);
            let count = looks.len();
            let votes = looks.filter(|&&f| sides_of(winding, &faces.points(f as usize)).is_boundary());
            2 * votes.count() >= count
        })
        .collect();
    let mut out: Vec<([DVec3; 3], Option<u32>)> = uncut
        .iter()
        .filter(|&&f| kept[patch_of[f as usize] as usize])
        .map(|&f| (faces.points(f as usize), Some(f)))
        .collect();
    defects.interior_faces = uncut.len() - out.len();
    let cuts: Vec<(Vec<[DVec3; 3]>, bool)> = partners
        .par_iter()
        .map(|(t, with)| {
            let with: Vec<[DVec3; 3]> = with.iter().map(|&p| tree.corners[p as usize]).collect();
            boundary_pieces(winding, &tree.corners[*t as usize], &with)
        })
        .collect();
    for (pieces, whole) in cuts {
        defects.interior_faces += usize::from(!whole);
        out.extend(pieces.into_iter().map(|p| (p, None)));
    }
    out
}

/// Numbers the parts of sheets that no crossing divides.
fn patches(faces: &Faces, face_of: &[u32], crosses: &[bool]) -> (Vec<u32>, usize) {
    const NONE: u32 = u32::MAX;
    let mut root: Vec<u32> = (0..faces.corners.len() as u32).collect();
    fn find(root: &mut [u32], mut v: u32) -> u32 {
        while root[v as usize] != v {
            root[v as usize] = root[root[v as usize] as usize];
            v = root[v as usize];
        }
        v
    }
    for edge in faces.sides().chunk_by(|a, b| a.0 == b.0) {
        if let [a, b] = edge
            && !crosses[a.1 as usize]
            && !crosses[b.1 as usize]
        {
            let (p, q) = (find(&mut root, a.1), find(&mut root, b.1));
            root[p.max(q) as usize] = p.min(q);
        }
    }
    let mut number = vec![NONE; root.len()];
    let mut count = 0;
    for &f in face_of {
        if crosses[f as usize] {
            continue;
        }
        let r = find(&mut root, f) as usize;
        if number[r] == NONE {
            number[r] = count;
            count += 1;
        }
        number[f as usize] = number[r];
    }
    (number, count as usize)
}
