//! Vertices slide along the surface until their triangles are even.

use glam::DVec3;
use rayon::prelude::*;

use super::edges::Edges;
use super::state::{State, sagitta};
use crate::Field;

/// Vertices asked together.
const BATCH: usize = 1024;

/// Share of its longest edge that a vertex may be from the surface: farther, it is left where it is.
const REACH: f64 = 0.25;

/// Share of the tolerance that is added to every chord error.
const FLOOR: f64 = 0.1;

/// Cosine between a triangle's normals before and after, below which its corners go back.
const TURN: f64 = 0.3;

/// Puts every free vertex onto the surface by one step of Newton's method and takes the normals there.
///
/// Vertices whose gradient leads too far away are held from then on.
pub(super) fn project(field: &dyn Field, iso: f64, edges: &Edges, state: &mut State) {
    let targets = state.positions.to_vec();
    step(field, iso, edges, state, targets);
}

/// One round: every free vertex moves to the mean of the centroids round it, weighted by area and the square root of the
/// chord error, along its tangent plane, and onto the surface.
pub(super) fn relax(field: &dyn Field, iso: f64, edges: &Edges, state: &mut State) {
    let parts: Vec<(DVec3, f64)> = edges
        .triangles
        .par_iter()
        .with_min_len(BATCH)
        .map(|&[a, b, c]| {
            let [a, b, c] = [a as usize, b as usize, c as usize];
            let (p, q, r) = (state.positions[a], state.positions[b], state.positions[c]);
            let (l, m, n) = (state.normals[a], state.normals[b], state.normals[c]);
            let error = sagitta(p, q, l, m)
                .max(sagitta(q, r, m, n))
                .max(sagitta(r, p, n, l));
            let area = (q - p).cross(r - p).length();
            ((p + q + r) / 3.0, area * (error + FLOOR * state.tolerance).sqrt())
        })
        .collect();
    let targets = (0..state.positions.len() as u32)
        .into_par_iter()
        .with_min_len(BATCH)
        .map_init(Vec::new, |ring, v| {
            let p = state.positions[v as usize];
            if state.held[v as usize] {
                return p;
            }
            let (sum, weight) = edges
                .ring(v, ring)
                .iter()
                .map(|&h| parts[h as usize / 3])
                .fold((DVec3::ZERO, 0.0), |(sum, weight), (c, w)| {
                    (sum + c * w, weight + w)
                });
            if weight > 0.0 {
                let n = state.normals[v as usize];
                let d = sum / weight - p;
                p + (d - n * n.dot(d))
            } else {
                p
            }
        })
        .collect();
    step(field, iso, edges, state, targets);
}

fn normal(p: &[DVec3], a: u32, b: u32, c: u32) -> DVec3 {
    let [a, b, c] = [p[a as usize], p[b as usize], p[c as usize]];
    (b - a).cross(c - a)
}

/// Moves the free vertices to the feet of `targets`; takes back what would turn a triangle over.
fn step(field: &dyn Field, iso: f64, edges: &Edges, state: &mut State, targets: Vec<DVec3>) {
    let mut answers = vec![(0.0, DVec3::ZERO); targets.len()];
    targets
        .par_chunks(BATCH)
        .zip(answers.par_chunks_mut(BATCH))
        .for_each(|(points, answers)| field.values_gradients(points, answers));
    let moved: Vec<(DVec3, DVec3)> = (0..targets.len() as u32)
        .into_par_iter()
        .with_min_len(BATCH)
        .map_init(Vec::new, |ring, v| {
            let i = v as usize;
            let stay = (state.positions[i], state.normals[i]);
            if state.held[i] {
                return stay;
            }
            let longest = edges
                .ring(v, ring)
                .iter()
                .map(|&h| {
                    (state.positions[edges.triangles[h as usize / 3][(h as usize + 1) % 3] as usize]
                        - state.positions[i])
                        .length_squared()
                })
                .fold(0.0, f64::max)
                .sqrt();
            let (value, gradient) = answers[i];
            let slope = gradient.length();
            let distance = (value - iso) / slope;
            // Not a number fails this test too.
            if distance.abs() <= REACH * longest {
                let normal = -gradient / slope;
                (targets[i] + normal * distance, normal)
            } else {
                stay
            }
        })
        .collect();
    let mut back = vec![false; moved.len()];
    for round in 0..2 {
        let at = |v: u32| {
            let i = v as usize;
            if back[i] { state.positions[i] } else { moved[i].0 }
        };
        let turned: Vec<[u32; 3]> = edges
            .triangles
            .par_iter()
            .with_min_len(BATCH)
            .filter(|t| {
                // What went back may turn only the triangles beside it.
                if round > 0 && !t.iter().any(|&v| back[v as usize]) {
                    return false;
                }
                let [a, b, c] = **t;
                let was = normal(state.positions, a, b, c);
                let is = (at(b) - at(a)).cross(at(c) - at(a));
                let dot = was.dot(is);
                dot < 0.0 || dot * dot < TURN * TURN * was.length_squared() * is.length_squared()
            })
            .copied()
            .collect();
        if turned.is_empty() {
            break;
        }
        for &v in turned.as_flattened() {
            back[v as usize] = true;
        }
    }
    for (i, (p, n)) in moved.into_iter().enumerate() {
        if !back[i] {
            (state.positions[i], state.normals[i]) = (p, n);
        }
    }
}
