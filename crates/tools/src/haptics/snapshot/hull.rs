//! What of a field and of a grid an answer was made from.

use glam::DVec3;

use super::grid::Grid;
use super::region::Region;

/// Numbers beyond any grid.
const AWAY: i32 = 1 << 29;

/// A box of cells and nodes, both by the number of their first corner in the world, both ends included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hull {
    lo: [i32; 3],
    hi: [i32; 3],
}

impl Hull {
    /// Of nothing.
    pub const NONE: Self = Self {
        lo: [AWAY; 3],
        hi: [-AWAY; 3],
    };

    /// Of a node alone.
    pub fn of(node: [i32; 3]) -> Self {
        Self { lo: node, hi: node }
    }

    /// As numbers: those of nothing known are all 0.
    pub fn pack(&self) -> [i32; 6] {
        let (a, b) = (self.lo, self.hi);
        [a[0], a[1], a[2], b[0], b[1], b[2]]
    }

    /// From numbers.
    pub fn unpack(n: &[i32; 6]) -> Self {
        Self {
            lo: [n[0], n[1], n[2]],
            hi: [n[3], n[4], n[5]],
        }
    }

    /// With a node.
    pub fn add(&mut self, node: [i32; 3]) {
        *self = self.with(&Self::of(node));
    }

    /// With the cell of a place, wherever that is.
    pub fn add_place(&mut self, spacing: f64, p: DVec3) {
        let most = f64::from(AWAY);
        let cell = (p / spacing).floor().to_array();
        self.add(cell.map(|n| n.clamp(-most, most) as i32));
    }

    /// Round both.
    pub fn with(&self, other: &Self) -> Self {
        Self {
            lo: std::array::from_fn(|a| self.lo[a].min(other.lo[a])),
            hi: std::array::from_fn(|a| self.hi[a].max(other.hi[a])),
        }
    }

    /// Made larger than any grid.
    pub fn leave(&mut self) {
        self.lo = [-AWAY; 3];
    }

    /// With `by` more on each side.
    pub fn grown(&self, by: i32) -> Self {
        Self {
            lo: self.lo.map(|n| n - by),
            hi: self.hi.map(|n| n + by),
        }
    }

    /// Whether it goes farther than `by` from a node of it.
    pub fn is_wider(&self, node: [i32; 3], by: i32) -> bool {
        (0..3).any(|a| node[a] - self.lo[a] > by || self.hi[a] - node[a] > by)
    }

    /// Whether both have a cell in common.
    pub fn meets(&self, other: &Self) -> bool {
        (0..3).all(|a| self.lo[a] <= other.hi[a] && self.hi[a] >= other.lo[a])
    }

    /// What of it is in a grid.
    pub fn region(&self, grid: &Grid) -> Region {
        let end = |n: i32, a: usize| (i64::from(n) - grid.first[a]).clamp(0, grid.count[a] as i64) as usize;
        Region {
            lo: std::array::from_fn(|a| end(self.lo[a], a)),
            end: std::array::from_fn(|a| end(self.hi[a].saturating_add(1), a)),
        }
    }

    /// Whether all of it is in a grid.
    pub fn is_within(&self, grid: &Grid) -> bool {
        (0..3).all(|a| {
            i64::from(self.lo[a]) >= grid.first[a]
                && i64::from(self.hi[a]) < grid.first[a] + grid.count[a] as i64
        })
    }
}
