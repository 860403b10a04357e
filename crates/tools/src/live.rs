//! Strokes in a hand: a pose for each step, as they come.
//!
//! A [`LiveStroke`] is begun with a tool that has no way yet, told a [`Pose`] a step, and ended: then there is a canvas, and the
//! stroke as a script says it, with the pose of every step. The script ([`Stroke::paced`]) leaves the same canvas, to the bit:
//! it is done by the same steps.
//!
//! Force tools move the solid step by step; their region follows them. Solids and brushes act on the way from pose to
//! pose. A hand that grabs carries along what it took hold of to where it is, by one motion of the field as it was.

use bspline::{Aabb, Field, HierarchicalSpline};
use fitting::Control;
use glam::DVec3;

use crate::curve::Along;
use crate::force::{ForceError, ForceStroke, ForceTool, released};
use crate::geometric::{Geometric, GeometricError, Motion};
use crate::limits::Limits;
use crate::number::Point;
use crate::paint::{Paint, PaintError};
use crate::session::{During, Stroke};
use crate::tool::{Canvas, Tool, ToolError};

/// Where a tool is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// Its middle, in the world of the object.
    pub at: DVec3,
    /// How it is turned, of solids: the axis of the turn, as long as its angle in degrees.
    pub turn: DVec3,
}

impl Pose {
    /// A tool at a place that is not turned.
    pub fn at(at: DVec3) -> Self {
        Self {
            at,
            turn: DVec3::ZERO,
        }
    }
}

/// A stroke that is not at its end. Dropped, it leaves nothing.
pub struct LiveStroke {
    /// With the poses so far.
    stroke: Stroke,
    before: Canvas,
    work: Work,
    first: Option<Pose>,
    /// Of solids, how they are turned all the way, if that was said.
    turn: Option<DVec3>,
    seen: HierarchicalSpline<f32>,
}

impl LiveStroke {
    /// Begins a stroke. Places of its way are not given: they will be the poses. A `pull` says in `along` what it takes hold
    /// of, and neither `by` nor `way` nor `lift`.
    ///
    /// # Errors
    /// Any [`ToolError`].
    pub fn begin(mut stroke: Stroke, canvas: Canvas) -> Result<Self, ToolError> {
        let told = stroke.poses()?;
        if !stroke.during.is_empty() {
            let why = "a stroke in a hand gets its paint as it goes; none is given before it begins";
            return Err(ToolError::Stroke(why.into()));
        }
        if !told.is_empty() {
            return Err(ToolError::Stroke(format!(
                "a stroke in a hand gets its places one by one; {} of them are given before it begins",
                told.len()
            )));
        }
        stroke.paced = stroke.motion.is_none();
        let solid = stroke.carve.as_ref().or(stroke.add.as_ref());
        let turn = match solid.map_or(&[][..], |tool| &tool.turn) {
            [] => None,
            [one] => Some(one.0),
            _ => {
                let why = "a stroke in a hand has one turn, or is turned by its poses; write at most one";
                return Err(ToolError::Stroke(why.into()));
            }
        };
        let (coarse, limits) = stroke.prepared(&canvas)?;
        Ok(Self {
            work: Work::new(stroke.tool().map_err(ToolError::Stroke)?, coarse, limits)?,
            stroke,
            seen: canvas.field.clone(),
            before: canvas,
            first: None,
            turn,
        })
    }

    /// One step with the tool at a pose; gives the force of the tool on the solid, in the units of density that the springs
    /// have: 0 but of force tools.
    ///
    /// Where there is nothing to work on nothing is done; [`end`](Self::end) tells of it.
    ///
    /// # Errors
    /// [`ToolError`]. After one for a pose that makes no sense the stroke goes on as if it had not been told; after any
    /// other it cannot go on.
    pub fn step(&mut self, pose: Pose, control: &mut Control) -> Result<DVec3, ToolError> {
        if !(pose.at.is_finite() && pose.turn.is_finite()) {
            return Err(ToolError::Stroke(format!(
                "the hand cannot be at {}, turned by {}; give finite numbers",
                pose.at, pose.turn
            )));
        }
        let first = *self.first.get_or_insert(pose);
        let pose = match (&self.stroke.pull, self.turn) {
            // Its way begins at the surface.
            (Some(_), _) => Pose::at(pose.at - first.at),
            (None, Some(turn)) => Pose { turn, ..pose },
            (None, None) => pose,
        };
        let force = match &self.stroke.motion {
            Some(_) => {
                self.stroke.grab([first.at, pose.at]);
                self.work.carry(&self.stroke, first.at == pose.at, control)?;
                DVec3::ZERO
            }
            None => {
                let tool = self.stroke.tool().map_err(ToolError::Stroke)?;
                self.work.step(tool, pose, control)?
            }
        };
        self.stroke.push(pose, self.turn.is_none());
        Ok(force)
    }

