//! Strokes by hand as scripts say them.

use glam::DVec3;

use super::Pose;
use crate::curve::Along;
use crate::force::ForceTool;
use crate::geometric::{Motion, Push};
use crate::number::{Finite, Numbers, Point};
use crate::session::Stroke;
use crate::tool::{Tool, ToolError};

impl Stroke {
    /// Number of steps of a stroke that was made by hand.
    pub fn step_count(&self) -> Option<usize> {
        self.paced.then(|| self.poses().map_or(0, |poses| poses.len()))
    }

    /// Poses of the tool, one a step.
    pub(crate) fn poses(&self) -> Result<Vec<Pose>, ToolError> {
        let mut poses = self.unpressed()?;
        let presses = &self.press.0;
        if presses.is_empty() {
            return Ok(poses);
        }
        if !self.has_press() {
            let why = "press is of push, inflate, smooth and the brush of paint alone; leave it out";
            return Err(ToolError::Stroke(why.into()));
        }
        if presses.len() != poses.len() {
            return Err(ToolError::Stroke(format!(
                "there are {} places and {} presses; write one press for each place",
                poses.len(),
                presses.len()
            )));
        }
        for (pose, press) in poses.iter_mut().zip(presses) {
            pose.press = press.0;
            pose.check()?;
        }
        Ok(poses)
    }

    /// Whether a hand that presses less does less.
    pub(super) fn has_press(&self) -> bool {
        let paints = self.paint.as_ref().is_some_and(|tool| tool.brush.is_some());
        paints || self.push.is_some() || self.inflate.is_some() || self.smooth.is_some()
    }

    fn unpressed(&self) -> Result<Vec<Pose>, ToolError> {
        let tool = self.tool().map_err(ToolError::Stroke)?;
        let places = |along: &[Point]| along.iter().map(|p| Pose::at(p.0)).collect();
        Ok(match tool {
            Tool::Carve(tool) | Tool::Add(tool) => {
                let turn = |n: usize| {
                    tool.turn
                        .get(n)
                        .or(tool.turn.first())
                        .map_or(DVec3::ZERO, |t| t.0)
                };
                let along = tool.along.iter().enumerate();
                along
                    .map(|(n, at)| Pose {
                        turn: turn(n),
                        ..Pose::at(at.0)
                    })
                    .collect()
            }
            Tool::Push(tool) => forced(tool)?,
            Tool::Force(ForceTool::Chisel(tool) | ForceTool::Squirt(tool)) => places(by_points(&tool.along)?),
            Tool::Force(ForceTool::Drill(tool) | ForceTool::Join(tool)) => places(by_points(&tool.along)?),
            Tool::Force(ForceTool::Pull(tool)) => {
                if tool.by.is_some() || tool.lift.is_some() {
                    let why = "a pull by hand goes where the hand goes; write way, a vector for each step, and not by or lift";
                    return Err(ToolError::Stroke(why.into()));
                }
                places(tool.way.as_deref().unwrap_or_default())
            }
            Tool::Smooth(tool) => places(&tool.along),
            Tool::Inflate(tool) => places(&tool.along),
            Tool::Paint(tool) => match &tool.brush {
                Some(brush) => places(&brush.along),
                None => return Err(not_by_hand(&Tool::Paint(tool))),
            },
            Tool::Move(tool) => match &tool.motion {
                Motion::Grab { along, .. } => places(along),
                _ => return Err(not_by_hand(&Tool::Move(tool))),
            },
            other => return Err(not_by_hand(&other)),
        })
    }

