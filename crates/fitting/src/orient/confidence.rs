//! How certain the signs are, and where they are not.

use bspline::hierarchical::Lattice;
use glam::DVec3;
use rustc_hash::FxHashMap;

use crate::Leaf;

use super::UNSURE;
use super::cloud::Cloud;
use super::kernel::{Target, Winding};
use super::surface::Surface;
use super::tree::Tree;

/// Distance of the two places where the winding number is asked, in local spacings and in standard deviations of
/// the noise; the larger counts.
const ASIDE: [f64; 2] = [1.5, 3.0];
/// Smoothing there, as a share of the distance.
const WIDTH: f64 = 0.4;
/// Cells along the box in which doubtful points are gathered.
const PLACES: f64 = 16.0;
/// Fewest doubtful points worth a sentence.
const WORTH_TELLING: usize = 10;
/// Most sentences.
const MOST_TOLD: usize = 5;

/// Winding numbers beside a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sides {
    inner: f32,
    outer: f32,
}

impl Sides {
    /// `2 min(w(x − δn) − ½, ½ − w(x + δn))`, clamped to 0 to 1: 1 where one side is inside and the other outside beyond
    /// doubt, 0 where both sides are alike, as on an open sheet.
    pub fn confidence(&self) -> f32 {
        (2.0 * (self.inner - 0.5).min(0.5 - self.outer)).clamp(0.0, 1.0)
    }

    /// With every normal turned over.
    pub fn turned(&self) -> Self {
        Self {
            inner: -self.outer,
            outer: -self.inner,
        }
    }
}

/// The winding numbers on both sides of every point.
pub(super) fn sides(points: &[DVec3], normals: &[DVec3], surface: &Surface) -> Vec<Sides> {
    let single: Vec<[f32; 3]> = points.iter().map(|p| p.as_vec3().to_array()).collect();
    let strengths: Vec<[f32; 3]> = normals
        .iter()
        .zip(&surface.areas)
        .map(|(n, &a)| (n.as_vec3() * a).to_array())
        .collect();
    let tree = Tree::new(single, &surface.areas);
    let side = |sign: f64| {
        let at: Vec<Target> = (0..points.len())
            .map(|i| {
                let by_noise = ASIDE[1] * surface.noise.unwrap_or(0.0);
                let aside = (ASIDE[0] * f64::from(surface.areas[i]).sqrt()).max(by_noise);
                Target {
                    position: (points[i] + normals[i] * (sign * aside)).as_vec3().to_array(),
                    width: (WIDTH * aside) as f32,
                }
            })
            .collect();
        tree.sum(&Winding, &strengths, &at, tree.leaves())
    };
    let (inner, outer) = (side(-1.0), side(1.0));
    inner
        .into_iter()
        .zip(outer)
        .map(|(inner, outer)| Sides { inner, outer })
        .collect()
}

/// Sentences with the boxes of the largest clusters of unsure points: cells of the box that hold any and share a face.
pub(super) fn places(cloud: &Cloud, kept: &[usize], confidence: &[f32]) -> Vec<String> {
    let mut cells: FxHashMap<[i32; 3], Vec<u32>> = FxHashMap::default();
    let mut order = Vec::new();
    for (&i, _) in kept.iter().zip(confidence).filter(|c| *c.1 < UNSURE) {
        let cell = (cloud.positions[i] * PLACES).to_array().map(|x| x as i32);
        let members = cells.entry(cell).or_insert_with(|| {
            order.push(cell);
            Vec::new()
        });
        members.push(i as u32);
    }
    let mut clusters: Vec<Vec<u32>> = Vec::new();
    for start in order {
        let Some(mut cluster) = cells.remove(&start) else {
            continue;
        };
        let mut open = vec![start];
        while let Some(c) = open.pop() {
            for axis in 0..3 {
                for step in [-1, 1] {
                    let mut beside = c;
                    beside[axis] += step;
                    if let Some(more) = cells.remove(&beside) {
                        cluster.extend(more);
                        open.push(beside);
                    }
                }
            }
        }
        clusters.push(cluster);
    }
    clusters.retain(|c| c.len() >= WORTH_TELLING);
    clusters.sort_by_key(|c| std::cmp::Reverse(c.len()));
    clusters
        .iter()
        .take(MOST_TOLD)
        .map(|c| {
            let (low, high) = c
                .iter()
                .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), &i| {
                    let p = cloud.world(i as usize);
                    (l.min(p), h.max(p))
                });
            format!("{} points of unsure sign between {low:.4} and {high:.4}", c.len())
        })
        .collect()
}

/// Mean confidence of the points in each leaf of a fit on `lattice`; 1 where there are none.
pub fn leaf_confidence(
    leaves: &[Leaf],
    lattice: &Lattice,
    positions: &[DVec3],
    confidence: &[f32],
) -> Vec<f32> {
    let lattice_from_world = lattice.world_from_lattice.inverse();
    let mut index: FxHashMap<(u8, [u32; 3]), usize> = FxHashMap::default();
    let mut levels: Vec<u8> = Vec::new();
    for (i, leaf) in leaves.iter().enumerate() {
        index.insert((leaf.level, leaf.cell), i);
        if !levels.contains(&leaf.level) {
            levels.push(leaf.level);
        }
    }
    levels.sort_unstable();
    let mut sums = vec![(0.0f64, 0u32); leaves.len()];
    for (p, c) in positions.iter().zip(confidence) {
        let at = lattice_from_world.transform_point3(*p);
        if !at.is_finite() || at.min_element() < 0.0 {
            continue;
        }
        for &level in &levels {
            let cell = (at * f64::from(1u32 << level)).to_array().map(|x| x as u32);
            if let Some(&i) = index.get(&(level, cell)) {
                sums[i].0 += f64::from(*c);
                sums[i].1 += 1;
                break;
            }
        }
    }
    sums.into_iter()
        .map(|(sum, n)| if n == 0 { 1.0 } else { (sum / f64::from(n)) as f32 })
        .collect()
}
