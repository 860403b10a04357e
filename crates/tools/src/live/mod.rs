//! Strokes in a hand: a pose for each step, as they come.
//!
//! A [`LiveStroke`] is begun with a tool that has no way yet, told a [`Pose`] a step, and ended: then there is a canvas, and the
//! stroke as a script says it, with the pose of every step. The script ([`Stroke::paced`]) leaves the same canvas, to the bit:
//! it is done by the same steps.
//!
//! Force tools move the solid step by step; their region follows them. Solids and brushes act on the way from pose to
//! pose. A hand that grabs carries along what it took hold of to where it is, by one motion of the field as it was.
//!
//! Where the solid needs more room than the box of its field has, the box grows, and all steps so far are done anew in it.

mod script;
mod work;

use bspline::{Aabb, Field, HierarchicalSpline};
use fitting::Control;
use glam::DVec3;

use crate::canvas::Canvas;
use crate::paint::Paint;
use crate::room::MOST_GROWTHS;
use crate::session::{During, Stroke};
use crate::tool::ToolError;

use work::{Work, check_during};

/// Where a tool is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Its middle, in the world of the object.
    pub at: DVec3,
    /// How it is turned, of solids: the axis of the turn, as long as its angle in degrees.
    pub turn: DVec3,
    /// How hard it is pushed, of `push`.
    pub force: f64,
    /// Part of what it does that is done, 0 to 1, of brushes: see [`Stroke::press`].
    pub press: f64,
}

impl Pose {
    /// A tool at a place that is not turned, under a force of 1, and does all that it does.
    pub fn at(at: DVec3) -> Self {
        Self {
            at,
            turn: DVec3::ZERO,
            force: 1.0,
            press: 1.0,
        }
    }

    /// Refuses numbers that are not finite, and presses that are no part.
    pub(crate) fn check(&self) -> Result<(), ToolError> {
        if !(0.0..=1.0).contains(&self.press) {
            let why = format!("the hand cannot press by {}; give 0 to 1", self.press);
            return Err(ToolError::Stroke(why));
        }
        match self.at.is_finite() && self.turn.is_finite() && self.force.is_finite() {
            true => Ok(()),
            false => Err(ToolError::Stroke(format!(
                "the hand cannot be at {}, turned by {}, and push by {}; give finite numbers",
                self.at, self.turn, self.force
            ))),
        }
    }
}

/// What a hand that pulls has hold of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grip {
    /// Where it took hold, and where it was in the last step.
    pub way: [DVec3; 2],
    /// Magnitude of the force on the solid, as [`LiveStroke::step`] gives it.
    pub force: f64,
    /// See [`ForceStroke::rigidity`](crate::force::ForceStroke::rigidity).
    pub rigidity: [f64; 2],
    /// Radius of the tool.
    pub radius: f64,
}

/// A stroke that is not at its end. Dropped, it leaves nothing.
pub struct LiveStroke {
    /// With the poses so far.
    stroke: Stroke,
    /// As it was given, and in the box that it has by now.
    given: Canvas,
    before: Canvas,
    growths: usize,
    work: Work,
    first: Option<Pose>,
    /// Of solids, how they are turned all the way, if that was said.
    turn: Option<DVec3>,
    /// Of `push`, how hard it is pushed all the way, if that was said.
    force: Option<f64>,
    seen: HierarchicalSpline<f32>,
}

