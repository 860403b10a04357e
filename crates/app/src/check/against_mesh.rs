use bspline::{Aabb, Field};
use fitting::mesh::MeshDistance;
use fitting::phantoms::SplitMix64;
use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

use super::ErrorStatistics;
use super::projection::surface_point;

/// How a field agrees with the mesh it stands for, beyond the distances from the mesh to its zero set.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct AgainstMesh {
    /// Exact distances from points of the zero set to the mesh, those in holes left out.
    pub back: ErrorStatistics,
    /// Points of the zero set that were found.
    pub back_count: usize,
    /// Points of the zero set in holes of the mesh, where it is invented.
    pub in_holes: usize,
    /// Points farther from the mesh than the tolerance at which the sign is that of the winding number or not.
    pub sign_count: usize,
    /// Of these, those at which it is not.
    pub wrong_signs: usize,
}

/// Random points at which the sign is looked at.
const SIGN_POINTS: usize = 100_000;

/// Compares `field` with the solid of a mesh: distances back from the zero set, which is looked for from `starts`, and
/// signs in the box round the mesh, 1.15 times as wide.
pub fn against_mesh(
    field: &dyn Field,
    solid: &MeshDistance,
    starts: impl Iterator<Item = DVec3>,
    spacing: f64,
    tolerance: f64,
) -> AgainstMesh {
    let starts: Vec<DVec3> = starts.collect();
    let found: Vec<Option<f64>> = starts
        .par_iter()
        .filter_map(|&p| surface_point(field, p, spacing))
        .map(|p| (!solid.is_in_hole(p)).then(|| solid.distance(p)))
        .collect();
    let mut back: Vec<f64> = found.iter().copied().flatten().collect();
    let Aabb { min, max } = solid.fit_box();
    let mut random = SplitMix64::new(1);
    let points: Vec<DVec3> = (0..SIGN_POINTS)
        .map(|_| min + random.uniform3() * (max - min))
        .collect();
    let signs: Vec<bool> = points
        .par_iter()
        .filter_map(|&p| {
            let d = solid.signed(p);
            (d.abs() > tolerance).then(|| (field.value(p) > 0.0) == (d > 0.0))
        })
        .collect();
    AgainstMesh {
        back_count: back.len(),
        in_holes: found.len() - back.len(),
        back: ErrorStatistics::of(&mut back),
        sign_count: signs.len(),
        wrong_signs: signs.iter().filter(|right| !**right).count(),
    }
}
