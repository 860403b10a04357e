//! What the neighbours of a point say: direction of the normal (without sign), spacing, thickness.

use std::num::NonZero;

use glam::{DMat3, DVec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use nalgebra::{Matrix3, SMatrix, SVector, SymmetricEigen};
use rayon::prelude::*;

/// Nearest neighbours among a set of points.
pub(crate) struct Neighbours<'a> {
    positions: &'a [DVec3],
    tree: ImmutableKdTree<f64, 3>,
}

/// A point's surroundings.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Surroundings {
    /// Unit normal of the local quadric, of arbitrary sign.
    pub normal: DVec3,
    /// Mean square distance to the neighbours.
    pub spread: f64,
    /// Distance of the point from the quadric of its neighbours.
    pub residual: f64,
    /// Standard error of the direction of the normal, radians: that of the slopes of the quadric.
    pub doubt: f64,
}

impl<'a> Neighbours<'a> {
    /// Over different points.
    pub fn new(positions: &'a [DVec3]) -> Self {
        let points: Vec<[f64; 3]> = positions.iter().map(|p| p.to_array()).collect();
        let tree = ImmutableKdTree::new_from_slice(&points).expect("there are points, all of them finite");
        Self { positions, tree }
    }

    /// The `count` nearest to `at` with their squared distances, nearest first.
    pub fn nearest(&self, at: DVec3, count: usize) -> impl Iterator<Item = (usize, f64)> {
        let count = NonZero::new(count.min(self.positions.len())).expect("a positive number of neighbours");
        self.tree
            .query(&at.to_array())
            .nearest_n::<SquaredEuclidean<f64>>(count)
            .execute()
            .into_iter()
            .map(|n| (n.item as usize, n.distance))
    }

    /// The surroundings of every point from its `count` nearest.
    pub fn surroundings(&self, count: usize) -> Vec<Surroundings> {
        self.positions
            .par_iter()
            .with_min_len(256)
            .map(|&p| {
                let near: Vec<(DVec3, f64)> = self
                    .nearest(p, count + 1)
                    .map(|(j, d2)| (self.positions[j] - p, d2))
                    .collect();
                surroundings(&near)
            })
            .collect()
    }
}

/// From the offsets of the neighbours, the point itself first.
fn surroundings(near: &[(DVec3, f64)]) -> Surroundings {
    let around = &near[1.min(near.len())..];
    let n = around.len() as f64;
    let reach2 = around.last().map_or(0.0, |p| p.1);
    if reach2 <= 0.0 {
        return Surroundings::default();
    }
    let mean = near.iter().map(|p| p.0).sum::<DVec3>() / near.len() as f64;
    let mut moments = DMat3::ZERO;
    for (d, _) in near {
        let d = *d - mean;
        moments += DMat3::from_cols(d * d.x, d * d.y, d * d.z);
    }
    let eigen = SymmetricEigen::new(Matrix3::from_column_slice(&moments.to_cols_array()));
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let [normal, e1, e2] = order.map(|i| DVec3::from_slice(eigen.eigenvectors.column(i).as_slice()));
    let (tilt, height, doubt) = quadric(around, reach2, [e1, e2, normal]).unwrap_or((DVec3::Z, 0.0, 1.0));
    Surroundings {
        normal: (e1 * tilt.x + e2 * tilt.y + normal * tilt.z).normalize_or(normal),
        spread: around.iter().map(|p| p.1).sum::<f64>() / n,
        residual: height.abs(),
        doubt,
    }
}

/// Normal (in the frame), height at the origin and standard error of the slopes of the height field `h(x, y)` of second degree that is nearest
/// to the points, with Gaussian weights of a standard deviation of half the reach.
fn quadric(around: &[(DVec3, f64)], reach2: f64, [e1, e2, e3]: [DVec3; 3]) -> Option<(DVec3, f64, f64)> {
    if around.len() < 8 {
        return None;
    }
    let scale = reach2.sqrt();
    let (mut matrix, mut right, mut square, mut total) = (
        SMatrix::<f64, 6, 6>::zeros(),
        SVector::<f64, 6>::zeros(),
        0.0,
        0.0,
    );
    for (d, d2) in around {
        let (x, y, z) = (d.dot(e1) / scale, d.dot(e2) / scale, d.dot(e3) / scale);
        let weight = (-2.0 * d2 / reach2).exp();
        let row = SVector::from([1.0, x, y, x * x, x * y, y * y]);
        let weighted = row * weight;
        for i in 0..6 {
            for j in 0..=i {
                matrix[(i, j)] += weighted[i] * row[j];
            }
            right[i] += weighted[i] * z;
        }
        square += weight * z * z;
        total += weight;
    }
    let trace = matrix.trace();
    for i in 0..6 {
        matrix[(i, i)] += 1e-9 * trace;
    }
    let factor = matrix.cholesky()?;
    let h = factor.solve(&right);
    // As for points of equal weights, of which as many count as the weights add up to.
    let variance = (square - h.dot(&right)).max(0.0) / (total * (1.0 - 6.0 / around.len() as f64)).max(1e-9);
    let inverse = factor.inverse();
    let doubt = (variance * (inverse[(1, 1)] + inverse[(2, 2)])).sqrt();
    Some((DVec3::new(-h[1], -h[2], 1.0), h[0] * scale, doubt))
}
