//! Conditions half way between neighbouring samples, for levels whose cells are finer than the spacing of the samples.
//!
//! There a sum over the samples no longer stands for the integral over the surface: each sample gets its normal, and
//! the surface swings between them. So each pair of neighbours asks for the mean of its two normals where the cubic
//! that leaves both along their tangent planes has its middle (Vlachos, Peters, Boyd and Mitchell, *Curved PN
//! Triangles*, 2001).

use std::num::NonZero;

use bspline::Real;
use glam::{DVec3, Vec3};
use kiddo::SquaredEuclidean;
use rayon::prelude::*;

use super::cells::Cell;
use super::samples::Samples;
use super::support;
use crate::level::band::{Band, halo_start, key_of};
use crate::level::band_problem::BandSample;
use crate::level::stencil::Spot;

/// Neighbours that a sample is paired with: in a triangulation it has six.
const NEIGHBOURS: usize = 6;
/// Cosine between normals from which two samples lie on one sheet.
const SAME_SHEET: f64 = 0.5;
/// Height of a neighbour over the tangent plane, in distances to it, up to which it lies on the same sheet.
const BESIDE: f64 = 0.5;

/// A condition on the gradient alone.
#[derive(Clone, Copy, Debug)]
struct Between {
    /// Unit box.
    position: Vec3,
    /// Outward unit normal.
    normal: Vec3,
    weight: f32,
    /// Share of the part of the gradient across the normal.
    certainty: f32,
    /// The two samples.
    ends: [u32; 2],
    /// Their distance, unit box.
    distance: f32,
}

/// Bytes a condition takes while its samples are paired, and later.
pub(crate) const BYTES: usize = 2 * size_of::<Between>();

/// What lies between some of the samples.
#[derive(Debug, Default)]
pub(crate) struct Neighbours {
    between: Vec<Between>,
    /// Mean distance of each sample to its neighbours, unit box; infinite where none were looked for.
    pub spacing: Vec<f32>,
}

impl Neighbours {
    /// Neighbours of the samples in `ranges`.
    pub fn of(samples: &Samples, ranges: impl Iterator<Item = std::ops::Range<u32>>) -> Self {
        let mut spacing = vec![f32::INFINITY; samples.positions.len()];
        let Some(tree) = support::tree(&samples.positions) else {
            return Self {
                between: Vec::new(),
                spacing,
            };
        };
        let is_usable = |i: u32| samples.weights[i as usize] > 0.0 && !samples.is_sign_condition(i as usize);
        let asked: Vec<u32> = ranges.flatten().filter(|&i| is_usable(i)).collect();
        let count = NonZero::new(NEIGHBOURS + 1).expect("not zero");
        let near: Vec<([u32; NEIGHBOURS], f32)> = asked
            .par_iter()
            .with_min_len(1024)
            .map(|&i| {
                let found = tree
                    .query(&samples.positions[i as usize].to_array())
                    .nearest_n::<SquaredEuclidean<f64>>(count)
                    .execute();
                let mut others = found.iter().filter(|n| n.item != i);
                let mut sum = 0.0;
                let near = std::array::from_fn(|_| {
                    others.next().map_or(i, |n| {
                        sum += n.distance.sqrt();
                        n.item
                    })
                });
                (near, (sum / NEIGHBOURS as f64) as f32)
            })
            .collect();
        drop(tree);
        let mut pairs: Vec<(u32, u32)> = Vec::with_capacity(NEIGHBOURS * asked.len());
        for (&i, (others, mean)) in asked.iter().zip(&near) {
            spacing[i as usize] = *mean;
            let usable = others.iter().filter(|&&j| j != i && is_usable(j));
            pairs.extend(usable.map(|&j| (i.min(j), i.max(j))));
        }
        drop(near);
        pairs.par_sort_unstable();
        pairs.dedup();
        let between = pairs
            .iter()
            .filter_map(|&(a, b)| between(samples, a as usize, b as usize))
            .collect();
        Self { between, spacing }
    }

