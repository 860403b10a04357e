use bspline::polygonize::{PolygonizeOptions, polygonize};
use bspline::{Aabb, Field, Frame, HierarchicalSpline};
use fitting::phantoms::{CloudOptions, SampledCloud, Solid, SplitMix64, sample_cloud};
use fitting::points::{OrientedPoints, PointOptions, fit_points, newton_distance};
use fitting::{Control, FitError, FitReport};
use glam::DVec3;

/// Points of a cloud.
pub const COUNT: usize = 20_000;

/// A phantom whose clouds are made hard.
pub struct Scene {
    truth: std::sync::Arc<dyn Field>,
    within: Aabb,
    /// The cloud before it is spoiled.
    clean: SampledCloud,
    /// Points of the true surface, others than are fitted.
    on_truth: Vec<DVec3>,
}

impl Scene {
    /// The scene of a solid, if it has a surface.
    pub fn new(solid: Solid) -> Option<Self> {
        let (truth, within) = (solid.field(), solid.within());
        let sampled = |count, seed| {
            let options = CloudOptions {
                count,
                seed,
                ..Default::default()
            };
            sample_cloud(&*truth, &within, &options)
        };
        let (clean, on_truth) = (sampled(COUNT, 1)?, sampled(5000, 2)?.positions);
        Some(Self {
            truth,
            within,
            clean,
            on_truth,
        })
    }

    /// Diagonal of the solid's box.
    pub fn diagonal(&self) -> f64 {
        self.within.size().length()
    }

    /// A cloud with noise (a share of the diagonal; normals stay exact) and with outliers beside its points, a share of
    /// their number, even in the box and facing anywhere.
    pub fn cloud(&self, noise: f64, outliers: f64) -> SampledCloud {
        let mut cloud = self.clean.clone();
        let mut random = SplitMix64::new(3);
        for p in &mut cloud.positions {
            *p += noise * self.diagonal() * random.normal3();
        }
        for _ in 0..(outliers * COUNT as f64) as usize {
            cloud
                .positions
                .push(self.within.min + self.within.size() * random.uniform3());
            cloud.normals.push(random.normal3().normalize_or(DVec3::Z));
        }
        cloud
    }

    /// Fits a cloud, and measures the rms distance between the true surface and the fitted one both ways, as a share
    /// of the diagonal: a piece of surface where there is none counts.
    ///
    /// # Errors
    /// Those of the fit.
    pub fn error(&self, cloud: &SampledCloud, options: &PointOptions) -> Result<(f64, FitReport), FitError> {
        let points = OrientedPoints {
            positions: &cloud.positions,
            normals: &cloud.normals,
            certainty: None,
        };
        let (field, report) = fit_points::<f32>(&points, options, &mut Control::default())?;
        let forth = rms(self.on_truth.iter().map(|p| newton_distance(&field, *p).0));
        let back = self.back(&field);
        Ok((forth.max(back) / self.diagonal(), report))
    }

    fn back(&self, field: &HierarchicalSpline<f32>) -> f64 {
        let frame = Frame::over(&field.lattice().world_box(), [128; 3]);
        let Ok((mesh, _)) = polygonize(field, &frame, &PolygonizeOptions::default()) else {
            return f64::NAN;
        };
        let stride = mesh.positions.len().div_ceil(10_000).max(1);
        rms(mesh
            .positions
            .iter()
            .step_by(stride)
            .map(|p| newton_distance(&*self.truth, *p).0))
    }
}

fn rms(distances: impl Iterator<Item = f64>) -> f64 {
    let (count, square) = distances.fold((0usize, 0.0), |(n, s), d| (n + 1, s + d * d));
    (square / count.max(1) as f64).sqrt()
}
