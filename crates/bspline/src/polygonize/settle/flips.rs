//! Edges turned in the quadrilateral of their two triangles.

use glam::DVec3;
use rayon::prelude::*;

use super::edges::{Edges, NONE, before, next};
use super::state::{State, sagitta};

/// When an edge is turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Rule {
    /// If the angles across from it add up to more than two right angles (Delaunay), unless the other diagonal leaves
    /// the surface much farther.
    Delaunay,
    /// If the other diagonal is nearer to the surface and no angle falls below [`LEAST_ANGLE_COT`], or the least grows.
    Error,
}

/// Edges looked at together.
const BATCH: usize = 4096;

/// Passes over the mesh; each turns the edges whose gain is the largest on both of their triangles.
const PASSES: usize = 4;

/// Cotangent of 20°.
const LEAST_ANGLE_COT: f64 = 2.747_477;

/// Turns edges by `rule`; returns how many.
pub(super) fn flip(edges: &mut Edges, state: &State, rule: Rule) -> usize {
    let half_edges = edges.twin.len() as u32;
    let mut gains: Vec<f32> = (0..half_edges)
        .into_par_iter()
        .with_min_len(BATCH)
        .map(|h| gain(edges, state, rule, h))
        .collect();
    let mut candidates: Vec<u32> = (0..half_edges).filter(|&h| gains[h as usize] > 0.0).collect();
    let mut count = 0;
    for _ in 0..PASSES {
        let chosen: Vec<u32> = candidates
            .par_iter()
            .with_min_len(BATCH)
            .copied()
            .filter(|&h| is_best(edges, &gains, h))
            .collect();
        // Half-edges whose triangles are new.
        let mut touched = Vec::with_capacity(chosen.len() * 10);
        for h in chosen {
            let g = edges.twin[h as usize];
            // Another flip of this pass may have joined the new ends, or left the old ones with few edges.
            if is_bound(edges, h) {
                continue;
            }
            edges.flip(h);
            count += 1;
            for half in [h, g].into_iter().flat_map(|h| h / 3 * 3..h / 3 * 3 + 3) {
                touched.push(half);
                touched.extend(Some(edges.twin[half as usize]).filter(|&twin| twin != NONE));
            }
        }
        if touched.is_empty() {
            break;
        }
        touched.sort_unstable();
        touched.dedup();
        let new: Vec<f32> = touched
            .par_iter()
            .with_min_len(BATCH)
            .map(|&h| gain(edges, state, rule, h))
            .collect();
        for (&h, new) in touched.iter().zip(new) {
            gains[h as usize] = new;
        }
        candidates.extend(touched);
        candidates.retain(|&h| gains[h as usize] > 0.0);
        candidates.sort_unstable();
        candidates.dedup();
    }
    count
}

/// Whether the gain of `h` is the largest of all edges of its two triangles; of equal ones the first counts.
fn is_best(edges: &Edges, gains: &[f32], h: u32) -> bool {
    let own = gains[h as usize];
    if own <= 0.0 {
        return false;
    }
    let g = edges.twin[h as usize];
    [next(h), before(h), next(g), before(g)].into_iter().all(|e| {
        let twin = edges.twin[e as usize];
        let (other, at) = if twin != NONE && gains[twin as usize] > 0.0 {
            (gains[twin as usize], twin)
        } else {
            (gains[e as usize], e)
        };
        other < own || (other == own && h < at)
    })
}

/// What turning the edge of `h` gains by `rule`; 0 for nothing. Asked of one of its two half-edges only.
fn gain(edges: &Edges, state: &State, rule: Rule, h: u32) -> f32 {
    let g = edges.twin[h as usize];
    if g == NONE {
        return 0.0;
    }
    let (a, b) = (edges.start(h), edges.start(g));
    if a > b {
        return 0.0;
    }
    let (c, d) = (edges.apex(h), edges.apex(g));
    let [a, b, c, d] = [a as usize, b as usize, c as usize, d as usize];
    let (p, n) = (&*state.positions, &state.normals);
    if state.held[a] || state.held[b] || state.held[c] || state.held[d] {
        return 0.0;
    }
    let [pa, pb, pc, pd] = [p[a], p[b], p[c], p[d]];
    // Both angles across are acute: the usual case.
    if rule == Rule::Delaunay && (pa - pc).dot(pb - pc) >= 0.0 && (pa - pd).dot(pb - pd) >= 0.0 {
        return 0.0;
    }
    let [na, nb, nc, nd] = [n[a], n[b], n[c], n[d]];
    let (now, then) = (sagitta(pa, pb, na, nb), sagitta(pc, pd, nc, nd));
    let gain = match rule {
        Rule::Delaunay => {
            let sum = cot(pc, pa, pb) + cot(pd, pa, pb);
            if then > 1.5 * now.max(state.tolerance) {
                return 0.0;
            }
            -sum - 1e-6
        }
        Rule::Error => {
            if then > 0.8 * now || now < 0.3 * state.tolerance {
                return 0.0;
            }
            let old = sharpest(pa, pb, pc).max(sharpest(pb, pa, pd));
            let new = sharpest(pa, pd, pc).max(sharpest(pb, pc, pd));
            if new > LEAST_ANGLE_COT && new > old {
                return 0.0;
            }
            now - then
        }
    };
    if gain.is_nan() || gain <= 0.0 {
        return 0.0;
    }
    // The new triangles must face the way of their vertices and not fold.
    let first = (pd - pa).cross(pc - pa);
    let second = (pc - pb).cross(pd - pb);
    let faces = |n: DVec3, m: DVec3| n.dot(m) > 0.3 * n.length() * m.length();
    if !faces(first, na + nd + nc) || !faces(second, nb + nc + nd) || first.dot(second) <= 0.0 {
        return 0.0;
    }
    if is_bound(edges, h) { 0.0 } else { gain as f32 }
}

/// Whether the edge of `h` has to stay: its ends have three edges only, or its new ends are joined already.
fn is_bound(edges: &Edges, h: u32) -> bool {
    let g = edges.twin[h as usize];
    let few = |v: u32| edges.valence(v) <= 3;
    few(edges.start(h)) || few(edges.start(g)) || edges.joined(edges.apex(h), edges.apex(g))
}

/// Cotangent of the angle at `p` in the triangle with `q` and `r`.
fn cot(p: DVec3, q: DVec3, r: DVec3) -> f64 {
    let (u, v) = (q - p, r - p);
    u.dot(v) / u.cross(v).length()
}

/// Cotangent of the smallest angle of a triangle.
fn sharpest(p: DVec3, q: DVec3, r: DVec3) -> f64 {
    cot(p, q, r).max(cot(q, r, p)).max(cot(r, p, q))
}
