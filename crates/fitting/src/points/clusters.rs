//! Samples merged for the coarse levels: one entry per half-cell and octant of the normal.

use glam::DVec3;

use super::samples::Samples;
use crate::level::full_operator::Cluster;

/// Clusters for the grid with `2^depth` cells: half-cells are cells of `depth + 1`.
pub(crate) fn clusters(samples: &Samples, depth: usize) -> Vec<Cluster> {
    let entries = samples
        .positions
        .iter()
        .zip(&samples.normals)
        .zip(&samples.weights);
    merge(
        entries
            .filter(|(_, w)| **w > 0.0)
            .map(|((p, n), w)| (*p, DVec3::from(n.map(f64::from)), f64::from(*w))),
        depth,
    )
}

/// The clusters of the next coarser grid, from those of this one (which are in Morton order).
pub(crate) fn coarser(finer: &[Cluster], depth: usize) -> Vec<Cluster> {
    merge(finer.iter().map(|c| (c.position, c.normal, c.count)), depth)
}

/// Weighs clusters by the samples of their half-cell where these are fewer than in the median cluster's.
pub(crate) fn doubt_the_sparse(clusters: &mut [Cluster]) {
    let mut counts: Vec<f64> = clusters.iter().map(in_half_cell).collect();
    if counts.is_empty() {
        return;
    }
    let middle = counts.len() / 2;
    let usual = *counts.select_nth_unstable_by(middle, f64::total_cmp).1;
    for c in clusters {
        c.weight *= (in_half_cell(c) / usual).min(1.0);
    }
}

/// Samples of the half-cell of a cluster.
fn in_half_cell(cluster: &Cluster) -> f64 {
    0.25 * cluster.count / cluster.weight
}

fn merge(entries: impl Iterator<Item = (DVec3, DVec3, f64)>, depth: usize) -> Vec<Cluster> {
    let n = (2u64 << depth) as f64;
    let mut out = Vec::new();
    let mut bins = [(DVec3::ZERO, DVec3::ZERO, 0.0f64); 8];
    let mut current = [u32::MAX; 3];
    let mut flush = |bins: &mut [(DVec3, DVec3, f64); 8]| {
        let total: f64 = bins.iter().map(|b| b.2).sum();
        for (position, normal, count) in bins.iter().filter(|b| b.2 > 0.0) {
            out.push(Cluster {
                position: *position / *count,
                normal: *normal / *count,
                count: *count,
                weight: 0.25 * count / total,
            });
        }
        *bins = [(DVec3::ZERO, DVec3::ZERO, 0.0); 8];
    };
    for (position, normal, count) in entries {
        let cell = (position * n).to_array().map(|x| x as u32);
        if cell != current {
            flush(&mut bins);
            current = cell;
        }
        let octant = (0..3).map(|a| usize::from(normal[a] < 0.0) << a).sum::<usize>();
        let bin = &mut bins[octant];
        *bin = (bin.0 + position * count, bin.1 + normal * count, bin.2 + count);
    }
    flush(&mut bins);
    out
}
