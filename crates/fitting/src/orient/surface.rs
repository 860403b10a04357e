//! What the neighbours tell of the surface: directions of normals, areas, noise.

use glam::DVec3;

use crate::points::noise;

use super::local::{Neighbours, Surroundings};
use super::outliers;

/// Neighbours of a clean point.
const NEIGHBOURS: usize = 16;
/// Neighbours of a noisy point, fewest and most; between, a disc of four standard deviations.
const NOISY_NEIGHBOURS: [f64; 2] = [30.0, 400.0];
/// Share of the diagonal below which noise does not matter; as for fits.
const NEGLIGIBLE_NOISE: f64 = 1e-4;
/// Widths of the first and the last round and of the whole cloud's field, as multiples of the local spacing.
const WIDTHS_BY_SPACING: [f64; 3] = [4.0, 0.7, 0.7];
/// The same by the standard deviation of the noise; the larger counts.
const WIDTHS_BY_NOISE: [f64; 3] = [10.0, 2.5, 2.5];
/// Standard error of a direction, radians, at which it counts half. On a scan that thins out to a thirtieth 0.1, 0.03 and
/// 0.01 leave 1.53, 1.34 and 1.22 u in the median (1.64 if all are trusted).
const SURE: f64 = 0.03;

/// What is known of the surface before any sign.
pub(crate) struct Surface {
    pub around: Vec<Surroundings>,
    /// Area that each point stands for, unit box.
    pub areas: Vec<f32>,
    /// Standard deviation of the noise, unit box.
    pub noise: Option<f64>,
}

impl Surface {
    /// Of `points`, from which those beside the surface are taken out, as from `kept`.
    pub fn estimate(points: &mut Vec<DVec3>, kept: &mut Vec<usize>) -> Self {
        let near = Neighbours::new(points);
        let first = near.surroundings(NEIGHBOURS);
        let is_beside = outliers::beside(points, &near, &first);
        let on_surface = |i: &usize| !is_beside[*i];
        let places: Vec<usize> = (0..points.len()).filter(on_surface).collect();
        let is_whole = places.len() == points.len();
        let first: Vec<Surroundings> = places.iter().map(|&i| first[i]).collect();
        *points = places.iter().map(|&i| points[i]).collect();
        *kept = places.iter().map(|&i| kept[i]).collect();
        let near = Neighbours::new(points);
        let spacing = (total(&areas(&first, NEIGHBOURS)) / points.len() as f64).sqrt();
        let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = points.iter().fold(none, |(l, h), &p| (l.min(p), h.max(p)));
        let unknown: Option<fn(usize, usize) -> bool> = None;
        let noise = noise::of_positions(points, unknown, NEGLIGIBLE_NOISE * (high - low).length());
        let count = noise.map_or(NEIGHBOURS, |sigma| {
            let disc = std::f64::consts::PI * (4.0 * sigma / spacing).powi(2);
            disc.clamp(NOISY_NEIGHBOURS[0], NOISY_NEIGHBOURS[1]) as usize
        });
        let around = if count == NEIGHBOURS && is_whole {
            first
        } else {
            near.surroundings(count)
        };
        let count = count.min(points.len() - 1);
        Self {
            areas: areas(&around, count),
            around,
            noise,
        }
    }

    /// How far to trust the direction of the normal of point `index`, 0 to 1.
    pub fn certainty(&self, index: usize) -> f32 {
        match self.noise {
            // The first of two fits only finds the sheets, the second takes its normals from there.
            Some(_) => 1.0,
            None => (1.0 / (1.0 + (self.around[index].doubt / SURE).powi(2))) as f32,
        }
    }

    /// One of the smoothing widths for a point that stands for `area`.
    pub fn width(&self, which: usize, area: f32) -> f32 {
        let by_spacing = WIDTHS_BY_SPACING[which] as f32 * area.sqrt();
        by_spacing.max(WIDTHS_BY_NOISE[which] as f32 * self.noise.unwrap_or(0.0) as f32)
    }
}

/// `k` points in a disc of radius `r` have a mean square distance of `r²/2` from its centre.
fn areas(around: &[Surroundings], count: usize) -> Vec<f32> {
    let of = |s: &Surroundings| (std::f64::consts::TAU * s.spread / count as f64) as f32;
    around.iter().map(of).collect()
}

/// Sum of areas.
pub(crate) fn total(areas: &[f32]) -> f64 {
    areas.iter().map(|&a| f64::from(a)).sum()
}
