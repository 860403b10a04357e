use bspline::polygonize::{
    AdaptiveMesher, AdaptiveOptions, Mesh, PolygonizeError, PolygonizeOptions, polygonize,
};
use bspline::{Field, Frame};
use glam::DVec3;
use rayon::prelude::*;

use super::{Chart, Series};

/// Cells along the longest side of the box.
const RESOLUTIONS: [u32; 6] = [32, 64, 96, 128, 192, 256];
/// Chord errors that cells are divided at, shares of the diagonal.
const ERRORS: [f64; 7] = [3.2e-3, 1.6e-3, 8e-4, 4e-4, 2e-4, 1e-4, 5e-5];

/// A way to make a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    Uniform,
    Adaptive,
    Settled,
}

impl Way {
    const ALL: [Self; 3] = [Self::Uniform, Self::Adaptive, Self::Settled];

    fn name(self) -> &'static str {
        match self {
            Self::Uniform => "uniform cells (marching cubes)",
            Self::Adaptive => "octree (dual contouring)",
            Self::Settled => "octree, settled",
        }
    }
}

/// What a mesh cost and how far it lies from its surface.
pub struct MeshTrial {
    way: Way,
    /// Number of triangles.
    pub triangles: usize,
    /// Processor time, seconds.
    pub seconds: f64,
    /// 95th percentile and largest distance of centres and middles of sides to the surface, shares of the diagonal.
    pub errors: [f64; 2],
}

impl MeshTrial {
    /// A line of CSV.
    pub fn csv(&self) -> String {
        let [p95, max] = self.errors;
        format!(
            "{},{},{:.3},{p95:.3e},{max:.3e}",
            self.way.name(),
            self.triangles,
            self.seconds
        )
    }

    /// Names of the columns of [`Self::csv`].
    pub const COLUMNS: &'static str = "way,triangles,cpu_seconds,p95,max";
}

/// A field to be meshed in every way.
pub struct MeshSubject<'a> {
    /// The field.
    pub field: &'a dyn Field,
    /// Density of the surface.
    pub iso: f64,
    /// Cells of the coarsest level.
    pub frame: Frame,
    /// Levels above it.
    pub finest: usize,
    /// Cells along the longest side to a frame.
    pub frame_of: &'a (dyn Fn(u32) -> Frame + Sync),
    /// Processor time of this process, seconds.
    pub clock: fn() -> f64,
}

impl MeshSubject<'_> {
    /// Meshes the field in every way and fineness; `go_on` is told the share of the work done.
    ///
    /// # Errors
    /// Those of the mesher.
    pub fn trials(
        &self,
        mut go_on: impl FnMut(f64) -> std::ops::ControlFlow<()>,
    ) -> Result<Vec<MeshTrial>, PolygonizeError> {
        let plain = PolygonizeOptions {
            iso: self.iso,
            ..Default::default()
        };
        let mut trials = Vec::new();
        let total = (RESOLUTIONS.len() + 2 * ERRORS.len()) as f64;
        let mut step = |trials: &[MeshTrial]| match go_on(trials.len() as f64 / total) {
            std::ops::ControlFlow::Break(()) => Err(PolygonizeError::Cancelled),
            std::ops::ControlFlow::Continue(()) => Ok(()),
        };
        for n in RESOLUTIONS {
            step(&trials)?;
            let start = (self.clock)();
            let (mesh, _) = polygonize(self.field, &(self.frame_of)(n), &plain)?;
            trials.push(self.trial(Way::Uniform, &mesh, start));
        }
        let box_ = self.frame.world_box([0; 3], self.frame.cells.map(i64::from));
        let longest = self.frame.cells.into_iter().max().unwrap_or(1);
        let options = AdaptiveOptions {
            iso: self.iso,
            depth: (self.finest + 2).min(AdaptiveOptions::most_depth(longest)),
            detection: self.finest + 1,
            ..Default::default()
        };
        for (way, settled) in [(Way::Adaptive, false), (Way::Settled, true)] {
            for error in ERRORS {
                step(&trials)?;
                // Nothing learnt from one mesh may make the next one cheaper.
                let mut quiet = |_| std::ops::ControlFlow::Continue(());
                let start = (self.clock)();
                let mut mesher = AdaptiveMesher::new(self.field, &self.frame, &options, &mut quiet)?;
                let (made, _) = mesher.mesh(error * box_.size().length(), settled, &mut quiet)?;
                trials.push(self.trial(way, &made.mesh, start));
            }
        }
        Ok(trials)
    }

    fn trial(&self, way: Way, mesh: &Mesh, start: f64) -> MeshTrial {
        let seconds = (self.clock)() - start;
        let diagonal = mesh.bounding_box().map_or(1.0, |b| b.size().length());
        let mut errors: Vec<f64> = (0..mesh.triangles.len())
            .into_par_iter()
            .map(|t| {
                let [a, b, c] = mesh.corners(t);
                [(a + b + c) / 3.0, (a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0]
                    .map(|p| self.distance(p))
                    .into_iter()
                    .fold(0.0, f64::max)
            })
            .collect();
        errors.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| {
            let rank = (share * errors.len() as f64) as usize;
            errors
                .get(rank.min(errors.len().saturating_sub(1)))
                .map_or(0.0, |e| e / diagonal)
        };
        MeshTrial {
            way,
            triangles: mesh.triangles.len(),
            seconds,
            errors: [at(0.95), at(1.0)],
        }
    }

    /// Distance to the surface by two steps of Newton's method.
    fn distance(&self, p: DVec3) -> f64 {
        let mut x = p;
        for _ in 0..2 {
            let (f, g) = self.field.value_gradient(x);
            let step = g * ((f - self.iso) / g.length_squared());
            if step.is_finite() {
                x -= step;
            }
        }
        (x - p).length()
    }
}

impl Chart {
    /// Errors of meshes against their triangles, or against the time that they took.
    pub fn of_meshes(name: &str, against_time: bool, trials: &[MeshTrial]) -> Self {
        let mut series = Vec::new();
        for way in Way::ALL {
            for (rank, quantity) in ["95 %", "worst"].into_iter().enumerate() {
                let points = trials.iter().filter(|t| t.way == way).map(|t| {
                    let x = if against_time {
                        t.seconds
                    } else {
                        t.triangles as f64
                    };
                    (x, t.errors[rank] * 1e4, String::new())
                });
                series.push(Series {
                    name: format!("{}, {quantity}", way.name()),
                    points: points.collect(),
                });
            }
        }
        Self {
            title: format!("{name}: distance of the mesh from the surface of the field"),
            x_title: if against_time {
                "processor time of the mesh, s"
            } else {
                "triangles"
            }
            .into(),
            y_title: "distance, 1e-4 of the diagonal".into(),
            depth: super::plot::DEPTH,
            series,
            is_joined: true,
        }
    }
}
