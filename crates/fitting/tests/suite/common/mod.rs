//! What the tests of cloud fits share.

pub mod meshes;

use bspline::{HierarchicalSpline, Real};
use fitting::phantoms::{CloudOptions, SampledCloud, Solid, sample_cloud};
use fitting::points::{OrientedPoints, PointOptions, fit_points};
use fitting::{Control, FitError, FitReport};

pub fn cloud(solid: Solid, options: &CloudOptions) -> SampledCloud {
    sample_cloud(&*solid.field(), &solid.within(), options).expect("phantoms have a surface")
}

pub fn fit<T: Real>(
    cloud: &SampledCloud,
    options: &PointOptions,
) -> Result<(HierarchicalSpline<T>, FitReport), FitError> {
    fit_points(&oriented(cloud), options, &mut Control::default())
}

pub fn oriented(cloud: &SampledCloud) -> OrientedPoints<'_> {
    OrientedPoints {
        positions: &cloud.positions,
        normals: &cloud.normals,
        certainty: None,
    }
}

pub fn to_depth(max_depth: usize) -> PointOptions {
    PointOptions {
        max_depth: Some(max_depth),
        ..PointOptions::default()
    }
}
