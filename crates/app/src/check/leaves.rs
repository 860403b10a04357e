use std::collections::HashMap;

use bspline::hierarchical::Lattice;
use fitting::{Leaf, StopReason};
use glam::DVec3;
use serde::Serialize;

/// Finds the leaf that a point lies in.
pub struct LeafIndex<'a> {
    leaves: &'a [Leaf],
    lattice: Lattice,
    of_cell: HashMap<(u8, [u32; 3]), u32>,
    levels: Vec<u8>,
}

impl<'a> LeafIndex<'a> {
    /// Index over `leaves`, cells of `lattice`.
    pub fn new(lattice: &Lattice, leaves: &'a [Leaf]) -> Self {
        let of_cell = leaves
            .iter()
            .zip(0..)
            .map(|(l, i)| ((l.level, l.cell), i))
            .collect();
        let mut levels: Vec<u8> = leaves.iter().map(|l| l.level).collect();
        levels.sort_unstable();
        levels.dedup();
        Self {
            leaves,
            lattice: *lattice,
            of_cell,
            levels,
        }
    }

    /// Leaf of the lattice point `q`; the box is closed on all sides.
    fn find(&self, q: DVec3) -> Option<usize> {
        self.levels.iter().find_map(|&level| {
            let n = self.lattice.cells_at(level as usize);
            let scaled = q * (1u64 << level) as f64;
            let cell = std::array::from_fn(|a| (scaled[a].max(0.0) as u32).min(n[a] - 1));
            self.of_cell.get(&(level, cell)).map(|&i| i as usize)
        })
    }

    /// World positions of the middles of the leaves with samples.
    pub fn centers(&self) -> impl Iterator<Item = DVec3> {
        let with_samples = (0..self.leaves.len()).filter(|&i| self.leaves[i].sample_count > 0);
        with_samples.map(|i| self.corners(i).iter().sum::<DVec3>() / 8.0)
    }

    /// World corners of leaf `i`, corner `4x + 2y + z`.
    pub fn corners(&self, i: usize) -> [DVec3; 8] {
        let leaf = &self.leaves[i];
        let scale = 1.0 / (1u64 << leaf.level) as f64;
        std::array::from_fn(|c| {
            let at = [c >> 2, c >> 1 & 1, c & 1];
            let q = DVec3::from_array(std::array::from_fn(|a| {
                (leaf.cell[a] as usize + at[a]) as f64 * scale
            }));
            self.lattice.world_from_lattice.transform_point3(q)
        })
    }
}

/// What the leaves look like when their errors are measured again.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LeafAudit {
    /// Leaves of the fit.
    pub leaves: usize,
    /// Leaves with samples.
    pub with_samples: usize,
    /// Leaves whose re-measured rms is above the tolerance.
    pub over_tolerance: usize,
    /// Of these, leaves not split for lack of data.
    pub without_data: usize,
    /// Of these, leaves at the depth limit.
    pub at_depth_limit: usize,
    /// Of these, leaves at the resolution that the noise justifies.
    pub at_noise: usize,
    /// Of these, leaves that the coefficient or memory budget stopped.
    pub at_budget: usize,
    /// Of these, leaves at edges of the surface, which a smooth field cannot have.
    pub at_creases: usize,
    /// Moved above the tolerance when cells beside them were refined.
    pub moved: usize,
    /// Of these, leaves that the fit believed to be below the tolerance: a wrong statement of the fit.
    pub claimed_below: usize,
    /// Root mean square error of each leaf, 0 without samples.
    #[serde(skip)]
    pub rms: Vec<f64>,
}

/// Gathers `errors` at lattice points by leaf and compares each leaf's rms with `tolerance`.
pub fn audit_leaves(
    index: &LeafIndex,
    samples: impl Iterator<Item = (DVec3, f64)>,
    tolerance: f64,
) -> LeafAudit {
    let mut sums = vec![(0usize, 0.0f64); index.leaves.len()];
    for (q, error) in samples {
        if let Some(i) = index.find(q) {
            sums[i].0 += 1;
            sums[i].1 += error * error;
        }
    }
    let mut audit = LeafAudit {
        leaves: index.leaves.len(),
        ..Default::default()
    };
    for (leaf, (count, sum)) in index.leaves.iter().zip(sums) {
        let rms = if count == 0 {
            0.0
        } else {
            (sum / count as f64).sqrt()
        };
        audit.rms.push(rms);
        audit.with_samples += usize::from(count > 0);
        if rms <= tolerance {
            continue;
        }
        audit.over_tolerance += 1;
        *match leaf.reason {
            StopReason::NoData => &mut audit.without_data,
            StopReason::Depth => &mut audit.at_depth_limit,
            StopReason::Noise => &mut audit.at_noise,
            StopReason::Budget | StopReason::Memory => &mut audit.at_budget,
            StopReason::Neighbours => &mut audit.moved,
            StopReason::Crease => &mut audit.at_creases,
            StopReason::Tolerance => &mut audit.claimed_below,
        } += 1;
    }
    audit
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DAffine3;

    fn leaf(level: u8, cell: [u32; 3], reason: StopReason) -> Leaf {
        Leaf {
            level,
            cell,
            sample_count: 0,
            rms: 0.0,
            max: 0.0,
            reason,
        }
    }

    #[test]
    fn points_fall_into_their_leaf_and_errors_are_gathered_there() {
        let lattice = Lattice {
            world_from_lattice: DAffine3::IDENTITY,
            cells: [2, 1, 1],
        };
        let leaves = [
            leaf(0, [0, 0, 0], StopReason::NoData),
            leaf(1, [2, 0, 0], StopReason::Tolerance),
            leaf(1, [3, 1, 1], StopReason::Depth),
        ];
        let index = LeafIndex::new(&lattice, &leaves);
        let at = |x, y, z| DVec3::new(x, y, z);
        assert_eq!(index.find(at(0.9, 0.9, 0.9)), Some(0));
        assert_eq!(index.find(at(1.1, 0.1, 0.4)), Some(1));
        assert_eq!(
            index.find(at(2.0, 1.0, 1.0)),
            Some(2),
            "the far corner belongs to the last cell"
        );
        assert_eq!(index.find(at(1.1, 0.9, 0.4)), None);
        let samples = [
            (at(0.5, 0.5, 0.5), 3.0),
            (at(0.6, 0.5, 0.5), -4.0),
            (at(1.9, 0.9, 0.9), 0.1),
        ];
        let audit = audit_leaves(&index, samples.into_iter(), 1.0);
        assert_eq!(
            (
                audit.leaves,
                audit.with_samples,
                audit.over_tolerance,
                audit.without_data
            ),
            (3, 2, 1, 1)
        );
        assert_eq!(audit.rms[0], 12.5f64.sqrt());
        assert_eq!(index.corners(1)[7], at(1.5, 0.5, 0.5));
    }
}