impl LiveStroke {
    /// Begins a stroke. Places of its way are not given: they will be the poses. A `pull` says in `along` what it takes hold
    /// of, and neither `by` nor `way` nor `lift`.
    ///
    /// # Errors
    /// Any [`ToolError`].
    pub fn begin(stroke: Stroke, canvas: Canvas) -> Result<Self, ToolError> {
        let mut stroke = stroke.of(canvas.material);
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
        let force = match stroke.push.as_ref().map_or(&[][..], |tool| &tool.force.0) {
            [] => None,
            [one] => Some(one.0),
            _ => {
                let why = "a stroke in a hand has one force, or those of its poses; write at most one";
                return Err(ToolError::Stroke(why.into()));
            }
        };
        Ok(Self {
            work: Work::new(&stroke, &canvas)?,
            stroke,
            seen: canvas.field.clone(),
            given: canvas.clone(),
            before: canvas,
            growths: 0,
            first: None,
            turn,
            force,
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
        pose.check()?;
        let pose = Pose {
            force: self.force.unwrap_or(pose.force),
            press: if self.stroke.has_press() { pose.press } else { 1.0 },
            ..pose
        };
        let first = self.first.unwrap_or(pose);
        let here = pose;
        let pose = match (&self.stroke.pull, self.turn) {
            // Its way begins at the surface.
            (Some(_), _) => Pose::at(pose.at - first.at),
            (None, Some(turn)) => Pose { turn, ..pose },
            (None, None) => pose,
        };
        let (before, growths) = (self.before.clone(), self.growths);
        let force = loop {
            match self.stepped(first, pose, control) {
                Err(why) if self.grow(&why, control)? => {}
                Err(why) if self.growths > growths => {
                    // No box is large enough, so it stays as it was.
                    self.growths = growths;
                    self.begin_anew(before, control)?;
                    return Err(why);
                }
                done => break done?,
            }
        };
        self.first.get_or_insert(here);
        self.stroke
            .add_pose(pose, self.turn.is_none(), self.force.is_none());
        Ok(force)
    }

    /// One step in the box as it is.
    fn stepped(&mut self, first: Pose, pose: Pose, control: &mut Control) -> Result<DVec3, ToolError> {
        if self.stroke.motion.is_none() {
            let tool = self.stroke.tool().map_err(ToolError::Stroke)?;
            return self.work.step(tool, pose, control);
        }
        let mut stroke = self.stroke.clone();
        stroke.grab([first.at, pose.at]);
        self.work.carry(&stroke, first.at == pose.at, control)?;
        self.stroke = stroke;
        Ok(DVec3::ZERO)
    }

    /// Makes room for what a step was refused for, if that is how it can be done. Of force tools those that pull need room; the others work
    /// on what is there.
    fn grow(&mut self, why: &ToolError, control: &mut Control) -> Result<bool, ToolError> {
        let needs_none = matches!(why, ToolError::Force(_)) && self.stroke.pull.is_none();
        if needs_none || self.growths == MOST_GROWTHS {
            return Ok(false);
        }
        let face = self.before.face_for(why);
        let Some(grown) = face.and_then(|face| self.before.grown(face)) else {
            return Ok(false);
        };
        self.growths += 1;
        match self.begin_anew(grown, control) {
            Err(why) if !self.grow(&why, control)? => Err(why),
            _ => Ok(true),
        }
    }

    /// All steps so far from another canvas.
    fn begin_anew(&mut self, canvas: Canvas, control: &mut Control) -> Result<(), ToolError> {
        self.work = Work::new(&self.stroke, &canvas)?;
        self.before = canvas;
        match (&self.stroke.motion, &self.stroke.poses()?[..]) {
            (Some(_), [from, .., to]) => self.work.carry(&self.stroke, from == to, control),
            (Some(_), _) => Ok(()),
            (None, _) => self.work.redo(&self.stroke, control).map(|_| ()),
        }
    }

    /// What a hand that pulls has hold of after its last step; nothing of other tools.
    pub fn grip(&self) -> Option<Grip> {
        let tool = self.stroke.pull.as_ref()?;
        let first = self.first?.at;
        let (force, by) = self.work.pulled()?;
        Some(Grip {
            way: [first, first + by],
            force: force.force().length(),
            rigidity: force.rigidity(),
            radius: tool.radius.0,
        })
    }

    /// Of a force tool the box that moves: see [`ForceStroke::moving`](crate::force::ForceStroke::moving).
    pub fn moving(&self) -> Option<[DVec3; 8]> {
        self.work.moving()
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
        let boxes = match now.field.lattice() == self.seen.lattice() {
            true => now.field.changed_boxes(&self.seen, &whole),
            false => vec![whole],
        };
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
            stroke,
            given,
            before,
            work,
            growths,
            ..
        } = self;
        let made = work.ended(&stroke, &before, control);
        let (left, notes) = match made {
            Ok((left, mut notes)) => {
                notes.extend(left.growth_since(&given));
                (left, notes)
            }
            // The end of the stroke, or its other side, needs more room still.
            Err(why) if growths < MOST_GROWTHS && before.face_for(&why).is_some() => {
                stroke.apply(given, control)?
            }
            Err(why) => return Err(why),
        };
        Ok((left, stroke, notes))
    }
}
