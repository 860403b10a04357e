//! What of a field and of a grid an answer was made from, and whether any of it has changed.

use bspline::Aabb;
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

/// Where a field has changed, and where nodes beside the surface have.
pub struct Changes {
    grid: Grid,
    /// Round cells in which the field has changed, also beyond the grid.
    cells: Hull,
    boxes: Vec<Hull>,
    /// Round all.
    all: Hull,
    region: Region,
    /// Marks before each place of the region on all axes.
    sums: Vec<u32>,
}

impl Changes {
    /// Of boxes of the world outside which a field has the bits that it had.
    pub fn new(grid: &Grid, changed: &[Aabb]) -> Self {
        let hull = |b: &Aabb| {
            let mut hull = Hull::NONE;
            hull.add_place(grid.spacing, b.min - 1e-6 * grid.spacing);
            hull.add_place(grid.spacing, b.max + 1e-6 * grid.spacing);
            hull
        };
        let boxes: Vec<Hull> = changed.iter().map(hull).collect();
        let cells = boxes.iter().fold(Hull::NONE, |all, b| all.with(b));
        Self::of(grid, cells, boxes, &[])
    }

    /// With nodes, by their places in lists.
    pub fn with(self, nodes: &[usize]) -> Self {
        Self::of(&self.grid, self.cells, self.boxes, nodes)
    }

    /// Of nodes alone.
    pub fn of_nodes(grid: &Grid, nodes: &[usize]) -> Self {
        Self::of(grid, Hull::NONE, Vec::new(), nodes)
    }

    fn of(grid: &Grid, cells: Hull, boxes: Vec<Hull>, nodes: &[usize]) -> Self {
        let mut all = cells;
        nodes
            .iter()
            .for_each(|slot| all.add(grid.number(grid.node(*slot))));
        let region = all.region(grid);
        let [nx, ny, nz] = region.count();
        let (sy, sx) = (nz + 1, (ny + 1) * (nz + 1));
        let mut sums = vec![0u32; (nx + 1) * sx];
        let place = |at: [usize; 3]| {
            let [x, y, z]: [usize; 3] = std::array::from_fn(|a| at[a] - region.lo[a] + 1);
            x * sx + y * sy + z
        };
        if !region.is_empty() {
            for b in &boxes {
                for (at, slots) in b.region(grid).rows(grid) {
                    let start = place(at);
                    sums[start..start + slots.len()].fill(1);
                }
            }
            nodes.iter().for_each(|slot| sums[place(grid.node(*slot))] = 1);
            for at in sx..sums.len() {
                if at % sx < sy || at % sy == 0 {
                    continue;
                }
                let row = sums[at] + sums[at - 1] + sums[at - sx] - sums[at - sx - 1];
                sums[at] =
                    row + sums[at - sy] - sums[at - sy - 1] - sums[at - sx - sy] + sums[at - sx - sy - 1];
            }
        }
        Self {
            grid: *grid,
            cells,
            boxes,
            all,
            region,
            sums,
        }
    }

    /// Round all that has changed.
    pub fn hull(&self) -> &Hull {
        &self.all
    }

    /// Whether what a hull stands for has changed, or may have.
    pub fn touch(&self, hull: &Hull) -> bool {
        if !hull.meets(&self.all) {
            return false;
        }
        if !hull.is_within(&self.grid) && hull.meets(&self.cells) {
            return true;
        }
        let own = hull.region(&self.grid);
        let lo: [usize; 3] = std::array::from_fn(|a| own.lo[a].max(self.region.lo[a]));
        let end: [usize; 3] = std::array::from_fn(|a| own.end[a].min(self.region.end[a]));
        if (0..3).any(|a| lo[a] >= end[a]) {
            return false;
        }
        let [_, ny, nz] = self.region.count();
        let (sy, sx) = (nz + 1, (ny + 1) * (nz + 1));
        let at = |x: usize, y: usize, z: usize| self.sums[x * sx + y * sy + z];
        let [x, y, z]: [usize; 3] = std::array::from_fn(|a| lo[a] - self.region.lo[a]);
        let [u, v, w]: [usize; 3] = std::array::from_fn(|a| end[a] - self.region.lo[a]);
        let near = at(u, v, w) + at(u, y, z) + at(x, v, z) + at(x, y, w);
        near != at(x, v, w) + at(u, y, w) + at(u, v, z) + at(x, y, z)
    }
}
