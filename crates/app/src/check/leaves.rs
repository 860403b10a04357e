use bspline::hierarchical::Lattice;
use fitting::{Leaf, StopReason};
use glam::DVec3;
use serde::Serialize;

/// World corners of a leaf, corner `4x + 2y + z`.
pub fn corners(lattice: &Lattice, leaf: &Leaf) -> [DVec3; 8] {
    let scale = 1.0 / (1u64 << leaf.level) as f64;
    std::array::from_fn(|c| {
        let at = [c >> 2, c >> 1 & 1, c & 1];
        let q = DVec3::from_array(std::array::from_fn(|a| {
            (leaf.cell[a] as usize + at[a]) as f64 * scale
        }));
        lattice.world_from_lattice.transform_point3(q)
    })
}

/// World positions of the middles of the leaves with samples.
pub fn centers(lattice: &Lattice, leaves: &[Leaf]) -> impl Iterator<Item = DVec3> {
    let with_samples = leaves.iter().filter(|l| l.sample_count > 0);
    with_samples.map(|l| corners(lattice, l).iter().sum::<DVec3>() / 8.0)
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
    /// Of these, leaves that the smoothing asked for leaves above it.
    pub smoothed: usize,
    /// Of these, leaves of parts too thin to be shown.
    pub too_thin: usize,
    /// Moved above the tolerance when cells beside them were refined.
    pub moved: usize,
    /// Of these, leaves that the fit believed to be below the tolerance: a wrong statement of the fit.
    pub claimed_below: usize,
    /// Root mean square error of each leaf, 0 without samples.
    #[serde(skip)]
    pub rms: Vec<f64>,
}

/// Compares the rms errors of `leaves` as measured again, with their sample counts, with `tolerance`.
pub fn audit_leaves(
    leaves: &[Leaf],
    measured: impl Iterator<Item = (u32, f64)>,
    tolerance: f64,
) -> LeafAudit {
    let mut audit = LeafAudit {
        leaves: leaves.len(),
        ..Default::default()
    };
    for (leaf, (count, rms)) in leaves.iter().zip(measured) {
        audit.rms.push(rms);
        audit.with_samples += usize::from(count > 0);
        // As the fit stores it.
        let again = Leaf {
            rms: rms as f32,
            ..*leaf
        };
        if !again.is_above(tolerance) {
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
            StopReason::Smoothing => &mut audit.smoothed,
            StopReason::Thin => &mut audit.too_thin,
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
            sample_count: 1,
            rms: 0.0,
            max: 0.0,
            reason,
        }
    }

    #[test]
    fn leaves_above_the_tolerance_are_sorted_by_their_reason() {
        let lattice = Lattice {
            world_from_lattice: DAffine3::IDENTITY,
            cells: [2, 1, 1],
        };
        let leaves = [
            leaf(0, [0, 0, 0], StopReason::NoData),
            leaf(1, [2, 0, 0], StopReason::Tolerance),
            leaf(1, [3, 1, 1], StopReason::Depth),
        ];
        let audit = audit_leaves(&leaves, [(2, 3.0), (1, 0.1), (0, 0.0)].into_iter(), 1.0);
        assert_eq!(
            (
                audit.leaves,
                audit.with_samples,
                audit.over_tolerance,
                audit.without_data
            ),
            (3, 2, 1, 1)
        );
        assert_eq!(corners(&lattice, &leaves[1])[7], DVec3::new(1.5, 0.5, 0.5));
        assert_eq!(centers(&lattice, &leaves).next(), Some(DVec3::splat(0.5)));
    }
}
