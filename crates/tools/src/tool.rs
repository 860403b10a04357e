//! All tools behind one door: what they work on, and what they leave.

use bspline::{Aabb, HierarchicalSpline};
use fitting::field::FieldFitReport;
use fitting::{Control, FitError};

use crate::canvas::Canvas;
use crate::face::cut_off;
use crate::force::{Bend, Extrude, ForceError, ForceTool, swept};
use crate::geometric::{
    Copy, Cut, Geometric, GeometricError, Inflate, Move, Operation, Origin, Paste, Push, Refine, Simplify,
    Smooth, Sweep,
};
use crate::hold::{Free, Hold};
use crate::limits::Limits;
use crate::material::Material;
use crate::paint::{Layers, Paint, PaintError};
use crate::place::Place;
use crate::surface::Surface;

/// A tool with all that it is told.
#[derive(Clone, Copy, Debug)]
pub enum Tool<'a> {
    /// Takes a solid out.
    Carve(&'a Geometric),
    /// Adds a solid.
    Add(&'a Geometric),
    /// Carries a solid along a curve.
    Sweep(&'a Sweep),
    /// Pushes or pulls.
    Force(ForceTool<'a>),
    /// Draws an area out.
    Extrude(&'a Extrude),
    /// Bends by forces.
    Bend(&'a Bend),
    /// Carries along.
    Move(&'a Move),
    /// Evens out.
    Smooth(&'a Smooth),
    /// Lifts or lowers.
    Inflate(&'a Inflate),
    /// Pushes in or draws out, step by step.
    Push(&'a Push),
    /// Keeps a copy.
    Copy(&'a Copy),
    /// Takes a box out.
    Cut(&'a Cut),
    /// Puts a box of an object in.
    Paste(&'a Paste),
    /// Puts knots in.
    Refine(&'a Refine),
    /// Takes knots out.
    Simplify(&'a Simplify),
    /// Paints matter or touch.
    Paint(&'a Paint),
    /// Constrains.
    Hold(&'a Hold),
    /// Takes constraints off.
    Free(&'a Free),
    /// Puts the whole object elsewhere.
    Place(&'a Place),
    /// Says what the object is.
    Material(&'a Material),
    /// Says which density is the surface.
    Surface(&'a Surface),
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
    /// The stroke names no tool, or several, or limits that make no sense.
    #[error("{0}")]
    Stroke(String),
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
            Self::Stroke(_) | Self::Paint(_) => false,
        }
    }
}

impl Tool<'_> {
    /// Names of all tools, as sessions write them.
    pub const NAMES: [&'static str; 25] = {
        let [pull, chisel, squirt, drill, join] = ForceTool::NAMES;
        [
            "carve", "add", "sweep", pull, chisel, squirt, drill, join, "extrude", "bend", "move", "smooth",
            "inflate", "push", "copy", "cut", "paste", "refine", "simplify", "paint", "hold", "free",
            "place", "material", "surface",
        ]
    };

    /// Its name, as sessions write it.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Carve(_) => "carve",
            Self::Add(_) => "add",
            Self::Sweep(_) => "sweep",
            Self::Force(tool) => tool.name(),
            Self::Extrude(_) => "extrude",
            Self::Bend(_) => "bend",
            Self::Move(_) => "move",
            Self::Smooth(_) => "smooth",
            Self::Inflate(_) => "inflate",
            Self::Push(_) => "push",
            Self::Copy(_) => "copy",
            Self::Cut(_) => "cut",
            Self::Paste(_) => "paste",
            Self::Refine(_) => "refine",
            Self::Simplify(_) => "simplify",
            Self::Paint(_) => "paint",
            Self::Hold(_) => "hold",
            Self::Free(_) => "free",
            Self::Place(_) => "place",
            Self::Material(_) => "material",
            Self::Surface(_) => "surface",
        }
    }

    /// What the tool leaves within limits, and what is left to say of it, in sentences.
    ///
    /// # Errors
    /// Any [`ToolError`].
    pub fn apply(
        &self,
        canvas: Canvas,
        limits: &Limits,
        control: &mut Control,
    ) -> Result<(Canvas, Vec<String>), ToolError> {
        let Canvas {
            field: old,
            iso,
            others,
            ..
        } = &canvas;
        let mut copies = canvas.copies.clone();
        let (field, report) = match self {
            Self::Move(tool) => {
                let (field, report) = tool.apply(old, *iso, limits, control)?;
                let origin = tool.motion.origin(&old.lattice().world_box())?;
                let layers = carried(&origin, &canvas, limits)?;
                let to = |p| p + limits.share(p) * (origin.forth(p) - p);
                let holds = canvas.holds.iter().map(|held| held.carried(to)).collect();
                let notes = told(&report, old, &field, *iso);
                let moved = Canvas {
                    field,
                    layers,
                    holds,
                    ..canvas
                };
                return Ok((moved, notes));
            }
            Self::Paint(paint) => {
                let layer = canvas.painted(paint, limits)?;
                let mut canvas = canvas;
                canvas.layers.insert(paint.layer, layer);
                return Ok((canvas, Vec::new()));
            }
            Self::Force(_) | Self::Extrude(_) | Self::Bend(_) => {
                let (layers, holding) = (&canvas.layers, canvas.holding(limits));
                let (field, told) = match self {
                    Self::Extrude(tool) => tool.apply(old, *iso, layers, &holding, control)?,
                    Self::Bend(tool) => tool.apply(old, *iso, layers, &holding, control)?,
                    Self::Force(tool) => tool.apply(old, *iso, layers, &holding, control)?,
                    _ => unreachable!("it is one of these"),
                };
                let field = limits.kept(old, &swept(old, field, *iso, limits, control)?);
                return Ok((Canvas { field, ..canvas }, told));
            }
            Self::Hold(hold) => {
                let holds = hold.joined(old, *iso, &canvas.holds).map_err(ToolError::Stroke)?;
                return Ok((Canvas { holds, ..canvas }, Vec::new()));
            }
            Self::Free(free) => {
                let holds = free.left(&canvas.holds).map_err(ToolError::Stroke)?;
                return Ok((Canvas { holds, ..canvas }, Vec::new()));
            }
            Self::Place(place) => {
                let placement = place.apply(&canvas).map_err(ToolError::Stroke)?;
                return Ok((Canvas { placement, ..canvas }, Vec::new()));
            }
            Self::Material(material) => {
                let material = **material;
                return Ok((Canvas { material, ..canvas }, Vec::new()));
            }
            Self::Surface(surface) => {
                let iso = surface.apply(&canvas).map_err(ToolError::Stroke)?;
                return Ok((Canvas { iso, ..canvas }, Vec::new()));
            }
            Self::Copy(copy) => {
                copies.push(copy.to.clone());
                return Ok((Canvas { copies, ..canvas }, Vec::new()));
            }
            Self::Refine(tool) => (tool.apply(old, limits)?, FieldFitReport::default()),
            Self::Simplify(tool) => (tool.apply(old, limits)?, FieldFitReport::default()),
            Self::Carve(tool) => tool.apply(Operation::Carve, old, *iso, others, limits, control)?,
            Self::Add(tool) => tool.apply(Operation::Add, old, *iso, others, limits, control)?,
            Self::Sweep(tool) => tool.apply(old, *iso, limits, control)?,
            Self::Smooth(tool) => tool.apply(old, *iso, limits, control)?,
            Self::Inflate(tool) => tool.apply(old, *iso, limits, control)?,
            Self::Push(tool) => tool.apply(old, *iso, limits, control)?,
            Self::Cut(tool) => {
                copies.extend(tool.to.clone());
                tool.apply(old, *iso, limits, control)?
            }
            Self::Paste(tool) => tool.apply(old, *iso, others, limits, control)?,
        };
        let notes = told(&report, old, &field, *iso);
        let canvas = Canvas {
            field,
            copies,
            ..canvas
        };
        Ok((canvas, notes))
    }
}

/// What is painted, carried along by a move as far as the limits allow.
fn carried(origin: &Origin, canvas: &Canvas, limits: &Limits) -> Result<Layers, ToolError> {
    let whole = canvas.field.lattice().world_box();
    let reach = origin.reach();
    let within = limits.cut(&Aabb {
        min: reach.min.max(whole.min),
        max: reach.max.min(whole.max),
    });
    let painted = canvas.layers.iter().filter(|(_, layer)| !layer.is_empty());
    let layers = painted.map(|(substance, layer)| {
        let moved = layer
            .carried(&within, |p| origin.back(p))
            .map_err(PaintError::from)?;
        let kept = limits.kept(layer.tree(), moved.tree());
        Ok((
            *substance,
            layer.with_tree(kept).expect("nodes of the same level"),
        ))
    });
    layers.collect()
}

/// Says what was too thin for the field, or beyond it.
fn told(
    report: &FieldFitReport,
    before: &HierarchicalSpline<f32>,
    after: &HierarchicalSpline<f32>,
    iso: f64,
) -> Vec<String> {
    let left = report.left.filter(|left| left.wrong_signs > 0);
    let told = left.map(|left| {
        format!(
            "{} of {} points have the wrong sign: parts thinner than a knot interval; allow more levels (finer)",
            left.wrong_signs, report.samples,
        )
    });
    told.into_iter().chain(cut_off(before, after, iso)).collect()
}
