//! Tools at work, step by step.

use fitting::Control;
use glam::DVec3;

use super::Pose;
use super::script::not_by_hand;
use crate::canvas::Canvas;
use crate::force::{ForceError, ForceStroke, ForceTool, released, swept};
use crate::geometric::{Geometric, GeometricError};
use crate::limits::Limits;
use crate::number::{Finite, Numbers, Point, Positive};
use crate::paint::{Paint, PaintError};
use crate::session::{During, Stroke};
use crate::tool::{Tool, ToolError};

/// A tool at work on a canvas, step by step.
pub(crate) struct Work {
    before: Canvas,
    limits: Limits,
    /// As solids and brushes have left it.
    canvas: Canvas,
    /// Of force tools, once they have found a surface.
    force: Option<ForceStroke<f32>>,
    last: Option<Pose>,
    pub steps: usize,
    /// Steps in which there was nothing to work on, and why in the first of them.
    missed: Option<(usize, ToolError)>,
}

impl Work {
    /// The tool of a stroke before its first step.
    pub fn new(stroke: &Stroke, whole: &Canvas) -> Result<Self, ToolError> {
        let (canvas, limits) = stroke.prepared(whole)?;
        Self::begun(stroke.tool().map_err(ToolError::Stroke)?, canvas, limits)
    }

    fn begun(tool: Tool, canvas: Canvas, limits: Limits) -> Result<Self, ToolError> {
        // A hand that pulls takes hold before it goes anywhere.
        let force = match tool {
            Tool::Force(tool @ ForceTool::Pull(_)) => {
                let holding = canvas.holding(&limits);
                Some(tool.hold(&canvas.field, canvas.iso, &canvas.layers, &holding, DVec3::ZERO)?)
            }
            _ => None,
        };
        Ok(Self {
            force,
            ..Self::on(canvas, limits)
        })
    }

    /// A force tool that knows its way.
    fn of_force(force: ForceStroke<f32>, canvas: Canvas, limits: &Limits) -> Result<Self, ToolError> {
        Ok(Self {
            force: Some(force.painted(&canvas.layers)?.held(&canvas.holding(limits))?),
            ..Self::on(canvas, limits.clone())
        })
    }

    fn on(canvas: Canvas, limits: Limits) -> Self {
        Self {
            before: canvas.clone(),
            limits,
            canvas,
            force: None,
            last: None,
            steps: 0,
            missed: None,
        }
    }

    /// One step; gives the force on the solid. One that fails does not count.
    pub fn step(&mut self, tool: Tool, pose: Pose, control: &mut Control) -> Result<DVec3, ToolError> {
        let force = self.tried(tool, self.last, pose, control)?;
        self.last = Some(pose);
        self.steps += 1;
        Ok(force)
    }

    fn tried(
        &mut self,
        tool: Tool,
        from: Option<Pose>,
        pose: Pose,
        control: &mut Control,
    ) -> Result<DVec3, ToolError> {
        if let Tool::Force(tool) = tool {
            let Canvas {
                field, iso, layers, ..
            } = &self.canvas;
            let force = match &mut self.force {
                Some(force) => force,
                None => match tool.hold(field, *iso, layers, &self.canvas.holding(&self.limits), pose.at) {
                    Ok(held) => self.force.insert(held),
                    Err(why) => return self.miss(why.into()).map(|()| DVec3::ZERO),
                },
            };
            if let Err(why) = force.check_way(pose.at).map_err(ToolError::from)
                && self.before.face_for(&why).is_some()
            {
                return Err(why);
            }
            force.pose(pose.at)?;
            force.step()?;
            return Ok(force.force());
        }
        let is_solid = matches!(tool, Tool::Carve(_) | Tool::Add(_));
        if is_solid && from == Some(pose) || pose.press == 0.0 {
            return Ok(DVec3::ZERO);
        }
        match between(tool, from.unwrap_or(pose), pose, |tool| {
            tool.apply(self.canvas.clone(), &self.limits, control)
        }) {
            Ok((canvas, _)) => self.canvas = canvas,
            Err(why) => self.miss(why)?,
        }
        Ok(DVec3::ZERO)
    }

    /// The force tool at work, and the pose of its last step.
    pub fn pulled(&self) -> Option<(&ForceStroke<f32>, DVec3)> {
        Some((self.force.as_ref()?, self.last?.at))
    }

    /// Of a force tool the box that moves.
    pub fn moving(&self) -> Option<[DVec3; 8]> {
        Some(self.force.as_ref()?.moving())
    }

