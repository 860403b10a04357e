use bspline::{Field, HierarchicalSpline, TensorSpline};
use fitting::Control;
use fitting::field::{Aim, FieldFitOptions, fit_field};

use crate::geometric::{GeometricError, TOLERANCE, affordable};
use crate::malleable::Malleable;

/// A field on knots of its own written in levels, on the [grids](Malleable::grids) of its paint, and a sentence that says so.
/// Its surface at `iso` is off by a fiftieth of its shortest knot interval at most.
///
/// # Errors
/// [`GeometricError::Shape`] if that takes too many functions; [`GeometricError::Fit`].
pub fn in_levels(
    field: &TensorSpline<f32>,
    iso: f64,
    control: &mut Control,
) -> Result<(HierarchicalSpline<f32>, String), GeometricError> {
    let (lattice, finest) = (field.grids(), field.depth() - 1);
    let tolerance = TOLERANCE * field.shortest();
    let coarse = HierarchicalSpline::schoenberg(lattice, field.slope(), |p| field.value(p))
        .map_err(GeometricError::shape)?;
    let whole = lattice.world_box();
    let mut fit = |finest: usize| {
        let options = FieldFitOptions {
            aim: Aim::Surface { iso, tolerance },
            finest,
            look: false,
        };
        fit_field(field, &coarse, &whole, &options, control)
    };
    let remedy = "this works by levels; give knots that lie farther apart";
    affordable(
        &lattice,
        &whole,
        finest,
        field.coefficients().len(),
        remedy,
        |level| Ok(fit(level)?.2),
    )?;
    let (levels, _, _) = fit(finest)?;
    let note = format!(
        "this works by levels, so the object's knots were given up for {} of them; its surface is within {tolerance:.2e} of what it \
         was",
        levels.level_count()
    );
    Ok((levels, note))
}
