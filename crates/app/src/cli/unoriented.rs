use bspline::hierarchical::Lattice;
use clap::ValueEnum;
use fitting::orient::{EstimatedCloud, OrientOptions, Route};
use fitting::points::OrientedPoints;
use fitting::{Control, FitReport};
use formats::points::PointCloud;

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

/// The points that a fit may use, with normals.
pub struct Oriented<'a> {
    cloud: &'a PointCloud,
    estimated: Option<EstimatedCloud>,
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
            return Ok(Self {
                cloud,
                estimated: None,
            });
        };
        let options = OrientOptions {
            route: match asked {
                Unoriented::Winding => Route::WindingNumber,
                Unoriented::Tagging => Route::Tagging,
            },
        };
        let estimated = EstimatedCloud::new(&cloud.positions, &options, control);
        Ok(Self {
            cloud,
            estimated: Some(estimated.map_err(|e| explain(e, control))?),
        })
    }

    /// Bytes held beside the cloud.
    pub fn bytes(&self) -> u64 {
        self.estimated.as_ref().map_or(0, EstimatedCloud::bytes)
    }

    /// The points to fit.
    pub fn points(&self) -> OrientedPoints<'_> {
        let given = || OrientedPoints {
            positions: &self.cloud.positions,
            normals: self.cloud.normals.as_deref().unwrap_or_default(),
            certainty: None,
        };
        self.estimated.as_ref().map_or_else(given, EstimatedCloud::points)
    }

    /// Tells in the report of the fit how the normals were found.
    pub fn complete(self, report: &mut FitReport, lattice: &Lattice) {
        let Some(estimated) = self.estimated else {
            return;
        };
        estimated.complete(report, lattice);
        if self.cloud.normals.is_some() {
            report
                .notes
                .insert(0, "--unoriented: the normals of the file were not used".into());
        }
    }
}
