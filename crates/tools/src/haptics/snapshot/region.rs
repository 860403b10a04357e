//! Boxes of nodes of a grid.

use std::ops::Range;

use super::grid::Grid;

/// Nodes from `lo` up to, but without, `end` on each axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    pub lo: [usize; 3],
    pub end: [usize; 3],
}

impl Region {
    /// No node.
    pub const NONE: Self = Self {
        lo: [usize::MAX; 3],
        end: [0; 3],
    };

    /// All nodes of a grid.
    pub fn whole(grid: &Grid) -> Self {
        Self {
            lo: [0; 3],
            end: grid.count,
        }
    }

    /// Whether it has no node.
    pub fn is_empty(&self) -> bool {
        (0..3).any(|a| self.lo[a] >= self.end[a])
    }

    /// With a node.
    pub fn add(&mut self, node: [usize; 3]) {
        for (a, n) in node.into_iter().enumerate() {
            self.lo[a] = self.lo[a].min(n);
            self.end[a] = self.end[a].max(n + 1);
        }
    }

    /// The least box round both.
    pub fn hull(self, other: Self) -> Self {
        if self.is_empty() {
            return other;
        }
        if other.is_empty() {
            return self;
        }
        Self {
            lo: std::array::from_fn(|a| self.lo[a].min(other.lo[a])),
            end: std::array::from_fn(|a| self.end[a].max(other.end[a])),
        }
    }

    /// With `by` more nodes on each side, as far as the grid goes.
    pub fn grown(self, by: usize, grid: &Grid) -> Self {
        if self.is_empty() {
            return Self::NONE;
        }
        Self {
            lo: self.lo.map(|n| n.saturating_sub(by)),
            end: std::array::from_fn(|a| (self.end[a] + by).min(grid.count[a])),
        }
    }

    /// Nodes on each axis.
    pub fn count(&self) -> [usize; 3] {
        std::array::from_fn(|a| self.end[a].saturating_sub(self.lo[a]))
    }

    /// Nodes.
    pub fn len(&self) -> usize {
        self.count().iter().product()
    }

    /// Whether a node is in it.
    pub fn contains(&self, node: [usize; 3]) -> bool {
        (0..3).all(|a| node[a] >= self.lo[a] && node[a] < self.end[a])
    }

    /// Its rows along z: their first nodes and their places in lists of the grid.
    pub fn rows(self, grid: &Grid) -> impl Iterator<Item = ([usize; 3], Range<usize>)> + use<> {
        let Self { lo, end } = self;
        let grid = *grid;
        let width = self.count()[2];
        let is_empty = self.is_empty();
        (lo[0]..end[0])
            .filter(move |_| !is_empty)
            .flat_map(move |x| (lo[1]..end[1]).map(move |y| [x, y, lo[2]]))
            .map(move |at| {
                let start = grid.slot(at);
                (at, start..start + width)
            })
    }
}

/// Rows round a region whose marks are never set, so that neighbours need no question whether they are there.
const SIDE: usize = 2;

/// Marks on the nodes of a region.
#[derive(Clone, Debug)]
pub struct Flags {
    region: Region,
    /// Steps to the next node on each axis.
    strides: [usize; 3],
    set: Vec<bool>,
}

impl Flags {
    /// None set.
    pub fn new(region: Region) -> Self {
        let [nx, ny, nz] = region.count().map(|n| n + 2 * SIDE);
        let all = if region.is_empty() { 0 } else { nx * ny * nz };
        Self {
            region,
            strides: [ny * nz, nz, 1],
            set: vec![false; all],
        }
    }

    /// Of a node that is at most [`SIDE`] outside.
    fn slot(&self, node: [usize; 3]) -> usize {
        (0..3)
            .map(|a| (node[a] + SIDE - self.region.lo[a]) * self.strides[a])
            .sum()
    }

    /// Sets that of a node of the region.
    pub fn set(&mut self, node: [usize; 3]) {
        let slot = self.slot(node);
        self.set[slot] = true;
    }

    /// Whether that of a node is set.
    pub fn get(&self, node: [usize; 3]) -> bool {
        self.region.contains(node) && self.set[self.slot(node)]
    }

    /// Whether that of a node or of one next to it on an axis is set.
    pub fn any_beside(&self, node: [usize; 3]) -> bool {
        let Region { lo, end } = self.region;
        if self.set.is_empty() || (0..3).any(|a| node[a] + 1 < lo[a] || node[a] > end[a]) {
            return false;
        }
        let slot = self.slot(node);
        self.set[slot]
            || self
                .strides
                .iter()
                .any(|stride| self.set[slot - stride] || self.set[slot + stride])
    }

    /// Where some may be set.
    pub fn region(&self) -> Region {
        self.region
    }
}
