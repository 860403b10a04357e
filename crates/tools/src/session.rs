//! Sessions: what is to be done to a document, stroke after stroke.

use bspline::HierarchicalSpline;
use fitting::Control;
use serde::{Deserialize, Serialize};

use crate::canvas::Canvas;
use crate::force::{Bend, Chisel, Drill, Extrude, ForceTool, Pull};
use crate::geometric::{
    Copy, Cut, Geometric, Inflate, Move, Paste, Push, Refine, Simplify, Smooth, Sweep, reflection,
};
use crate::hold::{Free, Hold};
use crate::limits::{Limits, Mask, Region};
use crate::material::Material;
use crate::number::{Numbers, Positive};
use crate::paint::Paint;
use crate::place::Place;
use crate::room::MOST_GROWTHS;
use crate::surface::Surface;
use crate::symmetry::Symmetry;
use crate::tool::{Tool, ToolError};

/// What a session file says.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Session {
    /// In their order.
    pub stroke: Vec<Stroke>,
}

/// Paint that is laid on while a force tool works.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct During {
    /// Steps that the tool has made by then; after its last one paint goes on the shape that is left.
    pub step: usize,
    /// What is painted.
    pub paint: Paint,
}

/// One use of a tool: exactly one of the tools is given.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stroke {
    /// Object that it works on; needed where there are several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub object: Option<String>,
    /// Takes a solid out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub carve: Option<Geometric>,
    /// Adds a solid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub add: Option<Geometric>,
    /// Carries a solid along a curve.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sweep: Option<Sweep>,
    /// Brings the surface elsewhere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pull: Option<Pull>,
    /// Cuts a groove.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chisel: Option<Chisel>,
    /// Lays a ridge.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub squirt: Option<Chisel>,
    /// Makes a hole or a cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drill: Option<Drill>,
    /// Makes a bridge or a seam.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub join: Option<Drill>,
    /// Draws an area out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub extrude: Option<Extrude>,
    /// Bends by forces.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bend: Option<Bend>,
    /// Carries along.
    #[serde(default, rename = "move", skip_serializing_if = "Option::is_none")]
    pub motion: Option<Move>,
    /// Evens out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub smooth: Option<Smooth>,
    /// Lifts or lowers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inflate: Option<Inflate>,
    /// Pushes in or draws out, step by step.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub push: Option<Push>,
    /// Keeps a copy.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub copy: Option<Copy>,
    /// Takes a box out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cut: Option<Cut>,
    /// Puts a box of an object in.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub paste: Option<Paste>,
    /// Puts knots in.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refine: Option<Refine>,
    /// Takes knots out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub simplify: Option<Simplify>,
    /// Whether the places of its way are those of a hand, one a step, and it is done step by step: see
    /// [`LiveStroke`](crate::live::LiveStroke).
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub paced: bool,
    /// Part of what a brush does that it does in a step by hand, 0 to 1, one a step; all of it if missing. Of `push` and `inflate` that is the
    /// way, of `smooth` the level, of `paint` the rate.
    #[serde(default, skip_serializing_if = "Numbers::is_empty")]
    pub press: Numbers,
    /// Paint laid on while a force tool works, in the order of steps.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub during: Vec<During>,
    /// Finest level of the field that the stroke sees and changes; what finer levels add stays where it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coarse: Option<usize>,
    /// A plane on both sides of which the stroke happens.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub symmetry: Option<Symmetry>,
    /// A box that it leaves nothing outside of changed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub within: Option<Region>,
    /// What may change.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mask: Option<Mask>,
    /// Thickness of the shell below the outer surface that stays as it is, to the bit: a world length.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wall: Option<Positive>,
    /// Paints matter or touch.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub paint: Option<Paint>,
    /// Constrains the force tools that come later.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hold: Option<Hold>,
    /// Takes constraints off.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub free: Option<Free>,
    /// Puts the whole object elsewhere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place: Option<Place>,
    /// Says what the object is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub material: Option<Material>,
    /// Says which density is the surface.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surface: Option<Surface>,
}

