//! How noisy the positions are: residuals of local quadrics.

use std::num::NonZero;

use glam::{DMat3, DVec3};
use kiddo::SquaredEuclidean;
use nalgebra::{DMatrix, DVector, Matrix3, SymmetricEigen};

use super::samples::Samples;
use super::support::{self, Tree};

/// Points at which a quadric is fitted.
const QUERIES: usize = 256;
/// The first neighbourhood; each further one is twice as large.
const NEIGHBOURS: usize = 30;
/// Largest neighbourhood of a surface. Beyond, the shape is seen, unless the points fill a volume: where the cloud is
/// dense even the neighbourhoods that reach across the noise hold thousands.
const OF_A_SURFACE: usize = 480;
/// Points that a quadric is fitted to; of more they are taken at equal steps of their order by distance.
const FITTED: usize = OF_A_SURFACE;
/// Reach of a neighbourhood in standard deviations: noise has to be seen from so far ...
const REACH: f64 = 3.0;
/// ... and below this reach points fill a volume.
const THICK: f64 = 4.0;
/// Growth of the residual from one neighbourhood to the next that still counts as level. On clean scans the
/// residual is the shape's own third order and grows by 1.4 to 2; with noise of 0.5 % it grows by 1.06 to 1.16
/// once the neighbourhood spans the noise.
const LEVEL: f64 = 1.17;
/// Cosine between normals above which two samples lie on the same wall.
const SAME_WALL: f32 = 0.3;
/// Kurtosis of heights that part into two walls: 1 for equal ones, 1.8 for an evenly filled slab, 3 for noise.
const TWO_WALLS: f64 = 1.8;
/// Growth that shows at once that shape, not noise, is seen.
const SHAPE: f64 = 1.35;

/// Estimated standard deviation of the positions along the normal, unit box; `None` where the residual of
/// quadrics keeps growing with the neighbourhood or stays under `negligible`.
///
/// The neighbourhood has to reach three standard deviations: in a smaller one the noise bends the principal
/// plane and hides part of itself.
pub(crate) fn estimate(samples: &Samples, tree: &Tree, negligible: f64) -> Option<f64> {
    // The other wall of a thin part is no noise of this one, nor are points without weight.
    let same_wall = |i: usize, j: usize| {
        let live = samples.weights[i] > 0.0 && samples.weights[j] > 0.0;
        live && dot(samples.normals[i], samples.normals[j]) > SAME_WALL
    };
    quadrics(&samples.positions, tree, Some(same_wall), negligible)
}

/// The same of bare positions, where `same_wall(i, j)` tells whether point `j` near point `i` may belong to its
/// surface. Without it, places where the heights fall into two walls are passed over.
pub(crate) fn of_positions(
    positions: &[DVec3],
    same_wall: Option<impl Fn(usize, usize) -> bool>,
    negligible: f64,
) -> Option<f64> {
    quadrics(positions, &support::tree(positions)?, same_wall, negligible)
}

fn quadrics(
    points: &[DVec3],
    tree: &Tree,
    same_wall: Option<impl Fn(usize, usize) -> bool>,
    negligible: f64,
) -> Option<f64> {
    let stride = points.len().div_ceil(QUERIES);
    let mut previous: Option<f64> = None;
    let mut fills_volume = false;
    let mut k = NEIGHBOURS;
    while 4 * k <= points.len() && (k <= OF_A_SURFACE || fills_volume) {
        let count = NonZero::new(k).expect("not zero");
        let mut found: Vec<(f64, f64)> = (0..points.len())
            .step_by(stride)
            .filter(|&i| same_wall.as_ref().is_none_or(|same| same(i, i)))
            .filter_map(|i| {
                let near = tree
                    .query(&points[i].to_array())
                    .nearest_n::<SquaredEuclidean<f64>>(count)
                    .execute();
                let reach = f64::sqrt(near.last()?.distance);
                let around: Vec<DVec3> = near
                    .iter()
                    .step_by(k.div_ceil(FITTED))
                    .map(|n| n.item as usize)
                    .filter(|&j| same_wall.as_ref().is_none_or(|same| same(i, j)))
                    .map(|j| points[j])
                    .collect();
                let (residual, kurtosis) = quadric_residual(&around)?;
                (same_wall.is_some() || kurtosis > TWO_WALLS).then_some((residual, reach))
            })
            .collect();
        if found.is_empty() {
            return None;
        }
        let middle = found.len() / 2;
        let sigma = found
            .select_nth_unstable_by(middle, |a, b| a.0.total_cmp(&b.0))
            .1
            .0;
        let reach = found
            .select_nth_unstable_by(middle, |a, b| a.1.total_cmp(&b.1))
            .1
            .1;
        if sigma < negligible {
            return None;
        }
        match previous.map(|p| sigma / p) {
            Some(growth) if growth > SHAPE => return None,
            Some(growth) if growth < LEVEL && reach >= REACH * sigma => return Some(sigma),
            _ => previous = Some(sigma),
        }
        fills_volume = reach < THICK * sigma;
        k *= 2;
    }
    None
}

/// Root mean square distance of points to their best quadric height field over their principal plane,
/// corrected for its six degrees of freedom; and the kurtosis of these distances.
fn quadric_residual(points: &[DVec3]) -> Option<(f64, f64)> {
    let n = points.len();
    if n < 12 {
        return None;
    }
    let mean = points.iter().sum::<DVec3>() / n as f64;
    let mut moments = DMat3::ZERO;
    for p in points {
        let d = *p - mean;
        moments += DMat3::from_cols(d * d.x, d * d.y, d * d.z);
    }
    let eigen = SymmetricEigen::new(Matrix3::from_column_slice(&moments.to_cols_array()));
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let [normal, e1, e2] = order.map(|i| DVec3::from_slice(eigen.eigenvectors.column(i).as_slice()));
    let size = (eigen.eigenvalues[order[2]] / n as f64).sqrt();
    if size <= 0.0 {
        return None;
    }
    let rows = DMatrix::from_fn(n, 6, |i, j| {
        let d = (points[i] - mean) / size;
        let (x, y) = (d.dot(e1), d.dot(e2));
        [1.0, x, y, x * x, x * y, y * y][j]
    });
    let heights = DVector::from_fn(n, |i, _| (points[i] - mean).dot(normal));
    let fit = rows.tr_mul(&rows).cholesky()?.solve(&rows.tr_mul(&heights));
    let rest = heights - rows * fit;
    let square = rest.norm_squared();
    let fourth: f64 = rest.iter().map(|r| r.powi(4)).sum();
    Some((
        (square / (n as f64 - 6.0)).sqrt(),
        n as f64 * fourth / (square * square),
    ))
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantoms::SplitMix64;

    /// Points over a bent patch of 1 × 1, so many that 480 neighbours lie within two standard deviations.
    fn patch(noise: f64) -> Vec<DVec3> {
        let mut random = SplitMix64::new(7);
        (0..60_000)
            .map(|_| {
                let p = random.uniform3();
                DVec3::new(p.x, p.y, 0.2 * p.x * p.x) + noise * random.normal3()
            })
            .collect()
    }

    #[test]
    fn noise_is_found_however_dense_the_cloud_and_none_where_there_is_none() {
        let all = Some(|_: usize, _: usize| true);
        for noise in [0.003, 0.01, 0.03] {
            let found = of_positions(&patch(noise), all, 1e-4).expect("noise");
            assert!((found / noise - 1.0).abs() < 0.2, "{found} for {noise}");
        }
        assert_eq!(of_positions(&patch(0.0), all, 1e-4), None);
    }
}
