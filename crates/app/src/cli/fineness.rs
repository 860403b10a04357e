//! How fine a mesh is to be, as users ask for it.

use std::ops::ControlFlow;

use bspline::Field;
use bspline::polygonize::PolygonizeError;
pub use document::{Fineness, Meshed};
use document::{Surface, SurfaceError};
use fitting::Cancel;

use super::failure::{Failure, Outcome};
use super::field::OpenField;
use super::progress::Bar;
use super::quantity::Tolerance;
use super::{ceiling, flags, interrupt};

/// The fineness that a user asks for by the tolerance, of a field in the unit of the open one.
pub fn of_tolerance(tolerance: Tolerance, open: &OpenField) -> Outcome<Fineness> {
    match tolerance {
        Tolerance::Percent(percent) => Ok(Fineness::Share(0.01 * percent)),
        length => length
            .length(0.0, open.unit())
            .map(Fineness::Error)
            .map_err(Failure::usage),
    }
}

/// Meshes the surface `{ f = iso }` of `field`, which is the open one or what became of it, of so many `levels`.
pub fn mesh(
    open: &OpenField,
    field: &dyn Field,
    levels: usize,
    iso: f64,
    capped: bool,
    fineness: Fineness,
    notes: &mut Vec<String>,
    cancel: &Cancel,
    bar: &Bar,
) -> Outcome<Meshed> {
    let surface = Surface {
        field,
        lattice: open.lattice(),
        levels,
        slope: open.slope(),
        meta: open.meta(),
        report: open.report(),
        iso,
        open: !capped,
    };
    let mut told = Vec::new();
    let made = surface.mesh(fineness, &mut told, &mut watch(cancel, bar, 0.0, 1.0));
    notes.extend(told.iter().map(|note| flags::named(note)));
    made.map_err(|e| match e {
        SurfaceError::Mesher(e) => failed(e),
        e => Failure::limit(flags::named(&e.to_string())),
    })
}

/// Shows progress between two shares of the whole and listens for the user's wish to stop.
pub fn watch<'a>(
    cancel: &'a Cancel,
    bar: &'a Bar,
    from: f64,
    to: f64,
) -> impl FnMut(f64) -> ControlFlow<()> + 'a {
    move |fraction| {
        bar.show("meshing", from + (to - from) * fraction);
        if cancel.is_cancelled() || ceiling::is_exceeded() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }
}

/// What a failure of the mesher means to the user.
pub fn failed(e: PolygonizeError) -> Failure {
    match e {
        PolygonizeError::Cancelled if interrupt::cancel().is_cancelled() => {
            fitting::FitError::Cancelled.into()
        }
        // By now the memory may be given back.
        PolygonizeError::Cancelled => {
            Failure::limit("the mesh takes more than --memory allows; raise it, or ask for a coarser mesh")
        }
        PolygonizeError::TooManyBlocks { .. } | PolygonizeError::TooManyVertices { .. } => Failure::limit(
            format!("{e}; lower --resolution or --triangles, or raise --tolerance"),
        ),
        PolygonizeError::Cells { .. } => Failure::usage(format!("{e}; lower --resolution")),
        _ => Failure::input(e),
    }
}
