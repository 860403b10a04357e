//! The coarsest level: the whole box, straight from the signed distance.

use glam::DVec3;
use rayon::prelude::*;

use super::distance::{Distance, MeshDistance};
use super::packet::PLACES;
use crate::level::BASE_DEPTH;
use crate::level::full_grid::FullGrid;

/// Signed distances at the knots of the base level and one beyond on every side, z fastest, and the coefficients.
pub(crate) struct Base {
    /// Distances at knots `-2 ..= n+2` of each axis.
    pub knots: Vec<Distance>,
    pub grid: FullGrid<f64>,
}

/// Knots along an axis, two beyond the box on both sides.
pub(crate) const KNOTS: usize = (1 << BASE_DEPTH) + 5;
const BLOCKS: usize = KNOTS.div_ceil(2);

/// The cubic quasi-interpolant `c = d - (1/6) Σ_a δ_aa d`, which reproduces cubics \[Boor73\] and, unlike an interpolant, carries no crease of the distance farther
/// than two cells.
pub(crate) fn base(mesh: &MeshDistance) -> Base {
    let h = 1.0 / (1u64 << BASE_DEPTH) as f64;
    let place = |x: usize, y: usize, z: usize| (DVec3::new(x as f64, y as f64, z as f64) - 2.0) * h;
    // Blocks of eight, along z one after the other.
    let blocks: Vec<[Distance; PLACES]> = (0..BLOCKS * BLOCKS)
        .into_par_iter()
        .flat_map_iter(|row| {
            let (x, y) = (2 * (row / BLOCKS), 2 * (row % BLOCKS));
            let mut last: Option<(DVec3, Distance)> = None;
            let found = (0..BLOCKS).map(|k| {
                let places = std::array::from_fn(|i| place(x + (i >> 2), y + (i >> 1 & 1), 2 * k + (i & 1)));
                let found = mesh.at_eight(&places, last.as_ref().map(|(p, d)| (*p, d)));
                last = Some((places[PLACES - 1], found[PLACES - 1]));
                found
            });
            found.collect::<Vec<_>>()
        })
        .collect();
    let knots: Vec<Distance> = (0..KNOTS.pow(3))
        .map(|i| {
            let [x, y, z] = [i / (KNOTS * KNOTS), i / KNOTS % KNOTS, i % KNOTS];
            let block = ((x / 2) * BLOCKS + y / 2) * BLOCKS + z / 2;
            blocks[block][4 * (x % 2) + 2 * (y % 2) + z % 2]
        })
        .collect();
    let value = |x: usize, y: usize, z: usize| knots[(x * KNOTS + y) * KNOTS + z].value();
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
