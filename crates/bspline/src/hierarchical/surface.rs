//! Which level the surface is evaluated at, where.

use rayon::prelude::*;

use super::brick::{BRICK, HALO, HALO_LEN};
use super::node::Node;
use super::spline::HierarchicalSpline;
use crate::Real;

/// Nodes of a brick's cells on an axis.
const NODES: usize = BRICK + 1;

impl<T: Real> HierarchicalSpline<T> {
    /// For each level, the cells of that level that the surface `{ f = iso }` crosses and that no finer level covers.
    ///
    /// A cell counts as crossed if `f > iso` at some of its corners, but not at all. Costs one value at each knot of the
    /// bricks that their hulls cannot exclude.
    pub fn crossed_cells(&self, iso: f64) -> Vec<u64> {
        let mut levels: Vec<Vec<&Node<T>>> = vec![Vec::new(); self.level_count()];
        self.root.walk(&mut |node| {
            if node.totals.is_some() {
                levels[node.level as usize].push(node);
            }
            node.holds_cells()
        });
        levels
            .iter()
            .enumerate()
            .map(|(level, bricks)| {
                let limit = self.lattice().cells_at(level);
                bricks
                    .par_iter()
                    .with_min_len(64)
                    .map(|brick| crossed_in(brick, limit, iso))
                    .sum()
            })
            .collect()
    }

    /// The finest level on which, or on finer ones, at least `share` (0 to 1) of the area of the surface `{ f = iso }`
    /// lies; 0 if there is no surface.
    ///
    /// Two cells to each of its knot intervals mesh that share of the surface as exactly as a mesh along the finest
    /// knots would, without the cells that a few deep spots would ask for everywhere.
    pub fn level_of_surface(&self, iso: f64, share: f64) -> usize {
        // Area of a cell in units of the finest ones'.
        let finest = self.level_count() - 1;
        let crossed = self.crossed_cells(iso).into_iter().enumerate();
        let areas: Vec<f64> = crossed
            .map(|(level, n)| n as f64 * 4f64.powi((finest - level) as i32))
            .collect();
        let whole: f64 = areas.iter().sum();
        let mut finer = 0.0;
        for level in (1..=finest).rev() {
            finer += areas[level];
            if finer > 0.0 && finer >= share * whole {
                return level;
            }
        }
        0
    }
}

/// Crossed cells of a brick that it evaluates itself.
fn crossed_in<T: Real>(brick: &Node<T>, limit: [u32; 3], iso: f64) -> u64 {
    let iso = T::from_f64(iso);
    let is_covered = (0..8).all(|octant| brick.child(octant).is_some());
    if is_covered || brick.hull[1] <= iso || brick.hull[0] > iso {
        return 0;
    }
    let inside = knots_inside(brick.own_totals(), iso);
    let cells: [usize; 3] =
        std::array::from_fn(|a| (limit[a] - BRICK as u32 * brick.key.0[a]).min(BRICK as u32) as usize);
    let mut crossed = 0;
    for x in 0..cells[0] {
        for y in 0..cells[1] {
            let rows = [(x, y), (x, y + 1), (x + 1, y), (x + 1, y + 1)].map(|(x, y)| inside[x * NODES + y]);
            let any = rows.iter().fold(0, |a, b| a | b);
            let all = rows.iter().fold(!0, |a, b| a & b);
            let open = (any | any >> 1) & !(all & all >> 1);
            for z in 0..cells[2] {
                let octant = 4 * (x / 4) + 2 * (y / 4) + z / 4;
                crossed += u64::from(open >> z & 1 == 1 && brick.child(octant).is_none());
            }
        }
    }
    crossed
}

/// Bit `z` of row `9x + y`: whether the knot lies inside. At a knot the three functions about it weigh 1, 4 and 1.
fn knots_inside<T: Real>(totals: &[T; HALO_LEN], iso: T) -> [u16; NODES * NODES] {
    let four = T::from_f64(4.0);
    let iso = iso * T::from_f64(216.0);
    let mut rows = [0u16; NODES * NODES];
    let mut plane = [T::zero(); HALO * HALO];
    let mut line = [T::zero(); HALO];
    for x in 0..NODES {
        let at = |i: usize| &totals[(x + i) * HALO * HALO..][..HALO * HALO];
        let (a, b, c) = (at(0), at(1), at(2));
        for i in 0..HALO * HALO {
            plane[i] = a[i] + four * b[i] + c[i];
        }
        for y in 0..NODES {
            for z in 0..HALO {
                let at = |j: usize| plane[(y + j) * HALO + z];
                line[z] = at(0) + four * at(1) + at(2);
            }
            for z in 0..NODES {
                let value = line[z] + four * line[z + 1] + line[z + 2];
                rows[x * NODES + y] |= u16::from(value > iso) << z;
            }
        }
    }
    rows
}
