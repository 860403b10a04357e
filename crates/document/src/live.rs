//! Strokes that a hand makes on a document.

use bspline::Aabb;
use fitting::Control;
use glam::DVec3;
use tools::live::{Grip, LiveStroke, Pose};
use tools::paint::Paint;
use tools::session::Stroke;

use crate::canvas::{canvas, left};
use crate::{Change, Command, CommandError, Document, State};

/// A stroke in a hand: begun, told a pose a step, ended. Until then the document is as it was, on the disk and in memory;
/// dropped, the stroke leaves nothing.
///
/// The edit that it becomes has the poses of its steps for a command, so it is done again, to the bit, as any other.
pub struct Live {
    object: String,
    before: State,
    stroke: LiveStroke,
    /// What was done to the object before, if anything.
    told: Option<String>,
}

impl Live {
    /// Begins a stroke on an object, see [`LiveStroke::begin`]; a field on knots of its own is written in levels for it. What the stroke says of an object does not count.
    ///
    /// # Errors
    /// Any [`CommandError`].
    pub fn begin(state: &State, object: &str, stroke: Stroke) -> Result<Self, CommandError> {
        let stroke = Stroke {
            object: None,
            ..stroke
        };
        let (canvas, told) = canvas(state, object)?.in_levels(&mut Control::default())?;
        Ok(Self {
            object: object.into(),
            before: state.clone(),
            stroke: LiveStroke::begin(stroke, canvas)?,
            told,
        })
    }

    /// One step with the tool at a pose of the object's own world; gives the force on the solid, see [`LiveStroke::step`].
    ///
    /// # Errors
    /// [`CommandError::Tool`].
    pub fn step(&mut self, pose: Pose, control: &mut Control) -> Result<DVec3, CommandError> {
        Ok(self.stroke.step(pose, control)?)
    }

    /// What a hand that pulls has hold of, see [`LiveStroke::grip`].
    pub fn grip(&self) -> Option<Grip> {
        self.stroke.grip()
    }

    /// Of a force tool the box that moves, see [`LiveStroke::moving`].
    pub fn moving(&self) -> Option<[DVec3; 8]> {
        self.stroke.moving()
    }

    /// Lays paint on while a force tool works, see [`LiveStroke::paint`].
    ///
    /// # Errors
    /// [`CommandError::Tool`].
    pub fn paint(&mut self, paint: &Paint, control: &mut Control) -> Result<(), CommandError> {
        Ok(self.stroke.paint(paint, control)?)
    }

    /// What is to be seen now, and the boxes of the object's own world outside of which its field is as at the last look.
    ///
    /// # Errors
    /// [`CommandError`].
    pub fn look(&mut self) -> Result<(State, Vec<Aabb>), CommandError> {
        let (canvas, boxes) = self.stroke.look()?;
        Ok((left(&self.before, &self.object, canvas.into())?, boxes))
    }

    /// Lets the tool go, does what it has still to do, and makes it an edit of the document: whether anything changed, and
    /// what is left to say, in sentences.
    ///
    /// # Errors
    /// [`CommandError::Changed`] if the document is not as it was when the stroke began; any other. The document is as it
    /// was then.
    pub fn end(
        self,
        document: &mut Document,
        control: &mut Control,
    ) -> Result<(bool, Vec<String>), CommandError> {
        if !Change::between(&self.before, document.state()).is_empty() {
            return Err(CommandError::Changed(self.object));
        }
        let (canvas, stroke, notes) = self.stroke.end(control)?;
        let next = left(&self.before, &self.object, canvas.into())?;
        let command = Command::Stroke {
            object: self.object,
            stroke: Box::new(stroke),
        };
        let is_changed = document.commit(&command.title(), command.to_value(), next)?;
        Ok((is_changed, self.told.into_iter().chain(notes).collect()))
    }
}
