//! Parts so small that the cells of the first grid do not show them.
//!
//! All that such a cell learns of a ball that lies within it is that the values are 0 and that the normals cancel: the level is near 0 about
//! the ball, and its sign is chance. So what lies round the part decides about the first grid there, and the samples speak on the levels
//! whose cells show the part.

use std::collections::BTreeMap;

use glam::DVec3;

use crate::level::full_operator::Cluster;

/// Largest size of such a part on any axis, in cells.
const SMALL: f64 = 0.6;
/// Length of the sum of a part's normals over their number up to which it is closed: all of a closed surface cancel.
const OPEN: f64 = 0.3;
/// Distance from the part, in cells, that is taken for a coefficient beside it, at least.
const LEAST: f64 = 0.1;

/// One of them.
pub(crate) struct SmallPart {
    /// Its clusters.
    pub clusters: Vec<usize>,
    /// Its cells on the first grid.
    pub cells: Vec<[usize; 3]>,
    /// Its size on the axis where it is largest, unit box.
    pub size: f64,
}

impl SmallPart {
    /// The first level whose cells show it.
    pub fn shown_from(&self) -> usize {
        (SMALL / self.size).log2().ceil() as usize
    }

    /// How far a place of the first grid is from it, of `n` cells.
    pub fn distance(&self, data: &[Cluster], x: DVec3, n: usize) -> f64 {
        let squares = self
            .clusters
            .iter()
            .map(|i| data[*i].position.distance_squared(x));
        squares.fold(f64::INFINITY, f64::min).sqrt().max(LEAST / n as f64)
    }
}

/// The small parts that are closed, on a level of `n` cells.
pub(super) fn small_parts(data: &[Cluster], n: usize) -> Vec<SmallPart> {
    let at = |p: DVec3| (p * n as f64).to_array().map(|x| (x as usize).min(n - 1));
    let index = |[x, y, z]: [usize; 3]| (x * n + y) * n + z;
    // The clusters of a cell, until they belong to a part.
    let mut by_cell: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (i, c) in data.iter().enumerate() {
        by_cell.entry(index(at(c.position))).or_default().push(i);
    }
    let mut found = Vec::new();
    for c in data {
        let start = at(c.position);
        let Some(mut clusters) = by_cell.remove(&index(start)) else {
            continue;
        };
        let mut cells = vec![start];
        let mut next = 0;
        while next < cells.len() {
            for beside in about(cells[next], n) {
                if let Some(more) = by_cell.remove(&index(beside)) {
                    clusters.extend(more);
                    cells.push(beside);
                }
            }
            next += 1;
        }
        let own = || clusters.iter().map(|i| &data[*i]);
        let low = own().fold(DVec3::INFINITY, |low, c| low.min(c.position));
        let high = own().fold(DVec3::NEG_INFINITY, |high, c| high.max(c.position));
        let open = own().map(|c| c.count * c.normal).sum::<DVec3>().length();
        let all = own().map(|c| c.count * c.normal.length()).sum::<f64>();
        let size = (high - low).max_element();
        if size * n as f64 <= SMALL && open <= OPEN * all {
            found.push(SmallPart {
                clusters,
                cells,
                size,
            });
        }
    }
    found
}

/// The cells about one that are there.
fn about(cell: [usize; 3], n: usize) -> impl Iterator<Item = [usize; 3]> {
    let beside = move |step: usize| {
        let at: [usize; 3] = std::array::from_fn(|a| {
            cell[a]
                .wrapping_add(step / 3usize.pow(a as u32) % 3)
                .wrapping_sub(1)
        });
        at.iter().all(|x| *x < n).then_some(at)
    };
    (0..27).filter_map(beside)
}
