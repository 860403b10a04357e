//! The exterior by tagging from outside [Zhao01 §5], and normals from it.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use glam::DVec3;

use super::band::Band;

/// Edge of the smallest cells, at least, in the spacing that nine tenths of the points keep, and in standard deviations
/// of the noise. Cells of 1.6 spacings turn 3.3 % of the bunny's normals over, of 1 spacing 0.3 %.
pub(crate) const CELL_BY_SPACING: f64 = 1.0;
pub(crate) const CELL_BY_NOISE: f64 = 3.0;
/// Cells on each side of a point that vote for its sign.
const REACH: i32 = 3;

/// What a leaf was found to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Tag {
    Exterior,
    /// Reached from outside, with a neighbour farther from the points: the surface lies here.
    Boundary,
    Interior,
}

struct Reached {
    distance: f64,
    leaf: u32,
}

/// Tags every leaf.
///
/// The reached leaf farthest from the points comes first. If a leaf not reached yet beside it is as far or
/// farther, going on would cross the surface; else it is exterior and its neighbours are reached.
pub(crate) fn tag(band: &Band) -> Vec<Tag> {
    let n = band.cells.len();
    let mut tags = vec![Tag::Interior; n];
    let mut is_reached = vec![false; n];
    let mut heap = BinaryHeap::new();
    let reached = |leaf: usize| Reached {
        distance: band.distance[leaf],
        leaf: leaf as u32,
    };
    for i in (0..n).filter(|&i| band.is_rim(i)) {
        is_reached[i] = true;
        heap.push(reached(i));
    }
    while let Some(Reached { distance, leaf }) = heap.pop() {
        let i = leaf as usize;
        let beyond = |j: &&u32| !is_reached[**j as usize];
        let is_rising = band
            .neighbours(i)
            .iter()
            .filter(beyond)
            .any(|&j| band.distance[j as usize] >= distance);
        if is_rising && !band.is_rim(i) {
            tags[i] = Tag::Boundary;
            continue;
        }
        tags[i] = Tag::Exterior;
        for &j in band.neighbours(i) {
            if !std::mem::replace(&mut is_reached[j as usize], true) {
                heap.push(reached(j as usize));
            }
        }
    }
    tags
}

/// For every point (unit box) the sign of its normal, `±1`.
///
/// Exterior cells pull the normal towards them, interior ones push it away.
pub(crate) fn signs(band: &Band, tags: &[Tag], positions: &[DVec3], normals: &[DVec3]) -> Vec<f64> {
    use rayon::prelude::*;
    positions
        .par_iter()
        .zip(normals)
        .with_min_len(256)
        .map(|(&p, n)| {
            let mut vote = 0.0;
            for (i, d) in band.around(p, REACH) {
                let weight = d.dot(*n) / (1.0 + d.length_squared());
                match tags[i] {
                    Tag::Exterior => vote += weight,
                    Tag::Interior => vote -= weight,
                    Tag::Boundary => {}
                }
            }
            if vote < 0.0 { -1.0 } else { 1.0 }
        })
        .collect()
}

impl Ord for Reached {
    fn cmp(&self, other: &Self) -> Ordering {
        self.distance
            .total_cmp(&other.distance)
            .then(other.leaf.cmp(&self.leaf))
    }
}

impl PartialOrd for Reached {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Reached {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Reached {}