    /// Lays paint on, here and now, while a force tool works.
    ///
    /// # Errors
    /// [`ToolError`]; the stroke goes on as if it had not been told.
    pub fn paint(&mut self, paint: &Paint, control: &mut Control) -> Result<(), ToolError> {
        let tool = self.stroke.tool().map_err(ToolError::Stroke)?;
        check_during(tool, std::slice::from_ref(&self.during(paint)))?;
        self.work.lay_on(paint, control)?;
        let during = self.during(paint);
        self.stroke.during.push(during);
        Ok(())
    }

    fn during(&self, paint: &Paint) -> During {
        During {
            step: self.work.steps,
            paint: paint.clone(),
        }
    }

    /// The canvas as it is now, and the boxes outside of which its field is as at the last look. Of strokes with a symmetry
    /// the side of the hand alone.
    ///
    /// # Errors
    /// [`ToolError`].
    pub fn look(&mut self) -> Result<(Canvas, Vec<Aabb>), ToolError> {
        let now = self.stroke.completed(&self.before, self.work.now()?)?;
        let whole = now.field.lattice().world_box();
        let boxes = now.field.changed_boxes(&self.seen, &whole);
        self.seen = now.field.clone();
        Ok((now, boxes))
    }

    /// The stroke as a script says it, with the poses so far.
    pub fn script(&self) -> &Stroke {
        &self.stroke
    }

    /// Lets the tool go and does what it has still to do: what is left of the canvas, the stroke as a script says it, and
    /// what is left to say, in sentences.
    ///
    /// # Errors
    /// [`ToolError`], also where there was nothing to work on in any step.
    pub fn end(self, control: &mut Control) -> Result<(Canvas, Stroke, Vec<String>), ToolError> {
        let Self {
            stroke, before, work, ..
        } = self;
        let (coarse, limits) = (work.before.clone(), work.limits.clone());
        let done = work.finish(&[], control)?;
        let tool = stroke.tool().map_err(ToolError::Stroke)?;
        let (left, notes) = stroke.on_both_sides(tool, coarse, &limits, Some(done), control)?;
        let left = stroke.completed(&before, left)?;
        Ok((left, stroke, notes))
    }
}

/// A tool at work on a canvas, step by step.
pub(crate) struct Work {
    before: Canvas,
    limits: Limits,
    /// As solids and brushes have left it.
    canvas: Canvas,
    /// Of force tools, once they have found a surface.
    force: Option<ForceStroke<f32>>,
    last: Option<Pose>,
    steps: usize,
    /// Steps in which there was nothing to work on, and why in the first of them.
    missed: Option<(usize, ToolError)>,
}

