//! The coarsest level: the whole box, straight from the signed distance.

use glam::DVec3;
use rayon::prelude::*;

use super::distance::{Distance, MeshDistance};
use crate::points::BASE_DEPTH;
use crate::points::full_grid::FullGrid;

/// Signed distances at the knots of the base level and one beyond on every side, z fastest, and the coefficients.
pub(crate) struct Base {
    /// Distances at knots `-2 ..= n+2` of each axis.
    pub knots: Vec<Distance>,
    pub grid: FullGrid<f64>,
}

/// Knots along an axis, two beyond the box on both sides.
pub(crate) const KNOTS: usize = (1 << BASE_DEPTH) + 5;

/// The cubic quasi-interpolant `c = d - (1/6) Σ_a δ_aa d`, which reproduces cubics \[Boor73\] and, unlike an interpolant, carries no crease of the distance farther
/// than two cells.
pub(crate) fn base(mesh: &MeshDistance) -> Base {
    let h = 1.0 / (1u64 << BASE_DEPTH) as f64;
    let place = |x: usize, y: usize, z: usize| (DVec3::new(x as f64, y as f64, z as f64) - 2.0) * h;
    let knots: Vec<Distance> = (0..KNOTS * KNOTS)
        .into_par_iter()
        .flat_map_iter(|row| {
            let (x, y) = (row / KNOTS, row % KNOTS);
            let mut last: Option<(DVec3, Distance)> = None;
            (0..KNOTS)
                .map(|z| {
                    let p = place(x, y, z);
                    let found = mesh.at(p, last.as_ref().map(|(q, d)| (*q, d)));
                    last = Some((p, found));
                    found
                })
                .collect::<Vec<_>>()
        })
        .collect();
    let value = |x: usize, y: usize, z: usize| knots[(x * KNOTS + y) * KNOTS + z].value;
    let mut grid = FullGrid::zeros(1 << BASE_DEPTH);
    let m = grid.width();
    for x in 0..m {
        for y in 0..m {
            for z in 0..m {
                // Slot s holds function s - 1, which is centred on knot s - 1: knot index s + 1 here.
                let (i, j, k) = (x + 1, y + 1, z + 1);
                let around = (value(i - 1, j, k) + value(i + 1, j, k))
                    + (value(i, j - 1, k) + value(i, j + 1, k))
                    + (value(i, j, k - 1) + value(i, j, k + 1));
                let here = value(i, j, k);
                grid.values[(x * m + y) * m + z] = here - (around - 6.0 * here) / 6.0;
            }
        }
    }
    Base { knots, grid }
}