    /// The motion of a stroke from the canvas as it was.
    pub fn carry(&mut self, stroke: &Stroke, stays: bool, control: &mut Control) -> Result<(), ToolError> {
        self.steps += 1;
        let before = self.before.clone();
        self.canvas = match stays {
            true => before,
            false => {
                let tool = stroke.tool().map_err(ToolError::Stroke)?;
                tool.apply(before, &self.limits, control)?.0
            }
        };
        Ok(())
    }

    /// All steps of a stroke, with the paint that comes between them; gives the rest of it.
    pub fn redo<'a>(&mut self, stroke: &'a Stroke, control: &mut Control) -> Result<&'a [During], ToolError> {
        let tool = stroke.tool().map_err(ToolError::Stroke)?;
        let poses = stroke.poses()?;
        let count = poses.len() as f64;
        let mut during = &stroke.during[..];
        for (n, pose) in poses.into_iter().enumerate() {
            control
                .step("sculpting", n as f64 / count)
                .map_err(ForceError::Cancelled)?;
            during = self.lay_due(during, control)?;
            self.step(tool, pose, control)?;
        }
        Ok(during)
    }

    /// Lets the tool of a stroke by hand go, and does what is to be done on the other side: what is left of `whole`.
    pub fn ended(
        self,
        stroke: &Stroke,
        whole: &Canvas,
        control: &mut Control,
    ) -> Result<(Canvas, Vec<String>), ToolError> {
        let (seen, limits) = (self.before.clone(), self.limits.clone());
        let done = self.finish(&[], control)?;
        let tool = stroke.tool().map_err(ToolError::Stroke)?;
        let (left, notes) = stroke.on_both_sides(tool, seen, &limits, Some(done), control)?;
        Ok((stroke.completed(whole, left)?, notes))
    }

    /// The canvas as it is now.
    pub fn now(&self) -> Result<Canvas, ToolError> {
        Ok(match &self.force {
            Some(force) => Canvas {
                field: self.limits.kept(&self.before.field, &force.field()?),
                ..self.canvas.clone()
            },
            None => self.canvas.clone(),
        })
    }

    /// Lays paint on the canvas, and under the tool.
    pub fn lay_on(&mut self, paint: &Paint, control: &mut Control) -> Result<(), ToolError> {
        let (painted, _) = Tool::Paint(paint).apply(self.canvas.clone(), &self.limits, control)?;
        if let Some(force) = &mut self.force {
            force.repaint(&painted.layers)?;
        }
        self.canvas = painted;
        Ok(())
    }

    /// Lays on the paint whose step has come; gives the rest.
    fn lay_due<'a>(
        &mut self,
        mut during: &'a [During],
        control: &mut Control,
    ) -> Result<&'a [During], ToolError> {
        while let [first, rest @ ..] = during
            && first.step <= self.steps
        {
            self.lay_on(&first.paint, control)?;
            during = rest;
        }
        Ok(during)
    }

    /// Lets the tool go: what it leaves, and what is left to say. Paint that is still to come goes on in its steps.
    pub fn finish(
        mut self,
        mut during: &[During],
        control: &mut Control,
    ) -> Result<(Canvas, Vec<String>), ToolError> {
        let mut notes = Vec::new();
        if let Some(mut force) = self.force.take() {
            force.let_go();
            if let Some((count, why)) = force.missed() {
                notes.push(format!(
                    "at {count} places of its way it had nothing to work on, first: {why}"
                ));
            }
            let poses = self.steps;
            while !force.is_over() {
                control
                    .step("pulling", force.progress())
                    .map_err(ForceError::Cancelled)?;
                self.force = Some(force);
                during = self.lay_due(during, control)?;
                force = self.force.take().expect("put there above");
                force.step()?;
                self.steps += 1;
            }
            self.steps = poses;
            let (field, told) = released(force)?;
            let old = &self.before.field;
            let field = swept(old, field, self.before.iso, &self.limits, control)?;
            self.canvas.field = self.limits.kept(old, &field);
            notes.extend(told);
        }
        for late in during {
            self.lay_on(&late.paint, control)?;
        }
        match self.missed {
            Some((count, why)) if count == self.steps => return Err(why),
            Some((count, why)) => notes.push(format!(
                "in {count} of {} steps it had nothing to work on, first: {why}",
                self.steps
            )),
            None => {}
        }
        Ok((self.canvas, notes))
    }

    /// Counts a step in which the tool was beside the object; any other error stays one.
    fn miss(&mut self, why: ToolError) -> Result<(), ToolError> {
        let is_beside = match why {
            // There the box can grow.
            ToolError::Geometric(GeometricError::Leaves { .. }) => self.before.face_for(&why).is_none(),
            ToolError::Geometric(
                GeometricError::Outside { .. }
                | GeometricError::Beside { .. }
                | GeometricError::Nowhere { .. },
            )
            | ToolError::Force(ForceError::Nowhere { .. } | ForceError::Outside { .. })
            | ToolError::Paint(PaintError::Outside(..)) => true,
            _ => false,
        };
        match (&mut self.missed, is_beside) {
            (_, false) => return Err(why),
            (Some((count, _)), true) => *count += 1,
            (none, true) => *none = Some((1, why)),
        }
        Ok(())
    }
}

