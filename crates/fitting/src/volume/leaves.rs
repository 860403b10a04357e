//! Residuals per leaf.

use std::ops::Range;

use bspline::Real;

use super::axis::Axis;
use super::domain::{Domain, LEAF};

/// What the voxels of one leaf say.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct LeafResidual {
    pub sum_of_squares: f64,
    pub max: f32,
    pub count: u32,
}

impl LeafResidual {
    /// Root of the mean square residual.
    pub fn rms(&self) -> f64 {
        (self.sum_of_squares / f64::from(self.count.max(1))).sqrt()
    }
}

/// The cells of [`LEAF`] voxels that tile a volume: cells of one dyadic level. A voxel on a cell border belongs
/// to the cell above it; the very last one of an axis to the last cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LeafGrid {
    pub cells: [usize; 3],
    pub level: usize,
}

impl LeafGrid {
    pub fn new<T: Real>(domain: &Domain<T>) -> Self {
        let level = domain.levels() - 1 - LEAF.ilog2() as usize;
        // Cells that hold no voxel pad an axis at its end; they are no leaves.
        let used = |a: Axis| (a.samples - 1).div_ceil(LEAF).max(1);
        Self {
            cells: domain.axes.map(used),
            level,
        }
    }

    pub fn len(&self) -> usize {
        self.cells.iter().product()
    }

    /// Cell along axis `a` of voxel `k`.
    #[inline(always)]
    pub fn cell(&self, a: usize, k: usize) -> usize {
        (k / LEAF).min(self.cells[a] - 1)
    }

    /// Leaf of a voxel, x fastest.
    #[cfg(test)]
    pub fn leaf(&self, voxel: [usize; 3]) -> usize {
        let c = [0, 1, 2].map(|a| self.cell(a, voxel[a]));
        (c[2] * self.cells[1] + c[1]) * self.cells[0] + c[0]
    }
}

/// Collects the residuals of some planes of voxels.
pub(crate) struct LeafSums {
    grid: LeafGrid,
    first_layer: usize,
    leaves: Vec<LeafResidual>,
}

impl LeafSums {
    /// For voxel planes `planes`, not empty.
    pub fn new(grid: LeafGrid, planes: &Range<usize>) -> Self {
        let (first, last) = (grid.cell(2, planes.start), grid.cell(2, planes.end - 1));
        let leaves = vec![LeafResidual::default(); (last + 1 - first) * grid.cells[0] * grid.cells[1]];
        Self {
            grid,
            first_layer: first,
            leaves,
        }
    }

    /// Takes the residuals of row `(y, z)`.
    #[inline(always)]
    pub fn add_row<T: Real>(&mut self, y: usize, z: usize, row: &[T]) {
        let [cx, cy, _] = self.grid.cells;
        let start = ((self.grid.cell(2, z) - self.first_layer) * cy + self.grid.cell(1, y)) * cx;
        let leaves = &mut self.leaves[start..start + cx];
        let whole = (cx - 1) * LEAF;
        let (inner, last) = row.split_at(whole.min(row.len()));
        let pieces = inner.chunks_exact(LEAF).chain(std::iter::once(last));
        for (leaf, piece) in leaves.iter_mut().zip(pieces) {
            let (mut sum, mut max) = (0.0, leaf.max);
            for &v in piece {
                let v = v.as_f64();
                sum += v * v;
                let a = v.abs() as f32;
                max = if a > max { a } else { max };
            }
            leaf.sum_of_squares += sum;
            leaf.max = max;
            leaf.count += piece.len() as u32;
        }
    }

    /// Puts the parts, in their order, together.
    pub fn merge(grid: LeafGrid, parts: impl IntoIterator<Item = Self>) -> Vec<LeafResidual> {
        let mut all = vec![LeafResidual::default(); grid.len()];
        for part in parts {
            let start = part.first_layer * grid.cells[0] * grid.cells[1];
            for (a, p) in all[start..].iter_mut().zip(&part.leaves) {
                a.sum_of_squares += p.sum_of_squares;
                a.max = if p.max > a.max { p.max } else { a.max };
                a.count += p.count;
            }
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_voxel_counts_once() {
        for dims in [[1, 1, 1], [5, 6, 4], [9, 13, 101], [97, 3, 2]] {
            let domain = Domain::<f64>::new(dims, 3);
            let grid = LeafGrid::new(&domain);
            let mut expected = vec![LeafResidual::default(); grid.len()];
            let value = |x: usize, y: usize, z: usize| ((x * 31 + y * 17 + z * 7) % 23) as f64 - 11.0;
            let mut parts = Vec::new();
            for planes in (0..dims[2]).step_by(48).map(|z| z..(z + 48).min(dims[2])) {
                let mut part = LeafSums::new(grid, &planes);
                for z in planes {
                    for y in 0..dims[1] {
                        let row: Vec<f64> = (0..dims[0]).map(|x| value(x, y, z)).collect();
                        part.add_row(y, z, &row);
                        for (x, v) in row.iter().enumerate() {
                            let leaf = &mut expected[grid.leaf([x, y, z])];
                            leaf.sum_of_squares += v * v;
                            leaf.count += 1;
                            leaf.max = leaf.max.max(v.abs() as f32);
                        }
                    }
                }
                parts.push(part);
            }
            assert_eq!(
                LeafSums::merge(grid, parts),
                expected,
                "{dims:?}: small integers sum exactly"
            );
            assert_eq!(
                expected.iter().map(|l| l.count as usize).sum::<usize>(),
                dims.iter().product()
            );
        }
    }
}
