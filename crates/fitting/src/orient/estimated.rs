use bspline::hierarchical::Lattice;
use glam::DVec3;

use super::{OrientOptions, Orientation, leaf_confidence, orient_points};
use crate::points::OrientedPoints;
use crate::{Control, FitError, FitReport, SignReport};

/// Those points of a cloud without normals that lie on a surface, with estimated normals: what a fit takes.
#[derive(Clone, Debug)]
pub struct EstimatedCloud {
    positions: Vec<DVec3>,
    normals: Vec<DVec3>,
    certainty: Vec<f32>,
    orientation: Orientation,
}

impl EstimatedCloud {
    /// Estimates the normals of a cloud.
    ///
    /// # Errors
    /// Those of [`orient_points`].
    pub fn new(
        positions: &[DVec3],
        options: &OrientOptions,
        control: &mut Control,
    ) -> Result<Self, FitError> {
        let orientation = orient_points(positions, options, control)?;
        Ok(Self {
            positions: orientation.on_surface(positions),
            normals: orientation.on_surface(&orientation.normals),
            certainty: orientation.on_surface(&orientation.certainty),
            orientation,
        })
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        let per_point = 2 * size_of::<DVec3>() + size_of::<f32>();
        let estimated = size_of::<DVec3>() + 2 * size_of::<f32>() + 1;
        (self.positions.len() * per_point + self.orientation.normals.len() * estimated) as u64
    }

    /// The points to fit.
    pub fn points(&self) -> OrientedPoints<'_> {
        OrientedPoints {
            positions: &self.positions,
            normals: &self.normals,
            certainty: Some(&self.certainty),
        }
    }

    /// Tells in the report of their fit, of a field on `lattice`, how the normals were found.
    pub fn complete(self, report: &mut FitReport, lattice: &Lattice) {
        let orientation = self.orientation;
        report.input_count = orientation.outlier.len();
        // Counted among all points of the cloud.
        let on_surface: Vec<u32> = (0..)
            .zip(&orientation.outlier)
            .filter(|p| !p.1)
            .map(|p| p.0)
            .collect();
        let outliers = (0..).zip(&orientation.outlier).filter(|p| *p.1).map(|p| p.0);
        let unused = report.left_out.iter().map(|&i| on_surface[i as usize]);
        report.left_out = unused.chain(outliers).collect();
        report.left_out.sort_unstable();
        let confidence = orientation.on_surface(&orientation.confidence);
        report.signs = Some(SignReport {
            route: orientation.route,
            outlier_count: orientation.outlier.iter().filter(|o| **o).count(),
            unsure_count: orientation.unsure_count,
            leaf_confidence: leaf_confidence(&report.leaves, lattice, &self.positions, &confidence),
        });
        report.notes.splice(0..0, orientation.notes);
    }
}
