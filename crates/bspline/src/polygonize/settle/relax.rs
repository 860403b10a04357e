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
    let mut longest = vec![0.0; state.positions.len()];
    for t in edges.triangles.iter() {
        let [p, q, r] = t.map(|v| state.positions[v as usize]);
        reach(&mut longest, t, [p, q, r]);
    }
    let targets = state.positions.to_vec();
    step(field, iso, edges, state, targets, &longest);
}

/// Raises the squares of the longest edges at the corners of a triangle.
#[inline(always)]
fn reach(longest: &mut [f64], t: &[u32; 3], [p, q, r]: [DVec3; 3]) {
    let [pq, qr, rp] = [
        p.distance_squared(q),
        q.distance_squared(r),
        r.distance_squared(p),
    ];
    for (v, d) in t.iter().zip([pq.max(rp), pq.max(qr), qr.max(rp)]) {
        let slot = &mut longest[*v as usize];
        *slot = slot.max(d);
    }
}

/// One round: every free vertex moves to the mean of the centroids round it, weighted by area and the square root of the
/// chord error, along its tangent plane, and onto the surface.
pub(super) fn relax(field: &dyn Field, iso: f64, edges: &Edges, state: &mut State) {
    let weights: Vec<f64> = edges
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
            area * (error + FLOOR * state.tolerance).sqrt()
        })
        .collect();
    // Triangle after triangle, so that sums round a vertex have one order.
    let mut sums = vec![(DVec3::ZERO, 0.0); state.positions.len()];
    let mut longest = vec![0.0; state.positions.len()];
    for (t, weight) in edges.triangles.iter().zip(&weights) {
        let [p, q, r] = t.map(|v| state.positions[v as usize]);
        let center = (p + q + r) * (weight / 3.0);
        for &v in t {
            let (sum, total) = &mut sums[v as usize];
            *sum += center;
            *total += *weight;
        }
        reach(&mut longest, t, [p, q, r]);
    }
    drop(weights);
    let targets = (0..state.positions.len())
        .map(|v| {
            let (p, n) = (state.positions[v], state.normals[v]);
            let (sum, weight) = sums[v];
            if state.held[v] || weight.is_nan() || weight <= 0.0 {
                return p;
            }
            let d = sum / weight - p;
            p + (d - n * n.dot(d))
        })
        .collect();
    drop(sums);
    step(field, iso, edges, state, targets, &longest);
}

fn normal(p: &[DVec3], a: u32, b: u32, c: u32) -> DVec3 {
    let [a, b, c] = [p[a as usize], p[b as usize], p[c as usize]];
    (b - a).cross(c - a)
}

/// Moves the free vertices to the feet of `targets`; takes back what would turn a triangle over.
///
/// `longest` are the squares of the longest edges at each vertex.
fn step(field: &dyn Field, iso: f64, edges: &Edges, state: &mut State, targets: Vec<DVec3>, longest: &[f64]) {
    // The feet take the place of the targets.
    let mut feet = targets;
    let mut facing = vec![DVec3::ZERO; feet.len()];
    let State {
        positions,
        normals,
        held,
        ..
    } = state;
    feet.par_chunks_mut(BATCH)
        .zip(facing.par_chunks_mut(BATCH))
        .enumerate()
        .for_each_init(Vec::new, |answers, (n, (feet, facing))| {
            answers.resize(feet.len(), (0.0, DVec3::ZERO));
            field.values_gradients(feet, answers);
            for (k, (foot, to)) in feet.iter_mut().zip(facing).enumerate() {
                let i = n * BATCH + k;
                let (value, gradient) = answers[k];
                let slope = gradient.length();
                let distance = (value - iso) / slope;
                // Not a number fails this test too.
                (*foot, *to) = if !held[i] && distance.abs() <= REACH * longest[i].sqrt() {
                    let normal = -gradient / slope;
                    (*foot + normal * distance, normal)
                } else {
                    (positions[i], normals[i])
                };
            }
        });
    let mut back = vec![false; feet.len()];
    for round in 0..2 {
        let at = |v: u32| {
            let i = v as usize;
            if back[i] { state.positions[i] } else { feet[i] }
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
    for (i, (p, n)) in feet.into_iter().zip(facing).enumerate() {
        if !back[i] {
            (state.positions[i], state.normals[i]) = (p, n);
        }
    }
}
