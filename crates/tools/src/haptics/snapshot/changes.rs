//! Where fields and nodes beside the surface have changed, counted so that any hull is looked through at once.

use bspline::Aabb;

use super::grid::Grid;
use super::hull::Hull;
use super::region::Region;

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
