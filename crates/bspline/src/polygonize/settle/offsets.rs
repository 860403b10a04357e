//! Vertices moved along their normals, so that the triangles lie on the surface on average and not their corners.

use glam::DVec3;
use rayon::prelude::*;

use super::edges::Edges;
use super::state::State;
use crate::Field;

const BATCH: usize = 1024;

/// Steps towards a mean distance of nothing round every vertex.
const STEPS: usize = 2;

/// Moves each free vertex by the mean signed distance of the triangles round it, in two steps.
///
/// The distance of a triangle to the surface is taken for a quadratic: its mean is three quarters of that at the centroid
/// and a twelfth of that at each corner. Moving the corners by `h` along their normals moves the centroid by their mean, so
/// the field is asked once.
pub(super) fn offset(field: &dyn Field, iso: f64, edges: &Edges, state: &mut State) {
    let mut measured = vec![(0.0, 0.0); edges.triangles.len()];
    edges
        .triangles
        .par_chunks(BATCH)
        .zip(measured.par_chunks_mut(BATCH))
        .for_each_init(
            || (Vec::new(), Vec::new()),
            |(centroids, answers), (triangles, measured)| {
                centroids.clear();
                centroids.extend(triangles.iter().map(|t| {
                    let [p, q, r] = t.map(|v| state.positions[v as usize]);
                    (p + q + r) / 3.0
                }));
                answers.resize(centroids.len(), (0.0, DVec3::ZERO));
                field.values_gradients(centroids, answers);
                for ((t, &(value, gradient)), measured) in triangles.iter().zip(&*answers).zip(measured) {
                    let [p, q, r] = t.map(|v| state.positions[v as usize]);
                    let area = (q - p).cross(r - p).length();
                    // Outside is positive, as the normals are.
                    let distance = (iso - value) / gradient.length();
                    // Not a number fails this test too.
                    *measured = if distance * distance < area {
                        (distance, area)
                    } else {
                        (0.0, 0.0)
                    };
                }
            },
        );
    let mut height = vec![0.0; state.positions.len()];
    for _ in 0..STEPS {
        let next = (0..height.len() as u32)
            .into_par_iter()
            .with_min_len(BATCH)
            .map_init(Vec::new, |ring, v| {
                let own = height[v as usize];
                if state.held[v as usize] {
                    return own;
                }
                let (sum, weight) = edges
                    .ring(v, ring)
                    .iter()
                    .map(|&h| {
                        let t = h as usize / 3;
                        let (distance, area) = measured[t];
                        let corners: f64 = edges.triangles[t].iter().map(|&v| height[v as usize]).sum();
                        // Three quarters of what the centroid has moved, a third of the sum, and a twelfth of it.
                        (area * (0.75 * distance + corners / 3.0), area)
                    })
                    .fold((0.0, 0.0), |(sum, weight), (d, w)| (sum + d, weight + w));
                if weight > 0.0 { own - sum / weight } else { own }
            })
            .collect();
        height = next;
    }
    for (v, &h) in height.iter().enumerate() {
        state.positions[v] += state.normals[v] * h;
    }
}
