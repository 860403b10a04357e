//! What panels show and change.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use egui::Modifiers;
use fitting::Cancel;
use glam::DVec3;

use super::measure::{Mark, Measure};
use super::orders::{Order, Sheet};
use super::show::Shown;
use super::tool::{Kind, Tool};
use super::touch::{Held, Seen};
use crate::panels;
use crate::view::{Camera, Histogram, Look, Mode, leave};

/// Time for which a message stays.
const READ: Duration = Duration::from_secs(8);

/// What panels show and change.
pub struct Bench {
    /// The document, if there is one.
    pub sheet: Option<Arc<Sheet>>,
    /// The tool as it is set; its radius in shares of the scene's.
    pub tool: Tool,
    /// How the scene is looked at.
    pub look: Look,
    /// Middle and radius of the scene.
    pub scene: (DVec3, f64),
    /// What takes a while, and the share done.
    pub busy: Option<(String, f64)>,
    /// What was told, the newest last, and whether it is that something failed.
    pub messages: VecDeque<(Instant, String, bool)>,
    /// Triangles that are shown.
    pub triangles: usize,
    /// Planes through the chosen object, if they are shown.
    pub slices: Option<panels::Slices>,
    /// The path that is being asked for.
    pub asks: Option<panels::PathBox>,
    /// Documents without a name that were left, the newest first.
    pub kept: Vec<PathBuf>,
    /// Where sample scans are written.
    pub scratch: Option<tempfile::TempDir>,
    /// How often which density is in the chosen object.
    pub densities: Option<panels::Densities>,
    /// Whether the card draws without triangles.
    pub can_cast: bool,
    /// Of which object the densities are that show black and white.
    pub density_of: Option<String>,
    /// Whether all that was told is shown.
    pub shows_log: bool,
    /// What is measured, if clicks do that.
    pub measure: Option<Measure>,
    /// Whether clicks pin the surface.
    pub pins: bool,
    /// How a device is to be held, if that panel is shown.
    pub touch: Option<panels::TouchWish>,
    /// What is in the hand.
    pub held: Option<Held>,
    /// What it does and feels.
    pub seen: Option<Seen>,
    /// What is known of what is shown beside the solids.
    pub shown: Shown,
    /// Pictures of the scene as files.
    pub shot: panels::Shots,
    /// The tool that it was told of.
    pub(super) told_tool: Option<Tool>,
    pub(super) orders: Sender<Order>,
    pub(super) cancel: Arc<Mutex<Cancel>>,
}

impl Bench {
    /// Gives the desk an order.
    pub fn order(&self, order: Order) {
        self.shown.remember(&order);
        // A desk that has fallen is told of when the window closes.
        let _ = self.orders.send(order);
    }

    /// Ends what takes a while.
    pub fn cancel(&self) {
        self.cancel
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .cancel();
    }

    /// Tells the user something.
    pub fn tell(&mut self, text: String, is_failure: bool) {
        self.messages.push_back((Instant::now(), text, is_failure));
        if self.messages.len() > 100 {
            self.messages.pop_front();
        }
    }

    /// What was told so lately that it is still to be read.
    pub fn message(&self) -> Option<(&str, bool)> {
        let (when, text, is_failure) = self.messages.back()?;
        (when.elapsed() < READ).then_some((text, *is_failure))
    }

    /// The tool with its radius in lengths, doing what the keys held make of it.
    pub fn tool_in_hand(&self, keys: Modifiers) -> Tool {
        let kind = if keys.shift { Kind::Smooth } else { self.tool.kind };
        Tool {
            kind,
            radius: self.tool.radius * self.scene.1,
            inverted: keys.command || keys.ctrl,
            ..self.tool
        }
    }

    /// Pins the surface of the chosen object at a place of the world.
    pub(super) fn pin(&self, p: DVec3) {
        let sheet = self.sheet.as_ref();
        let Some(thing) = sheet.and_then(|sheet| sheet.objects.get(sheet.chosen)) else {
            return;
        };
        let own = thing.world_from_object.inverse().transform_point3(p);
        let hold = serde_json::json!({ "name": panels::next_pin(thing), "points": [own.to_array()] });
        let stroke = serde_json::from_value(serde_json::json!({ "hold": hold }));
        self.order(Order::Do(Box::new(stroke.expect("a finite place can be held"))));
    }

    /// Marks a place of the chosen object's surface to be measured from.
    pub(super) fn mark(&mut self, p: DVec3, normal: DVec3) {
        let thing = self
            .sheet
            .as_ref()
            .and_then(|sheet| sheet.objects.get(sheet.chosen));
        let wall = thing.and_then(|thing| {
            let own = thing.world_from_object.inverse();
            let inward = own.transform_vector3(-normal).try_normalize()?;
            let from = own.transform_point3(p);
            let beyond = leave(&*thing.field, thing.iso, &thing.own_box, from, inward)?;
            Some(thing.world_from_object.transform_point3(beyond).distance(p))
        });
        if let Some(measure) = &mut self.measure {
            measure.marks.push(Mark { at: p, wall });
        }
    }

    /// Tells what holds the tool when another one is chosen, or it is set otherwise.
    pub(super) fn tell_tool(&mut self) {
        let tool = self.tool_in_hand(Modifiers::NONE);
        if self.held.is_some() && self.told_tool != Some(tool) {
            self.order(Order::Tool(tool));
        }
        self.told_tool = self.held.is_some().then_some(tool);
    }

    /// Shows the densities of the chosen object from its surface to the highest, once they are shown at all.
    pub(super) fn know_density(&mut self) {
        let Some(thing) = self
            .sheet
            .as_ref()
            .and_then(|sheet| sheet.objects.get(sheet.chosen))
        else {
            return;
        };
        let has_density = self.look.mode != Mode::Mesh || self.look.cut.is_some();
        if !has_density || self.density_of.as_ref() == Some(&thing.name) {
            return;
        }
        let histogram = Histogram::new(&*thing.field, &thing.own_box);
        self.look.density = histogram.shown(thing.iso);
        self.density_of = Some(thing.name.clone());
    }

    /// Looks at the whole scene.
    pub fn frame_all(&mut self) {
        let (center, radius) = self.scene;
        self.look.camera = Camera {
            perspective: self.look.camera.perspective,
            turn: self.look.camera.turn,
            ..Camera::onto(center, radius, self.look.camera.up)
        };
    }
}
