//! All tools behind one door: what they work on, and what they leave.

use bspline::HierarchicalSpline;
use fitting::field::FieldFitReport;
use fitting::{Control, FitError};

use crate::force::{Chisel, Drill, ForceError, ForceReport, Pull};
use crate::geometric::{Geometric, GeometricError, Operation};

/// What a tool works on. Cheap to copy.
#[derive(Clone, Debug)]
pub struct Canvas {
    /// The field.
    pub field: HierarchicalSpline<f32>,
    /// Density of its surface.
    pub iso: f64,
}

/// A tool with all that it is told.
#[derive(Clone, Copy, Debug)]
pub enum Tool<'a> {
    /// Takes a solid out.
    Carve(&'a Geometric),
    /// Adds a solid.
    Add(&'a Geometric),
    /// Brings the surface elsewhere.
    Pull(&'a Pull),
    /// Cuts a groove.
    Chisel(&'a Chisel),
    /// Lays a ridge.
    Squirt(&'a Chisel),
    /// Makes a hole or a cut.
    Drill(&'a Drill),
    /// Makes a bridge or a seam.
    Join(&'a Drill),
}

/// Why a tool cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ToolError {
    /// A geometric tool cannot.
    #[error(transparent)]
    Geometric(#[from] GeometricError),
    /// A force tool cannot.
    #[error(transparent)]
    Force(#[from] ForceError),
}

impl ToolError {
    /// Whether the user said stop.
    pub fn is_cancelled(&self) -> bool {
        match self {
            Self::Geometric(e) => matches!(e, GeometricError::Fit(FitError::Cancelled)),
            Self::Force(e) => e.is_cancelled(),
        }
    }
}

impl Tool<'_> {
    /// Names of all tools, as sessions write them.
    pub const NAMES: [&'static str; 7] = ["carve", "add", "pull", "chisel", "squirt", "drill", "join"];

    /// Its name, as sessions write it.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Carve(_) => "carve",
            Self::Add(_) => "add",
            Self::Pull(_) => "pull",
            Self::Chisel(_) => "chisel",
            Self::Squirt(_) => "squirt",
            Self::Drill(_) => "drill",
            Self::Join(_) => "join",
        }
    }

    /// What the tool leaves, and what is left to say of it, in sentences.
    ///
    /// # Errors
    /// Any [`ToolError`].
    pub fn apply(&self, canvas: Canvas, control: &mut Control) -> Result<(Canvas, Vec<String>), ToolError> {
        let Canvas { field: old, iso } = &canvas;
        let stroke = match self {
            Self::Carve(tool) => Err(tool.apply(Operation::Carve, old, *iso, control)?),
            Self::Add(tool) => Err(tool.apply(Operation::Add, old, *iso, control)?),
            Self::Pull(tool) => Ok(tool.begin(old, *iso)?),
            Self::Chisel(tool) => Ok(tool.begin(old, *iso, false)?),
            Self::Squirt(tool) => Ok(tool.begin(old, *iso, true)?),
            Self::Drill(tool) => Ok(tool.begin(old, *iso, false)?),
            Self::Join(tool) => Ok(tool.begin(old, *iso, true)?),
        };
        let (field, told) = match stroke {
            Err((field, report)) => (field, thin_parts(&report)),
            Ok(stroke) => {
                let (field, report) = stroke.finish(control)?;
                (field, late_paths(&report))
            }
        };
        Ok((Canvas { field, ..canvas }, told))
    }
}

/// Says what was too thin for the field.
fn thin_parts(report: &FieldFitReport) -> Vec<String> {
    let left = report.left.filter(|left| left.wrong_signs > 0);
    let told = left.map(|left| {
        format!(
            "{} of {} points have the wrong sign: parts thinner than a knot interval; allow more levels (finer)",
            left.wrong_signs, report.samples,
        )
    });
    told.into_iter().collect()
}

/// Says what did not arrive.
fn late_paths(report: &ForceReport) -> Vec<String> {
    let off = |share: f64| (share - 1.0).abs() > 0.02;
    let told = (off(report.arrival.least) || off(report.arrival.most)).then(|| {
        format!(
            "after {} steps the surface is at {:.1} to {:.1} % of its way; what is near holds it, or the rim of the field",
            report.steps,
            100.0 * report.arrival.least,
            100.0 * report.arrival.most,
        )
    });
    told.into_iter().collect()
}
