//! All tools behind one door: what they work on, and what they leave.

use bspline::HierarchicalSpline;
use fitting::field::FieldFitReport;
use fitting::{Control, FitError};

use crate::force::{ForceError, ForceTool};
use crate::geometric::{Geometric, GeometricError, Operation};
use crate::paint::{Layers, Paint, PaintError};

/// What a tool works on. Cheap to copy.
#[derive(Clone, Debug)]
pub struct Canvas {
    /// The field.
    pub field: HierarchicalSpline<f32>,
    /// Density of its surface.
    pub iso: f64,
    /// What is painted on it.
    pub layers: Layers,
}

/// A tool with all that it is told.
#[derive(Clone, Copy, Debug)]
pub enum Tool<'a> {
    /// Takes a solid out.
    Carve(&'a Geometric),
    /// Adds a solid.
    Add(&'a Geometric),
    /// Pushes or pulls.
    Force(ForceTool<'a>),
    /// Paints matter or touch.
    Paint(&'a Paint),
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
    /// Paint cannot be laid on.
    #[error(transparent)]
    Paint(#[from] PaintError),
}

impl ToolError {
    /// Whether the user said stop.
    pub fn is_cancelled(&self) -> bool {
        match self {
            Self::Geometric(e) => matches!(e, GeometricError::Fit(FitError::Cancelled)),
            Self::Force(e) => e.is_cancelled(),
            Self::Paint(_) => false,
        }
    }
}

impl Tool<'_> {
    /// Names of all tools, as sessions write them.
    pub const NAMES: [&'static str; 8] = {
        let [pull, chisel, squirt, drill, join] = ForceTool::NAMES;
        ["carve", "add", pull, chisel, squirt, drill, join, "paint"]
    };

    /// Its name, as sessions write it.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Carve(_) => "carve",
            Self::Add(_) => "add",
            Self::Force(tool) => tool.name(),
            Self::Paint(_) => "paint",
        }
    }

    /// What the tool leaves, and what is left to say of it, in sentences.
    ///
    /// # Errors
    /// Any [`ToolError`].
    pub fn apply(&self, canvas: Canvas, control: &mut Control) -> Result<(Canvas, Vec<String>), ToolError> {
        let (field, report) = match self {
            Self::Paint(paint) => {
                let everywhere = canvas.field.lattice().world_box();
                let layer = paint.apply(&canvas.field, &canvas.layers, &everywhere)?;
                let mut canvas = canvas;
                canvas.layers.insert(paint.layer, layer);
                return Ok((canvas, Vec::new()));
            }
            Self::Force(tool) => {
                let (field, told) = tool.apply(&canvas.field, canvas.iso, control)?;
                return Ok((Canvas { field, ..canvas }, told));
            }
            Self::Carve(tool) => tool.apply(Operation::Carve, &canvas.field, canvas.iso, control)?,
            Self::Add(tool) => tool.apply(Operation::Add, &canvas.field, canvas.iso, control)?,
        };
        Ok((Canvas { field, ..canvas }, thin_parts(&report)))
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
