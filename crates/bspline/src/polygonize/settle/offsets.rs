//! Vertices moved along their normals, so that the triangles lie on the surface on average and not their corners.

use glam::DVec3;
use rayon::prelude::*;

use super::edges::Edges;
use super::state::State;
use crate::Field;

const BATCH: usize = 1024;

/// Moves each free vertex by the mean signed distance of the triangles round it, twice.
///
/// The distance of a triangle to the surface is taken for a quadratic: its mean is three quarters of that at the centroid
/// and a twelfth of that at each corner.
pub(super) fn offset(field: &dyn Field, iso: f64, edges: &Edges, state: &mut State) {
    let mut height = vec![0.0; state.positions.len()];
    for _ in 0..2 {
        let mut centroids = vec![DVec3::ZERO; edges.triangles.len()];
        let mut answers = vec![(0.0, DVec3::ZERO); centroids.len()];
        let mut means = vec![(0.0, 0.0); centroids.len()];
        edges
            .triangles
            .par_chunks(BATCH)
            .zip(centroids.par_chunks_mut(BATCH))
            .zip(answers.par_chunks_mut(BATCH))
            .zip(means.par_chunks_mut(BATCH))
            .for_each(|(((triangles, centroids), answers), means)| {
                for (t, c) in triangles.iter().zip(&mut *centroids) {
                    let [p, q, r] = t.map(|v| state.positions[v as usize]);
                    *c = (p + q + r) / 3.0;
                }
                field.values_gradients(centroids, answers);
                for ((t, &(value, gradient)), mean) in triangles.iter().zip(&*answers).zip(means) {
                    let [p, q, r] = t.map(|v| state.positions[v as usize]);
                    let area = (q - p).cross(r - p).length();
                    // Outside is positive, as the normals are.
                    let distance = (iso - value) / gradient.length();
                    let corners: f64 = t.iter().map(|&v| height[v as usize]).sum();
                    let d = 0.75 * distance + corners / 12.0;
                    *mean = if distance.abs() < area.sqrt() {
                        (area * d, area)
                    } else {
                        (0.0, 0.0)
                    };
                }
            });
        let moves: Vec<f64> = (0..height.len() as u32)
            .into_par_iter()
            .with_min_len(BATCH)
            .map_init(Vec::new, |ring, v| {
                if state.held[v as usize] {
                    return 0.0;
                }
                let (sum, weight) = edges
                    .ring(v, ring)
                    .iter()
                    .map(|&h| means[h as usize / 3])
                    .fold((0.0, 0.0), |(sum, weight), (d, w)| (sum + d, weight + w));
                if weight > 0.0 { -sum / weight } else { 0.0 }
            })
            .collect();
        for (v, &d) in moves.iter().enumerate() {
            height[v] += d;
            state.positions[v] += state.normals[v] * d;
        }
    }
}
