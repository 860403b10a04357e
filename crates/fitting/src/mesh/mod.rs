//! Fields from triangle meshes: signed distance, sign by the generalized winding number.

mod base;
mod conditions;
mod crossings;
mod defects;
mod distance;
mod judge;
mod levels;
mod measure;
mod moments;
mod nearest;
mod normals;
mod packet;
mod pieces;
mod probes;
mod sides;
mod summary;
mod surface;
mod thin;
mod topology;
mod tree;
mod winding;

use bspline::{HierarchicalSpline, Real};
use glam::DVec3;

pub use defects::MeshDefects;
pub use distance::MeshDistance;
pub use measure::{MeshErrors, measure_mesh};

use crate::points::check_limits;
use crate::{Control, FitError, FitReport};

/// What the caller may choose; `None` is chosen from the data.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MeshOptions {
    /// Root mean square distance from the surface to the zero set that each leaf stays below, or says why not; world
    /// units, 1e-4 of the diagonal if not given.
    pub tolerance: Option<f64>,
    /// Largest number of coefficients, at least [`LEAST_COEFFICIENTS`](crate::points::LEAST_COEFFICIENTS); 400 000 if
    /// neither they nor a tolerance are given.
    pub coefficients: Option<usize>,
    /// Deepest level: `2^max_depth` cells along the box, from 6 to 16; 10 if not given.
    pub max_depth: Option<usize>,
    /// Half the width of a band round the surface in which the error of the signed distance counts like distances of
    /// the zero set, world units; none if not given. Beyond it the error may grow by a quarter of the way out.
    pub band: Option<f64>,
}

/// Deepest level when the caller gives none.
const DEFAULT_DEPTH: usize = 10;
/// Coefficients when the caller names neither them nor a tolerance: about two seconds of one core, and 250 MiB.
const DEFAULT_COEFFICIENTS: usize = 400_000;
/// Tolerance when the caller gives none, in diagonals.
const DEFAULT_TOLERANCE: f64 = 1e-4;

/// Lengths of a fit in the unit box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plan {
    pub tolerance: f64,
    pub band: f64,
    pub max_depth: usize,
    pub coefficients: Option<usize>,
    /// Area of the surface, unit box.
    pub area: f64,
}

impl Plan {
    /// Error allowed at so far from the surface. Beyond the band, and in holes from the rim on, it grows by a quarter
    /// of the way, which leaves the sign as it is.
    pub fn allowed(&self, distance: f64, in_hole: bool) -> f64 {
        let band = if in_hole { 0.0 } else { self.band };
        self.tolerance + 0.25 * (distance - band).max(0.0)
    }
}

/// Fits the signed distance of a mesh, positive inside.
///
/// # Errors
/// [`FitError::Degenerate`] for coordinates that are not finite, indices out of range, no area, or a mesh that
/// encloses nothing; [`FitError::Option`], [`FitError::Cancelled`], [`FitError::MemoryLimit`].
pub fn fit_mesh<T: Real>(
    vertices: &[DVec3],
    triangles: &[[u32; 3]],
    options: &MeshOptions,
    control: &mut Control,
) -> Result<(HierarchicalSpline<T>, FitReport, MeshDefects), FitError> {
    for (option, value) in [("tolerance", options.tolerance), ("band", options.band)] {
        if let Some(value) = value.filter(|v| !(v.is_finite() && *v > 0.0)) {
            let requirement = "it has to be a length above 0";
            return Err(FitError::Option {
                option,
                value,
                requirement,
            });
        }
    }
    check_limits(options.coefficients, options.max_depth)?;
    control.step("sorting triangles", 0.0)?;
    control.reserve(levels::bytes::<T>(0, 0, 0, triangles.len(), vertices.len()))?;
    let (mesh, defects) = MeshDistance::new(vertices, triangles)?;
    let tolerance = options.tolerance.unwrap_or(DEFAULT_TOLERANCE * mesh.diagonal) / mesh.scale;
    let plan = Plan {
        tolerance,
        band: options.band.map_or(0.0, |b| b / mesh.scale),
        max_depth: options.max_depth.unwrap_or(DEFAULT_DEPTH),
        coefficients: options
            .coefficients
            .or_else(|| options.tolerance.is_none().then_some(DEFAULT_COEFFICIENTS)),
        area: mesh.unit_area(),
    };
    let (field, mut report) = levels::fit(&mesh, &plan, triangles.len(), vertices.len(), control)?;
    report.notes.splice(0..0, defects.notes());
    Ok((field, report, defects))
}
