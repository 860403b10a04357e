use bspline::hierarchical::Lattice;
use clap::ValueEnum;
use fitting::orient::{OrientOptions, Orientation, Route, leaf_confidence, orient_points};
use fitting::{Control, FitReport, SignReport};
use formats::points::PointCloud;
use glam::DVec3;

use super::ceiling::explain;
use super::failure::{Failure, Outcome};

/// How to tell inside from outside where a cloud has no normals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Unoriented {
    /// By the winding number of the points: takes noise, holes and outliers.
    Winding,
    /// By flooding the space outside; needs closed surfaces.
    Tagging,
}

/// What lies on a surface.
struct Kept {
    positions: Vec<DVec3>,
    normals: Vec<DVec3>,
    certainty: Vec<f32>,
    orientation: Orientation,
}

/// The points that a fit may use, with normals.
pub struct Oriented<'a> {
    cloud: &'a PointCloud,
    kept: Option<Kept>,
}

impl<'a> Oriented<'a> {
    /// The normals of the file, or estimated ones if the user asks for them.
    pub fn new(cloud: &'a PointCloud, asked: Option<Unoriented>, control: &mut Control) -> Outcome<Self> {
        let Some(asked) = asked else {
            if cloud.normals.is_none() {
                return Err(Failure::input(
                    "the points have no normals, which tell inside from outside; estimate them with --unoriented, \
                     or give a file with columns nx ny nz, or a mesh with faces",
                ));
            }
            return Ok(Self { cloud, kept: None });
        };
        let options = OrientOptions {
            route: match asked {
                Unoriented::Winding => Route::WindingNumber,
                Unoriented::Tagging => Route::Tagging,
            },
        };
        let mut orientation =
            orient_points(&cloud.positions, &options, control).map_err(|e| explain(e, control))?;
        if cloud.normals.is_some() {
            orientation
                .notes
                .insert(0, "--unoriented: the normals of the file were not used".into());
        }
        let kept = Kept {
            positions: orientation.on_surface(&cloud.positions),
            normals: orientation.on_surface(&orientation.normals),
            certainty: orientation.on_surface(&orientation.certainty),
            orientation,
        };
        Ok(Self {
            cloud,
            kept: Some(kept),
        })
    }

    /// Bytes held beside the cloud.
    pub fn bytes(&self) -> u64 {
        let per_point = 2 * size_of::<DVec3>() + size_of::<f32>();
        let estimated = size_of::<DVec3>() + 2 * size_of::<f32>() + 1;
        let kept = |k: &Kept| k.positions.len() * per_point + k.orientation.normals.len() * estimated;
        self.kept.as_ref().map_or(0, kept) as u64
    }

    /// Positions of the points to fit.
    pub fn positions(&self) -> &[DVec3] {
        self.kept.as_ref().map_or(&self.cloud.positions, |k| &k.positions)
    }

    /// Their normals.
    pub fn normals(&self) -> &[DVec3] {
        let given = || self.cloud.normals.as_deref().unwrap_or_default();
        self.kept.as_ref().map_or_else(given, |k| &k.normals)
    }

    /// How far to trust their directions, if they were estimated.
    pub fn certainty(&self) -> Option<&[f32]> {
        self.kept.as_ref().map(|k| &k.certainty[..])
    }

    /// Tells in the report of the fit how the normals were found.
    pub fn complete(self, report: &mut FitReport, lattice: &Lattice) {
        let Some(Kept {
            positions,
            orientation,
            ..
        }) = self.kept
        else {
            return;
        };
        report.input_count = self.cloud.positions.len();
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
            leaf_confidence: leaf_confidence(&report.leaves, lattice, &positions, &confidence),
        });
        report.notes.splice(0..0, orientation.notes);
    }
}
