//! Errors of a field against the mesh it stands for: one definition, for the fit that states them and for whoever
//! measures again.

use bspline::{Field, HierarchicalSpline, Real};
use glam::DVec3;
use rayon::prelude::*;

use super::distance::MeshDistance;
use super::judge::Misses;
use super::probes::{cell_of, center, child};
use crate::level::BASE_DEPTH;
use crate::points::{LeafError, PointErrors, measure_points};
use crate::{Leaf, LeafIndex};

/// Random points of the surface at which the whole field is measured.
const SAMPLES: usize = 20_000;

/// Leaves whose feet are evaluated together.
const CHUNK: usize = 512;

/// What was measured, and at which points of the surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshErrors {
    /// Random points of the surface, world units.
    pub samples: Vec<DVec3>,
    /// Errors at these points; `max`, `bound` and `leaves` also look at the feet of the leaves and at the corners of the
    /// mesh, where distances are those of first order, `|f|/|∇f|`.
    pub errors: PointErrors,
}

/// Measures `field`, which was fitted to `mesh` with these `leaves`.
pub fn measure_mesh<T: Real>(
    field: &HierarchicalSpline<T>,
    mesh: &MeshDistance,
    leaves: &[Leaf],
) -> MeshErrors {
    measure(field, mesh, leaves, |i, out| {
        let leaf = &leaves[i];
        let depth = BASE_DEPTH + usize::from(leaf.level);
        let places = std::array::from_fn(|o| center(child(leaf.cell, o), depth + 1));
        let feet = mesh.feet(&places);
        out.extend(feet.into_iter().filter(|f| cell_of(*f, depth) == leaf.cell));
    })
}

/// [`measure_mesh`] for one who knows the feet of the parts of each leaf that lie in it, unit box.
pub(super) fn measure<T: Real>(
    field: &HierarchicalSpline<T>,
    mesh: &MeshDistance,
    leaves: &[Leaf],
    feet_of: impl Fn(usize, &mut Vec<DVec3>) + Sync,
) -> MeshErrors {
    let world = |p: DVec3| mesh.origin + p * mesh.scale;
    let chunks = (0..leaves.len().div_ceil(CHUNK)).into_par_iter();
    let mut found: Vec<LeafError> = chunks
        .flat_map_iter(|chunk| {
            let (mut feet, mut ends) = (Vec::new(), Vec::new());
            for i in chunk * CHUNK..leaves.len().min((chunk + 1) * CHUNK) {
                feet_of(i, &mut feet);
                ends.push(feet.len());
            }
            feet.iter_mut().for_each(|p| *p = world(*p));
            let mut found = vec![(0.0, DVec3::ZERO); feet.len()];
            field.values_gradients(&feet, &mut found);
            let starts = std::iter::once(0).chain(ends.clone());
            let of_leaves = starts.zip(ends).map(|(start, end)| {
                let mut misses = Misses::default();
                found[start..end].iter().for_each(|f| misses.add(*f));
                LeafError {
                    count: misses.count,
                    rms: misses.rms(),
                    max: misses.max,
                }
            });
            of_leaves.collect::<Vec<_>>()
        })
        .collect();
    let index = LeafIndex::new(field.lattice(), leaves);
    let corners: Vec<DVec3> = mesh.corners().collect();
    let base = (1u32 << BASE_DEPTH) as f64;
    let at_corners: Vec<(Option<usize>, f64)> = corners
        .par_iter()
        .with_min_len(1024)
        .map(|&p| {
            let mut misses = Misses::default();
            misses.add(field.value_gradient(world(p)));
            (index.find_on_lattice(p * base), misses.max)
        })
        .collect();
    let samples = mesh.surface_samples(SAMPLES);
    let mut errors = measure_points(field, &samples, |_| true, |_| None, 0);
    for (leaf, error) in at_corners {
        errors.max = errors.max.max(error);
        if let Some(leaf) = leaf {
            found[leaf].max = found[leaf].max.max(error);
        }
    }
    errors.max = found.iter().map(|l| l.max).fold(errors.max, f64::max);
    errors.bound = errors.bound.max(errors.max + field.rounding_bound());
    errors.leaves = found;
    MeshErrors { samples, errors }
}
