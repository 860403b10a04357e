//! What of a grid an answer was made from, and whether any of it has changed.

use glam::DVec3;

use super::grid::Grid;

/// Farther than a grid is wide, also where it has moved.
const AWAY: i16 = 4000;

/// A box of cells and nodes, both by the number of their first corner in a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hull {
    lo: [i16; 3],
    hi: [i16; 3],
}

impl Hull {
    /// Of a node alone.
    pub fn of(node: [usize; 3]) -> Self {
        let at = node.map(|n| n as i16);
        Self { lo: at, hi: at }
    }

    /// With a node.
    pub fn add(&mut self, node: [usize; 3]) {
        for a in 0..3 {
            self.lo[a] = self.lo[a].min(node[a] as i16);
            self.hi[a] = self.hi[a].max(node[a] as i16);
        }
    }

    /// With the cell of a place, wherever that is.
    pub fn add_place(&mut self, grid: &Grid, p: DVec3) {
        let q = (p / grid.spacing).floor();
        for a in 0..3 {
            let cell = (q[a] - grid.first[a] as f64).clamp(f64::from(-AWAY), f64::from(AWAY)) as i16;
            self.lo[a] = self.lo[a].min(cell);
            self.hi[a] = self.hi[a].max(cell);
        }
    }

    /// The same where the grid begins `by` nodes earlier.
    pub fn moved(&self, by: [i64; 3]) -> Self {
        let corner = |of: [i16; 3]| std::array::from_fn(|a| (i64::from(of[a]) + by[a]) as i16);
        Self {
            lo: corner(self.lo),
            hi: corner(self.hi),
        }
    }

    /// Made larger than any grid.
    pub fn leave(&mut self) {
        self.lo = [-AWAY; 3];
    }

    /// The same where the grid begins `by` nodes earlier; none where it is not wholly in the grid.
    pub fn within(&self, grid: &Grid, by: [i64; 3]) -> Option<[[usize; 3]; 2]> {
        let moved = self.moved(by);
        let is_inside = |of: [i16; 3]| (0..3).all(|a| of[a] >= 0 && (of[a] as usize) < grid.count[a]);
        (is_inside(moved.lo) && is_inside(moved.hi))
            .then(|| [moved.lo, moved.hi].map(|of| of.map(|n| n as usize)))
    }
}

/// Marks on a grid, counted so that any box is looked through at once.
pub struct Marks {
    grid: Grid,
    /// Marks before each place on all axes.
    sums: Vec<u32>,
}

impl Marks {
    /// Of the places that `is_marked` by their place in lists.
    pub fn new(grid: &Grid, is_marked: impl Fn(usize) -> bool) -> Self {
        let [nx, ny, nz] = grid.count;
        let (sy, sx) = (nz + 1, (ny + 1) * (nz + 1));
        let mut sums = vec![0u32; (nx + 1) * sx];
        for x in 0..nx {
            for y in 0..ny {
                let mut row = 0;
                for z in 0..nz {
                    row += u32::from(is_marked(grid.slot([x, y, z])));
                    let at = (x + 1) * sx + (y + 1) * sy + z + 1;
                    sums[at] = row + sums[at - sx] + sums[at - sy] - sums[at - sx - sy];
                }
            }
        }
        Self { grid: *grid, sums }
    }

    /// Whether any place of a box is marked.
    pub fn any(&self, [lo, hi]: [[usize; 3]; 2]) -> bool {
        let [_, ny, nz] = self.grid.count;
        let (sy, sx) = (nz + 1, (ny + 1) * (nz + 1));
        let at = |x: usize, y: usize, z: usize| self.sums[x * sx + y * sy + z];
        let [x, y, z] = lo;
        let [u, v, w] = hi.map(|n| n + 1);
        let near = at(u, v, w) + at(u, y, z) + at(x, v, z) + at(x, y, w);
        near != at(x, v, w) + at(u, y, w) + at(u, v, z) + at(x, y, z)
    }
}
