//! Vertices moved along their normals, so that the triangles lie on the surface on average and not their corners.

use glam::DVec3;
use rayon::prelude::*;

use super::edges::Edges;
use super::state::State;
use crate::Field;

/// Triangles asked together.
const BATCH: usize = 1024;

/// Steps towards a mean distance of nothing round every vertex.
const STEPS: usize = 2;

/// What a vertex moves by over what would bring the mean to nothing: the 95th percentile of the distances at centres and
/// sides is least from 1.05 to 1.1, and smooth surfaces, which round off convex edges, come nearer to what they were
/// fitted to (bunny, 108 k triangles: 1.60 u from the points with 1, 1.57 with 1.1).
const BEYOND: f64 = 1.1;

/// Moves each free vertex by the mean signed distance of the triangles round it, in two steps.
///
/// The distance of a triangle to the surface is taken for a quadratic: its mean is three quarters of that at the centroid
/// and a twelfth of that at each corner. Moving the corners by `h` along their normals moves the centroid by their mean,
/// so the field is asked once. (The arcs of the normals tell the same without it, at 2 % more error.)
pub(super) fn offset(field: &dyn Field, iso: f64, edges: &Edges, state: &mut State) {
    let mut measured = vec![(0.0, 0.0); edges.triangles.len()];
    edges
        .triangles
        .par_chunks(BATCH)
        .zip(measured.par_chunks_mut(BATCH))
        .for_each_init(
            || (Vec::new(), Vec::new()),
            |(centroids, answers), (triangles, measured)| {
                let corners = |t: &[u32; 3]| t.map(|v| state.positions[v as usize]);
                centroids.clear();
                centroids.extend(triangles.iter().map(|t| {
                    let [p, q, r] = corners(t);
                    (p + q + r) / 3.0
                }));
                answers.resize(centroids.len(), (0.0, DVec3::ZERO));
                field.values_gradients(centroids, answers);
                for ((t, &(value, gradient)), measured) in triangles.iter().zip(&*answers).zip(measured) {
                    let [p, q, r] = corners(t);
                    let area = (q - p).cross(r - p).length();
                    // Outside is positive, as the normals are.
                    let distance = (iso - value) / gradient.length();
                    // Not a number fails this test too.
                    if distance * distance < area {
                        *measured = (distance, area);
                    }
                }
            },
        );
    let mut height = vec![0.0; state.positions.len()];
    for _ in 0..STEPS {
        // Triangle after triangle, so that sums round a vertex have one order.
        let mut sums = vec![(0.0, 0.0); height.len()];
        for (t, (distance, area)) in edges.triangles.iter().zip(&measured) {
            let corners: f64 = t.iter().map(|&v| height[v as usize]).sum();
            // Three quarters of what the centroid has moved, a third of the sum, and a twelfth of it.
            let mean = 0.75 * distance + corners / 3.0;
            for &v in t {
                let (sum, weight) = &mut sums[v as usize];
                *sum += area * mean;
                *weight += area;
            }
        }
        for (v, (sum, weight)) in sums.into_iter().enumerate() {
            if !state.held[v] && weight > 0.0 {
                height[v] -= sum / weight;
            }
        }
    }
    for (v, &h) in height.iter().enumerate() {
        state.positions[v] += state.normals[v] * (BEYOND * h);
    }
}