impl Work {
    pub fn new(tool: Tool, canvas: Canvas, limits: Limits) -> Result<Self, ToolError> {
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

    /// One step; gives the force on the solid.
    pub fn step(&mut self, tool: Tool, pose: Pose, control: &mut Control) -> Result<DVec3, ToolError> {
        self.steps += 1;
        let from = self.last.replace(pose);
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
            force.pose(pose.at)?;
            force.step()?;
            return Ok(force.force());
        }
        let is_solid = matches!(tool, Tool::Carve(_) | Tool::Add(_));
        if is_solid && from == Some(pose) {
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

    /// The motion of a stroke from the canvas as it was.
    fn carry(&mut self, stroke: &Stroke, stays: bool, control: &mut Control) -> Result<(), ToolError> {
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

    /// The canvas as it is now.
    fn now(&self) -> Result<Canvas, ToolError> {
        Ok(match &self.force {
            Some(force) => Canvas {
                field: self.limits.kept(&self.before.field, &force.field()?),
                ..self.canvas.clone()
            },
            None => self.canvas.clone(),
        })
    }

    /// Lays paint on the canvas, and under the tool.
    fn lay_on(&mut self, paint: &Paint, control: &mut Control) -> Result<(), ToolError> {
        (self.canvas, _) = Tool::Paint(paint).apply(self.canvas.clone(), &self.limits, control)?;
        if let Some(force) = &mut self.force {
            force.repaint(&self.canvas.layers)?;
        }
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
            self.canvas.field = self.limits.kept(&self.before.field, &field);
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
        let is_beside = matches!(
            why,
            ToolError::Geometric(GeometricError::Outside { .. } | GeometricError::Leaves { .. })
                | ToolError::Force(ForceError::Nowhere { .. } | ForceError::Outside { .. })
                | ToolError::Paint(PaintError::Outside(..))
        );
        match (&mut self.missed, is_beside) {
            (_, false) => return Err(why),
            (Some((count, _)), true) => *count += 1,
            (none, true) => *none = Some((1, why)),
        }
        Ok(())
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
            tool.along = along;
            apply(&Tool::Smooth(&tool))
        }
        Tool::Inflate(tool) => {
            let mut tool = tool.clone();
            tool.along = along;
            apply(&Tool::Inflate(&tool))
        }
        Tool::Paint(tool) => {
            let mut tool = tool.clone();
            if let Some(brush) = &mut tool.brush {
                brush.along = along;
            }
            apply(&Tool::Paint(&tool))
        }
        other => Err(not_by_hand(&other)),
    }
}

fn not_by_hand(tool: &Tool) -> ToolError {
    ToolError::Stroke(format!(
        "{} goes nowhere by hand; use it in a stroke of its own, without paced",
        tool.name()
    ))
}

impl Stroke {
    /// Number of steps of a stroke that was made by hand.
    pub fn step_count(&self) -> Option<usize> {
        self.paced.then(|| self.poses().map_or(0, |poses| poses.len()))
    }

    /// Poses of the tool, one a step.
    pub(crate) fn poses(&self) -> Result<Vec<Pose>, ToolError> {
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
                        at: at.0,
                        turn: turn(n),
                    })
                    .collect()
            }
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

    /// One pose more; a hand that grabs has the first and the last alone.
    fn push(&mut self, pose: Pose, turns: bool) {
        let at = Point(pose.at);
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
        if let Some(brush) = self.paint.as_mut().and_then(|tool| tool.brush.as_mut()) {
            brush.along.push(at);
        }
    }

    /// A hand that grabs goes from place to place.
    fn grab(&mut self, places: [DVec3; 2]) {
        if let Some(tool) = &mut self.motion
            && let Motion::Grab { along, .. } = &mut tool.motion
        {
            *along = places.map(Point).to_vec();
        }
    }

    /// What the steps of a stroke leave that is led by a hand, or painted on meanwhile.
    pub(crate) fn worked(
        &self,
        tool: Tool,
        canvas: Canvas,
        limits: &Limits,
        control: &mut Control,
    ) -> Result<(Canvas, Vec<String>), ToolError> {
        check_during(tool, &self.during)?;
        let mut during = &self.during[..];
        let mut work;
        if let (Tool::Force(tool), false) = (tool, self.paced) {
            work = Work::of_force(tool.begin(&canvas.field, canvas.iso)?, canvas, limits)?;
        } else {
            let poses = self.poses()?;
            if matches!(tool, Tool::Move(_)) {
                let why = "a move by hand is a move; leave paced out";
                return Err(ToolError::Stroke(why.into()));
            }
            if poses.is_empty() {
                let why = "a stroke by hand has no pose; write at least one, or leave paced out";
                return Err(ToolError::Stroke(why.into()));
            }
            work = Work::new(tool, canvas, limits.clone())?;
            let count = poses.len() as f64;
            for (n, pose) in poses.into_iter().enumerate() {
                control
                    .step("sculpting", n as f64 / count)
                    .map_err(ForceError::Cancelled)?;
                during = work.lay_due(during, control)?;
                work.step(tool, pose, control)?;
            }
        }
        work.finish(during, control)
    }
}

/// Refuses paint beside tools that take no time, and paint out of order.
fn check_during(tool: Tool, during: &[During]) -> Result<(), ToolError> {
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