    /// One pose more, with its turn and its force where these are the hand's; a hand that grabs has the first and the last alone.
    pub(super) fn add_pose(&mut self, pose: Pose, turns: bool, forces: bool) {
        let at = Point(pose.at);
        // A hand that pressed all the way has no presses.
        if pose.press != 1.0 || !self.press.is_empty() {
            let before = self.unpressed().map_or(0, |poses| poses.len());
            self.press.0.resize(before, Finite(1.0));
            self.press.0.push(Finite(pose.press));
        }
        for tool in [&mut self.carve, &mut self.add].into_iter().flatten() {
            // Solids that were not turned so far have no turns.
            if turns && (pose.turn != DVec3::ZERO || !tool.turn.is_empty()) {
                tool.turn.resize(tool.along.len(), Point(DVec3::ZERO));
                tool.turn.push(Point(pose.turn));
            }
            tool.along.push(at);
        }
        for tool in [&mut self.chisel, &mut self.squirt].into_iter().flatten() {
            tool.along.push(at);
        }
        for tool in [&mut self.drill, &mut self.join].into_iter().flatten() {
            tool.along.push(at);
        }
        if let Some(tool) = &mut self.pull {
            tool.way.get_or_insert_default().push(at);
        }
        if let Some(tool) = &mut self.smooth {
            tool.along.push(at);
        }
        if let Some(tool) = &mut self.inflate {
            tool.along.push(at);
        }
        if let Some(tool) = &mut self.push {
            // A hand that always pushed by 1 has no forces.
            if forces && (pose.force != 1.0 || !tool.force.is_empty()) {
                tool.force.0.resize(tool.along.len(), Finite(1.0));
                tool.force.0.push(Finite(pose.force));
            }
            tool.along.push(at);
        }
        if let Some(brush) = self.paint.as_mut().and_then(|tool| tool.brush.as_mut()) {
            brush.along.push(at);
        }
    }

    /// Puts a solid or a brush to one place, in place of its way.
    ///
    /// # Errors
    /// [`ToolError::Stroke`] for a place that makes no sense, and for a tool that has none.
    pub fn put(&mut self, pose: Pose) -> Result<(), ToolError> {
        pose.check()?;
        let at = vec![Point(pose.at)];
        if let Some(tool) = self.carve.as_mut().or(self.add.as_mut()) {
            (tool.along, tool.turn) = (at, vec![Point(pose.turn)]);
        } else if let Some(tool) = &mut self.smooth {
            tool.along = at;
        } else if let Some(tool) = &mut self.inflate {
            tool.along = at;
        } else if let Some(tool) = &mut self.push {
            (tool.along, tool.force) = (at, Numbers(vec![Finite(pose.force)]));
        } else if let Some(brush) = self.paint.as_mut().and_then(|tool| tool.brush.as_mut()) {
            brush.along = at;
        } else {
            let tool = self.tool().map_err(ToolError::Stroke)?;
            return Err(ToolError::Stroke(format!(
                "{} is not put in place; write where it acts",
                tool.name()
            )));
        }
        Ok(())
    }

    /// A hand that grabs goes from place to place.
    pub(super) fn grab(&mut self, places: [DVec3; 2]) {
        if let Some(tool) = &mut self.motion
            && let Motion::Grab { along, .. } = &mut tool.motion
        {
            *along = places.map(Point).to_vec();
        }
    }
}

/// Poses of a brush that pushes, with their forces.
fn forced(tool: &Push) -> Result<Vec<Pose>, ToolError> {
    let (places, forces) = (tool.along.len(), tool.force.0.len());
    if forces > 1 && forces != places {
        return Err(ToolError::Stroke(format!(
            "there are {places} places and {forces} forces; write one force for all, or one for each place"
        )));
    }
    if tool.steps.is_some() {
        let why = "by hand every place is a step; leave steps out, or paced";
        return Err(ToolError::Stroke(why.into()));
    }
    let force = |n: usize| tool.force.0.get(n).or(tool.force.0.first()).map_or(1.0, |f| f.0);
    let pose = |(n, at): (usize, &Point)| Pose {
        force: force(n),
        ..Pose::at(at.0)
    };
    Ok(tool.along.iter().enumerate().map(pose).collect())
}

pub fn not_by_hand(tool: &Tool) -> ToolError {
    ToolError::Stroke(format!(
        "{} goes nowhere by hand; use it in a stroke of its own, without paced",
        tool.name()
    ))
}

/// The places of a tool by hand: it has no other curves.
fn by_points(along: &Along) -> Result<&[Point], ToolError> {
    match along {
        Along::Points(points) => Ok(points),
        Along::Curve(_) => {
            let why = "a tool by hand goes from point to point; write points for along, or leave paced out";
            Err(ToolError::Stroke(why.into()))
        }
    }
}