    /// The conditions of a level, those whose samples are farther apart than its cells are wide and one of which lies in
    /// a cell that was refined, sorted by brick, and where those of each brick start (with one start past the last).
    pub fn by_brick<T: Real>(&self, band: &Band<T>, cells: &[Cell]) -> (Vec<u32>, Vec<u32>) {
        let mut is_refined = vec![false; self.spacing.len()];
        for cell in cells.iter().filter(|c| c.refined) {
            is_refined[cell.start as usize..cell.end as usize].fill(true);
        }
        let n = (1u64 << band.depth) as f64;
        let mut starts = vec![0u32; band.keys.len() + 2];
        let mut last = ([u32::MAX; 3], None);
        let mut met: Vec<(u32, u32)> = Vec::new();
        for (i, b) in self.between.iter().enumerate() {
            if f64::from(b.distance) * n < 1.0 || !b.ends.iter().any(|&i| is_refined[i as usize]) {
                continue;
            }
            let key = key_of((b.position.as_dvec3() * n).to_array().map(|x| x as u32));
            if key != last.0 {
                last = (key, band.find(key));
            }
            if let Some(brick) = last.1 {
                met.push((brick as u32, i as u32));
                starts[brick + 2] += 1;
            }
        }
        for b in 2..starts.len() {
            starts[b] += starts[b - 1];
        }
        let mut order = vec![0u32; met.len()];
        for (brick, i) in met {
            let to = &mut starts[brick as usize + 1];
            order[*to as usize] = i;
            *to += 1;
        }
        starts.pop();
        (order, starts)
    }

    /// Condition `index` on the level with `n` cells along the box, `weight` times as heavy as a gradient at a sample.
    pub fn condition<T: Real>(&self, index: u32, n: f64, weight: f64) -> BandSample<T> {
        let b = &self.between[index as usize];
        let q = b.position.as_dvec3() * n;
        BandSample {
            spot: Spot {
                start: halo_start(q.to_array().map(|x| x as u32)),
                t: (q - q.floor()).to_array().map(T::from_f64),
            },
            weight: T::zero(),
            gradient_weight: T::from_f64(f64::from(b.weight) * weight),
            tangential: T::from_f64(f64::from(b.certainty)),
            target: T::zero(),
            normal: b.normal.as_dvec3().to_array().map(T::from_f64),
        }
    }
}

/// The condition between samples `a` and `b`, if they lie on one sheet.
fn between(samples: &Samples, a: usize, b: usize) -> Option<Between> {
    let way = samples.positions[b] - samples.positions[a];
    let [na, nb] = [a, b].map(|k| DVec3::from(samples.normals[k].map(f64::from)));
    let (up, down) = (way.dot(na), -way.dot(nb));
    let distance = way.length();
    if na.dot(nb) <= SAME_SHEET || up.abs().max(down.abs()) > BESIDE * distance {
        return None;
    }
    let middle = (samples.positions[a] + samples.positions[b]) * 0.5;
    Some(Between {
        position: (middle - (na * up + nb * down) / 8.0).as_vec3(),
        normal: (na + nb).normalize().as_vec3(),
        weight: samples.weights[a].min(samples.weights[b]),
        certainty: samples.certainty[a].min(samples.certainty[b]),
        ends: [a as u32, b as u32],
        distance: distance as f32,
    })
}

#[cfg(test)]
mod tests {
    use super::super::samples::OrientedPoints;
    use super::*;

    /// Points spread evenly over two spheres round the origin that face away from each other.
    fn shells() -> Samples {
        let (mut positions, mut normals) = (Vec::new(), Vec::new());
        for (radius, sign) in [(1.0, 1.0), (0.97, -1.0)] {
            for i in 0..4000 {
                let z = 1.0 - (2.0 * f64::from(i) + 1.0) / 4000.0;
                let (sin, cos) = libm::sincos(2.399_963_229_728_653 * f64::from(i));
                let r = (1.0 - z * z).sqrt();
                let n = DVec3::new(r * cos, r * sin, z);
                positions.push(n * radius);
                normals.push(n * sign);
            }
        }
        let cloud = OrientedPoints {
            positions: &positions,
            normals: &normals,
            certainty: None,
        };
        Samples::prepare(cloud).expect("two good shells")
    }

    #[test]
    fn conditions_lie_half_way_on_the_sheet_of_their_samples() {
        let samples = shells();
        let all = 0..samples.positions.len() as u32;
        let found = Neighbours::of(&samples, std::iter::once(all));
        assert!(
            2 * found.between.len() > 3 * samples.positions.len(),
            "{}",
            found.between.len()
        );
        for b in &found.between {
            let p = samples.origin + b.position.as_dvec3() * samples.scale;
            let n = b.normal.as_dvec3();
            let radius = if n.dot(p) > 0.0 { 1.0 } else { 0.97 };
            // The cubic is wrong by the fourth power of the distance, 0.06; f32 by less.
            assert!((p.length() - radius).abs() < 2e-5, "{}", p.length());
            assert!(n.dot(p).abs() > 0.9999 * p.length(), "{n} at {p}");
        }
        let mut pairs: Vec<[u32; 2]> = found.between.iter().map(|b| b.ends).collect();
        pairs.sort_unstable();
        pairs.dedup();
        assert_eq!(pairs.len(), found.between.len(), "each pair once");
    }
}
