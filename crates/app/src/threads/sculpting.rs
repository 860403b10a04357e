//! A document in a hand: strokes begin and end with a button, and each step of the simulation tells one pose.

use std::sync::{Arc, Mutex, PoisonError};

use document::{CommandError, Document, DocumentError, Live, State};
use fitting::Control;
use glam::{DQuat, DVec3};
use tools::curve::Along;
use tools::haptics::{Embedding, Pose, StrokeStep, newtons_per_unit};
use tools::live;
use tools::number::Point;
use tools::session::Stroke;

use super::hand::Hand;

/// A drag by one radius of the tool in unpainted matter is felt as so many newtons.
const DRAG: f64 = 1.0;

/// A document in a hand. What comes into its journal is what a script would leave there: who does the strokes, and how often
/// somebody looked, does not show.
pub struct Sculpting {
    document: Document,
    object: String,
    /// What the button begins; without one the hand only touches. Another may be put there between strokes.
    tool: Arc<Mutex<Option<Stroke>>>,
    live: Option<Live>,
    /// Radius of the ball that touches, if tools work where it does: without it they work where the hand is.
    touching: Option<f64>,
    /// Where a tool took hold that goes with the hand: the place of the surface, then the hand's.
    hold: Option<[DVec3; 2]>,
    /// Whether it carves or adds a solid.
    is_solid: bool,
    /// How a solid that carves or adds goes in, and the time of a step, s; without it is where the hand is.
    embedding: Option<(Embedding, f64)>,
    /// What the hand pulls at, and newtons for each unit of that stroke's force.
    pulled: Option<StrokeStep>,
    newtons: Option<f64>,
    steps: u64,
    presses: u32,
    shown: State,
    strokes: usize,
    /// Titles of the edits that nobody has taken yet.
    titles: Arc<Mutex<Vec<String>>>,
    notes: Vec<String>,
}

impl Sculpting {
    /// On an object of a document, with a tool that has no way yet.
    pub fn new(document: Document, object: String, tool: Option<Stroke>) -> Self {
        Self {
            shown: document.state().clone(),
            document,
            object,
            tool: Arc::new(Mutex::new(tool)),
            live: None,
            touching: None,
            hold: None,
            is_solid: false,
            embedding: None,
            pulled: None,
            newtons: None,
            steps: 0,
            presses: 0,
            strokes: 0,
            titles: Arc::default(),
            notes: Vec::new(),
        }
    }

    /// With solids that go into the matter by what a rate allows in each step of so many seconds, from where they touch it.
    pub fn embedding(mut self, embedding: Embedding, step: f64) -> Self {
        self.embedding = Some((embedding, step));
        self
    }

    /// With tools that work where a ball of some radius touches the surface, and not where the hand is in it. What takes hold does so there,
    /// and goes with the hand.
    #[cfg(feature = "window")]
    pub fn touching(mut self, radius: f64) -> Self {
        self.touching = Some(radius);
        self
    }

    /// What the button begins, to be exchanged between strokes.
    #[cfg(feature = "window")]
    pub fn tool(&self) -> Arc<Mutex<Option<Stroke>>> {
        self.tool.clone()
    }

    /// Titles of the edits as they are made, for whoever takes them.
    #[cfg(feature = "window")]
    pub fn titles(&self) -> Arc<Mutex<Vec<String>>> {
        self.titles.clone()
    }

    /// What the hand pulled at in the last step, if it pulls.
    pub fn pulled(&self) -> Option<StrokeStep> {
        self.pulled
    }

    /// A step with the hand where it is; whether what is to be seen changed.
    ///
    /// A stroke that cannot begin or go on is left out, and its reason noted.
    ///
    /// # Errors
    /// That an edit cannot be written.
    pub fn step(&mut self, hand: &Hand, control: &mut Control) -> Result<bool, DocumentError> {
        let Some(pose) = hand.pose else {
            return Ok(false);
        };
        let is_pressed_anew = hand.presses != self.presses;
        self.presses = hand.presses;
        let mut is_changed = false;
        if is_pressed_anew {
            // It came up and went down again since the last step.
            is_changed = self.end(control)?;
            if let Err(why) = self.begin(&pose, hand) {
                self.note(&why);
            }
        }
        if self.live.is_none() {
            return Ok(is_changed);
        }
        if hand.is_pressing() || is_pressed_anew {
            let pose = self.worked(pose, hand);
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
        (self.pulled, self.newtons) = (None, None);
        let Some(live) = self.live.take() else {
            return Ok(false);
        };
        match live.end(&mut self.document, control) {
            Ok((is_changed, notes)) => {
                self.strokes += usize::from(is_changed);
                if is_changed && let Some(edit) = self.document.history()?.pop() {
                    self.titles
                        .lock()
                        .unwrap_or_else(PoisonError::into_inner)
                        .push(edit.title);
                }
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
                self.pulled = self.grip();
                !boxes.is_empty()
            }
            Err(why) => {
                (self.live, self.pulled, self.newtons) = (None, None, None);
                self.shown = self.document.state().clone();
                self.note(&why);
                true
            }
        }
    }

    /// Begins what the button does now, if it does anything.
    fn begin(&mut self, pose: &Pose, hand: &Hand) -> Result<(), CommandError> {
        let tool = self.tool.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let Some(mut tool) = tool else { return Ok(()) };
        let place = self.touched(pose.at, hand);
        self.is_solid = tool.carve.is_some() || tool.add.is_some();
        self.hold = (tool.pull.is_some() || tool.motion.is_some()).then_some([place, pose.at]);
        if let Some(pull) = &mut tool.pull
            && pull.along.is_empty()
            && pull.area.is_none()
        {
            let own = self.own_pose(&Pose { at: place, ..*pose })?;
            pull.along = Along::Points(vec![Point(own.at)]);
        }
        self.live = Some(Live::begin(self.document.state(), &self.object, tool)?);
        Ok(())
    }

    /// Where the ball touches the surface; where the hand is, if tools work there or nothing is touched.
    fn touched(&self, at: DVec3, hand: &Hand) -> DVec3 {
        let inward = (at - hand.proxy.at).try_normalize();
        match self.touching.zip(inward) {
            Some((radius, inward)) => hand.proxy.at + radius * inward,
            None => at,
        }
    }

    /// Where a tool in a hand works.
    fn worked(&self, pose: Pose, hand: &Hand) -> Pose {
        let at = match (&self.embedding, self.hold) {
            (Some((embedding, step)), _) if self.is_solid => embedding.beyond(hand.proxy.at, pose.at, *step),
            (_, Some([place, from])) if self.touching.is_some() => place + (pose.at - from),
            _ => self.touched(pose.at, hand),
        };
        Pose { at, ..pose }
    }

    /// What a hand that pulls has hold of, in newtons and millimetres of the scene.
    fn grip(&mut self) -> Option<StrokeStep> {
        let grip = self.live.as_ref()?.grip()?;
        let scene_from_object = self.document.state().placement(&self.object).ok()?;
        let [reference, cursor] = grip.way.map(|p| scene_from_object.transform_point3(p));
        // Lengths of the scene for one of the object's.
        let scale = libm::cbrt(scene_from_object.matrix3.determinant().abs());
        let [own, unpainted] = grip.rigidity;
        let newtons = *self
            .newtons
            .get_or_insert_with(|| newtons_per_unit(DRAG, unpainted, grip.radius));
        self.steps += 1;
        Some(StrokeStep {
            number: self.steps,
            reference,
            cursor,
            force: newtons * grip.force,
            rigidity: newtons * own / scale,
        })
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
