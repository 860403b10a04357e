use bspline::hierarchical::Lattice;
use glam::{DMat3, DVec3};
use rustc_hash::FxHashMap;

use crate::Leaf;

/// Finds the leaf that a point lies in.
pub struct LeafIndex {
    lattice: Lattice,
    of_cell: FxHashMap<(u8, [u32; 3]), u32>,
    levels: Vec<u8>,
}

impl LeafIndex {
    /// Index over `leaves`, cells of `lattice`.
    pub fn new(lattice: &Lattice, leaves: &[Leaf]) -> Self {
        let of_cell = leaves
            .iter()
            .zip(0..)
            .map(|(l, i)| ((l.level, l.cell), i))
            .collect();
        let mut levels: Vec<u8> = leaves.iter().map(|l| l.level).collect();
        levels.sort_unstable();
        levels.dedup();
        Self {
            lattice: *lattice,
            of_cell,
            levels,
        }
    }

    /// Leaf of the world point `p`; the box is closed on all sides.
    pub fn find(&self, p: DVec3) -> Option<usize> {
        self.find_on_lattice(self.lattice_point(p))
    }

    /// Leaf of the lattice point `q`.
    pub fn find_on_lattice(&self, q: DVec3) -> Option<usize> {
        self.levels.iter().find_map(|&level| {
            let n = self.lattice.cells_at(level as usize);
            let scaled = q * (1u64 << level) as f64;
            let cell = std::array::from_fn(|a| (scaled[a].max(0.0) as u32).min(n[a] - 1));
            self.of_cell.get(&(level, cell)).map(|&i| i as usize)
        })
    }

    /// A division where the lattice stands upright, as that of a cloud does: a point on a border falls on the side
    /// where the fit put it.
    fn lattice_point(&self, p: DVec3) -> DVec3 {
        let map = self.lattice.world_from_lattice;
        let edges = DVec3::new(map.matrix3.x_axis.x, map.matrix3.y_axis.y, map.matrix3.z_axis.z);
        if map.matrix3 == DMat3::from_diagonal(edges) {
            (p - map.translation) / edges
        } else {
            map.inverse().transform_point3(p)
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::StopReason;

    #[test]
    fn points_fall_into_their_leaf() {
        let lattice = Lattice {
            world_from_lattice: DAffine3::IDENTITY,
            cells: [2, 1, 1],
        };
        let leaf = |level, cell| Leaf {
            level,
            cell,
            sample_count: 0,
            rms: 0.0,
            max: 0.0,
            reason: StopReason::Tolerance,
        };
        let leaves = [leaf(0, [0, 0, 0]), leaf(1, [2, 0, 0]), leaf(1, [3, 1, 1])];
        let index = LeafIndex::new(&lattice, &leaves);
        let at = |x, y, z| index.find(DVec3::new(x, y, z));
        assert_eq!(at(0.9, 0.9, 0.9), Some(0));
        assert_eq!(at(1.1, 0.1, 0.4), Some(1));
        assert_eq!(
            at(2.0, 1.0, 1.0),
            Some(2),
            "the far corner belongs to the last cell"
        );
        assert_eq!(at(1.1, 0.9, 0.4), None);
    }
}