impl Stroke {
    /// The tool.
    ///
    /// # Errors
    /// A sentence, if there is none or more than one.
    pub fn tool(&self) -> Result<Tool<'_>, String> {
        let all = [
            self.carve.as_ref().map(Tool::Carve),
            self.add.as_ref().map(Tool::Add),
            self.sweep.as_ref().map(Tool::Sweep),
            self.pull.as_ref().map(|tool| Tool::Force(ForceTool::Pull(tool))),
            self.chisel
                .as_ref()
                .map(|tool| Tool::Force(ForceTool::Chisel(tool))),
            self.squirt
                .as_ref()
                .map(|tool| Tool::Force(ForceTool::Squirt(tool))),
            self.drill
                .as_ref()
                .map(|tool| Tool::Force(ForceTool::Drill(tool))),
            self.join.as_ref().map(|tool| Tool::Force(ForceTool::Join(tool))),
            self.extrude.as_ref().map(Tool::Extrude),
            self.bend.as_ref().map(Tool::Bend),
            self.motion.as_ref().map(Tool::Move),
            self.smooth.as_ref().map(Tool::Smooth),
            self.inflate.as_ref().map(Tool::Inflate),
            self.push.as_ref().map(Tool::Push),
            self.copy.as_ref().map(Tool::Copy),
            self.cut.as_ref().map(Tool::Cut),
            self.paste.as_ref().map(Tool::Paste),
            self.refine.as_ref().map(Tool::Refine),
            self.simplify.as_ref().map(Tool::Simplify),
            self.paint.as_ref().map(Tool::Paint),
            self.hold.as_ref().map(Tool::Hold),
            self.free.as_ref().map(Tool::Free),
            self.place.as_ref().map(Tool::Place),
            self.material.as_ref().map(Tool::Material),
            self.surface.as_ref().map(Tool::Surface),
        ];
        let given: Vec<_> = all.into_iter().flatten().collect();
        match given[..] {
            [one] => Ok(one),
            [] => Err(format!(
                "no tool is given; write one of {}",
                Tool::NAMES.join(", ")
            )),
            [one, other, ..] => Err(format!(
                "{} and {} are given; write a stroke for each",
                one.name(),
                other.name()
            )),
        }
    }

    /// What the stroke leaves of a canvas, and what is left to say of it, in sentences. Where the solid needs more room than the box of its
    /// field has, the box grows.
    ///
    /// # Errors
    /// Any [`ToolError`].
    pub fn apply(&self, canvas: Canvas, control: &mut Control) -> Result<(Canvas, Vec<String>), ToolError> {
        let stroke = self.of(canvas.material);
        let mut grown = canvas.clone();
        for growths in 0..=MOST_GROWTHS {
            match stroke.in_box(grown.clone(), control) {
                Err(why) if growths < MOST_GROWTHS => {
                    let larger = grown.face_for(&why).and_then(|face| grown.grown(face));
                    grown = larger.ok_or(why)?;
                }
                Err(why) => return Err(why),
                Ok((left, mut notes)) => {
                    notes.extend(left.growth_since(&canvas));
                    return Ok((left, notes));
                }
            }
        }
        unreachable!("the last round ends")
    }

    /// The stroke on an object of a material, which counts where the stroke says nothing else.
    pub(crate) fn of(&self, material: Material) -> Self {
        let mut stroke = self.clone();
        let drawn =
            [&mut stroke.chisel, &mut stroke.squirt].map(|tool| tool.as_mut().map(|tool| &mut tool.how));
        let bars = [&mut stroke.drill, &mut stroke.join].map(|tool| tool.as_mut().map(|tool| &mut tool.how));
        let pull = stroke.pull.as_mut().map(|tool| &mut tool.how);
        for how in drawn.into_iter().chain(bars).chain([pull]).flatten() {
            how.solid.get_or_insert(material.solid);
        }
        stroke
    }

    /// What the stroke leaves if the box of the field has room enough.
    fn in_box(&self, canvas: Canvas, control: &mut Control) -> Result<(Canvas, Vec<String>), ToolError> {
        let tool = self.tool().map_err(ToolError::Stroke)?;
        let (coarse, limits) = self.prepared(&canvas)?;
        let (left, notes) = self.on_both_sides(tool, coarse, &limits, None, control)?;
        Ok((self.completed(&canvas, left)?, notes))
    }

    /// What the tool sees of a canvas, and what it may change.
    pub(crate) fn prepared(&self, canvas: &Canvas) -> Result<(Canvas, Limits), ToolError> {
        let whole = canvas.field.lattice().world_box();
        let limits = Limits::new(self.within.as_ref(), self.mask.as_ref(), &canvas.others, &whole);
        let mut limits = (limits.map_err(ToolError::Stroke)?)
            .at_detail(canvas.detail)
            .at_density(canvas.density);
        if let Some(wall) = self.wall {
            let mirror = self.symmetry.map(|plane| reflection(plane.at.0, plane.normal.0));
            let below = limits.below(&canvas.field, canvas.iso, wall.0, mirror.transpose()?);
            limits = below.map_err(ToolError::Stroke)?;
        }
        let Some(level) = self.coarse else {
            return Ok((canvas.clone(), limits));
        };
        let coarse = Canvas {
            field: up_to(&canvas.field, level).map_err(ToolError::Stroke)?,
            ..canvas.clone()
        };
        Ok((coarse, limits.up_to(level)))
    }

    /// What the tool left of what it saw of a canvas, with all that it did not see.
    pub(crate) fn completed(&self, whole: &Canvas, mut left: Canvas) -> Result<Canvas, ToolError> {
        let Some(level) = self.coarse else { return Ok(left) };
        let below = up_to(&whole.field, level).map_err(ToolError::Stroke)?;
        let difference = below.difference(&left.field).expect("versions of one field");
        left.field = whole.field.applied(&difference).map_err(|_| {
            let name = self.tool().map_or("the tool", |tool| tool.name());
            ToolError::Stroke(format!(
                "{name} works on finer levels than {level}; leave coarse out"
            ))
        })?;
        Ok(left)
    }

    /// What the tool leaves if it is used as the stroke's symmetry says; `done` is what it left on its own side, if that is
    /// known.
    pub(crate) fn on_both_sides(
        &self,
        tool: Tool,
        canvas: Canvas,
        limits: &Limits,
        mut done: Option<(Canvas, Vec<String>)>,
        control: &mut Control,
    ) -> Result<(Canvas, Vec<String>), ToolError> {
        let is_stepped = self.paced || !self.during.is_empty();
        if !self.press.is_empty() && !self.paced {
            let why = "press is that of a hand in each step; leave it out, or write paced = true";
            return Err(ToolError::Stroke(why.into()));
        }
        let mut once = |canvas: Canvas| match (done.take(), is_stepped) {
            (Some(done), _) => Ok(done),
            (None, true) => self.worked(tool, canvas, limits, control),
            (None, false) => tool.apply(canvas, limits, control),
        };
        let Some(symmetry) = &self.symmetry else {
            return once(canvas);
        };
        if let Tool::Copy(_)
        | Tool::Hold(_)
        | Tool::Free(_)
        | Tool::Place(_)
        | Tool::Material(_)
        | Tool::Surface(_) = tool
        {
            let why = format!("{} knows no symmetry; write a stroke for each side", tool.name());
            return Err(ToolError::Stroke(why));
        }
        let mut paints = self
            .paint
            .iter()
            .chain(self.during.iter().map(|d| &d.paint))
            .peekable();
        let is_painting = paints.peek().is_some();
        if paints.any(|paint| paint.brush.is_none()) {
            let why = "only brushes paint on both sides; let the formula or the curve say both, or write a stroke for each side";
            return Err(ToolError::Stroke(why.into()));
        }
        symmetry.apply(canvas, tool, is_painting, once)
    }
}

/// The field without what is finer than a level.
fn up_to(field: &HierarchicalSpline<f32>, level: usize) -> Result<HierarchicalSpline<f32>, String> {
    let finest = field.level_count() - 1;
    if level > finest {
        return Err(format!(
            "coarse is {level}; the field has the levels 0 to {finest}"
        ));
    }
    let levels = (0..=level).map(|level| field.corrections(level)).collect();
    Ok(HierarchicalSpline::from_corrections(
        *field.lattice(),
        field.slope(),
        levels,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stroke_has_one_tool() {
        let ball = "along = [[0, 0, 0]]\nshape.sphere.radius = 1\n";
        let told = |text: &str| toml::from_str::<Stroke>(text).unwrap().tool().map(|t| t.name());
        assert_eq!(told(&format!("[carve]\n{ball}")).unwrap(), "carve");
        let none = told("object = \"a\"").unwrap_err();
        assert!(Tool::NAMES.iter().all(|name| none.contains(name)), "{none}");
        let two = told(&format!("[carve]\n{ball}[add]\n{ball}")).unwrap_err();
        assert!(two.contains("carve and add"), "{two}");
    }
}
