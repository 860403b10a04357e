//! Sessions: what is to be done to a document, stroke after stroke.

use fitting::Control;
use serde::{Deserialize, Serialize};

use crate::force::{Chisel, Drill, ForceTool, Pull};
use crate::geometric::{Geometric, Move};
use crate::limits::{Limits, Mask, Region};
use crate::paint::Paint;
use crate::tool::{Canvas, Tool, ToolError};

/// What a session file says.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Session {
    /// In their order.
    pub stroke: Vec<Stroke>,
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
    /// Carries along.
    #[serde(default, rename = "move", skip_serializing_if = "Option::is_none")]
    pub motion: Option<Move>,
    /// A box that it leaves nothing outside of changed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub within: Option<Region>,
    /// What may change.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mask: Option<Mask>,
    /// Paints matter or touch.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub paint: Option<Paint>,
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
            self.motion.as_ref().map(Tool::Move),
            self.paint.as_ref().map(Tool::Paint),
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

    /// What the stroke leaves of a canvas, and what is left to say of it, in sentences.
    ///
    /// # Errors
    /// Any [`ToolError`].
    pub fn apply(&self, canvas: Canvas, control: &mut Control) -> Result<(Canvas, Vec<String>), ToolError> {
        let tool = self.tool().map_err(ToolError::Stroke)?;
        let limits = Limits::new(self.within.as_ref(), self.mask.as_ref(), &canvas.others);
        let limits = limits.map_err(ToolError::Stroke)?.at_detail(canvas.detail);
        tool.apply(canvas, &limits, control)
    }
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
