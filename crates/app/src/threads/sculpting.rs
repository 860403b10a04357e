//! A document in a hand: strokes begin and end with a button, and each step of the simulation tells one pose.

use document::{CommandError, Document, DocumentError, Live, State};
use fitting::Control;
use glam::{DQuat, DVec3};
use tools::haptics::Pose;
use tools::live;
use tools::session::Stroke;

use super::hand::Hand;

/// A document in a hand. What comes into its journal is what a script would leave there: who does the strokes, and how often
/// somebody looked, does not show.
pub struct Sculpting {
    document: Document,
    object: String,
    /// What the button begins; without one the hand only touches.
    tool: Option<Stroke>,
    live: Option<Live>,
    presses: u32,
    shown: State,
    strokes: usize,
    notes: Vec<String>,
}

impl Sculpting {
    /// On an object of a document, with a tool that has no way yet.
    pub fn new(document: Document, object: String, tool: Option<Stroke>) -> Self {
        Self {
            shown: document.state().clone(),
            document,
            object,
            tool,
            live: None,
            presses: 0,
            strokes: 0,
            notes: Vec::new(),
        }
    }

    /// A step with the hand where it is; whether what is to be seen changed.
    ///
    /// A stroke that cannot begin or go on is left out, and its reason noted.
    ///
    /// # Errors
    /// That an edit cannot be written.
    pub fn step(&mut self, hand: &Hand, control: &mut Control) -> Result<bool, DocumentError> {
        let (Some(pose), Some(tool)) = (hand.pose, &self.tool) else {
            return Ok(false);
        };
        let is_pressed_anew = hand.presses != self.presses;
        self.presses = hand.presses;
        let mut is_changed = false;
        if is_pressed_anew {
            // It came up and went down again since the last step.
            let tool = tool.clone();
            is_changed = self.end(control)?;
            match Live::begin(self.document.state(), &self.object, tool) {
                Ok(live) => self.live = Some(live),
                Err(why) => self.note(&why),
            }
        }
        if self.live.is_none() {
            return Ok(is_changed);
        }
        if hand.is_pressing() || is_pressed_anew {
            is_changed = self.tell(&pose, control) || is_changed;
        }
        if !hand.is_pressing() {
            is_changed = self.end(control)? || is_changed;
        }
        Ok(is_changed)
    }

    /// Ends the stroke that there is, as if the button came up.
    ///
    /// # Errors
    /// That the edit cannot be written.
    pub fn end(&mut self, control: &mut Control) -> Result<bool, DocumentError> {
        let Some(live) = self.live.take() else {
            return Ok(false);
        };
        match live.end(&mut self.document, control) {
            Ok((is_changed, notes)) => {
                self.strokes += usize::from(is_changed);
                self.notes.extend(notes);
            }
            Err(CommandError::Document(why)) => return Err(why),
            Err(why) => self.note(&why),
        }
        self.shown = self.document.state().clone();
        Ok(true)
    }

    fn tell(&mut self, pose: &Pose, control: &mut Control) -> bool {
        let told = self.own_pose(pose);
        let Some(live) = &mut self.live else { return false };
        let told = told.and_then(|pose| live.step(pose, control).map(drop));
        match told.and_then(|()| live.look()) {
            Ok((state, boxes)) => {
                self.shown = state;
                !boxes.is_empty()
            }
            Err(why) => {
                self.live = None;
                self.shown = self.document.state().clone();
                self.note(&why);
                true
            }
        }
    }

    /// A pose of the scene in the object's own world.
    fn own_pose(&self, pose: &Pose) -> Result<live::Pose, CommandError> {
        let scene_from_object = self.document.state().placement(&self.object)?;
        let (_, placed, _) = scene_from_object.to_scale_rotation_translation();
        let turn: DQuat = placed.inverse() * pose.turn;
        Ok(live::Pose {
            turn: turn.normalize().to_scaled_axis() * DVec3::splat(180.0 / std::f64::consts::PI),
            ..live::Pose::at(scene_from_object.inverse().transform_point3(pose.at))
        })
    }

    fn note(&mut self, why: &CommandError) {
        let note = format!("a stroke was left out: {why}");
        if self.notes.last() != Some(&note) {
            self.notes.push(note);
        }
    }

    /// What is to be seen and touched now.
    pub fn shown(&self) -> &State {
        &self.shown
    }

    /// The document, the edits that were made of it, and what is left to say. A stroke that was not ended is dropped.
    pub fn close(self) -> (Document, usize, Vec<String>) {
        (self.document, self.strokes, self.notes)
    }
}