impl Stroke {
    /// What the steps of a stroke leave that is led by a hand, or painted on meanwhile.
    pub(crate) fn worked(
        &self,
        tool: Tool,
        canvas: Canvas,
        limits: &Limits,
        control: &mut Control,
    ) -> Result<(Canvas, Vec<String>), ToolError> {
        check_during(tool, &self.during)?;
        if let (Tool::Force(tool), false) = (tool, self.paced) {
            let force = tool.begin(&canvas.field, canvas.iso)?;
            return Work::of_force(force, canvas, limits)?.finish(&self.during, control);
        }
        if matches!(tool, Tool::Move(_)) {
            let why = "a move by hand is a move; leave paced out";
            return Err(ToolError::Stroke(why.into()));
        }
        if self.poses()?.is_empty() {
            let why = "a stroke by hand has no pose; write at least one, or leave paced out";
            return Err(ToolError::Stroke(why.into()));
        }
        let mut work = Work::begun(tool, canvas, limits.clone())?;
        let during = work.redo(self, control)?;
        work.finish(during, control)
    }
}

/// Uses a solid or a brush on the way from pose to pose.
fn between<R>(
    tool: Tool,
    from: Pose,
    to: Pose,
    apply: impl FnOnce(&Tool) -> Result<R, ToolError>,
) -> Result<R, ToolError> {
    let along = match from.at == to.at {
        true => vec![Point(to.at)],
        false => vec![Point(from.at), Point(to.at)],
    };
    let solid = |tool: &Geometric| match (tool.each, from == to) {
        (false, false) => Geometric {
            along: vec![Point(from.at), Point(to.at)],
            turn: vec![Point(from.turn), Point(to.turn)],
            ..tool.clone()
        },
        _ => Geometric {
            along: vec![Point(to.at)],
            turn: vec![Point(to.turn)],
            ..tool.clone()
        },
    };
    match tool {
        Tool::Carve(tool) => apply(&Tool::Carve(&solid(tool))),
        Tool::Add(tool) => apply(&Tool::Add(&solid(tool))),
        Tool::Smooth(tool) => {
            let mut tool = tool.clone();
            let level = (to.press * f64::from(tool.level)).round().max(1.0);
            (tool.along, tool.level) = (along, level as u8);
            apply(&Tool::Smooth(&tool))
        }
        Tool::Inflate(tool) => {
            let mut tool = tool.clone();
            (tool.along, tool.by) = (along, Finite(to.press * tool.by.0));
            apply(&Tool::Inflate(&tool))
        }
        Tool::Push(tool) => {
            let mut tool = tool.clone();
            (tool.along, tool.force) = (along, Numbers(vec![Finite(to.press * to.force)]));
            apply(&Tool::Push(&tool))
        }
        Tool::Paint(tool) => {
            let mut tool = tool.clone();
            if let Some(brush) = &mut tool.brush {
                let rate = brush.rate.map_or(1.0, |rate| rate.0);
                (brush.along, brush.rate) = (along, Some(Positive(to.press * rate)));
            }
            apply(&Tool::Paint(&tool))
        }
        other => Err(not_by_hand(&other)),
    }
}

/// Refuses paint beside tools that take no time, and paint out of order.
pub fn check_during(tool: Tool, during: &[During]) -> Result<(), ToolError> {
    if !during.is_empty() && !matches!(tool, Tool::Force(_)) {
        return Err(ToolError::Stroke(format!(
            "{} takes no time in which to paint; paint in a stroke of its own, or during a force tool",
            tool.name()
        )));
    }
    match during.windows(2).find(|pair| pair[0].step > pair[1].step) {
        Some(pair) => Err(ToolError::Stroke(format!(
            "paint of step {} stands behind that of step {}; write them in their order",
            pair[1].step, pair[0].step
        ))),
        None => Ok(()),
    }
}
