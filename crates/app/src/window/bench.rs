//! What panels show and change.

use std::collections::{BTreeSet, VecDeque};
use std::path::PathBuf;
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use bspline::Aabb;
use document::Command;
use egui::Modifiers;
use fitting::Cancel;
use glam::DVec3;

use super::adjust::What;
use super::arrange::Change;
use super::docks::Rearrange;
use super::kept::Sides;
use super::keys::Keys;
use super::layout::Panel;
use super::limits::Limits;
use super::measure::{Mark, Measure};
use super::orders::{Order, Sheet, Thing};
use super::show::Shown;
use super::tool::{Kind, Tool, surface_within};
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
    /// The mesh that was written last, while that is told.
    pub written: Option<panels::Written>,
    /// The volume of which a part is to be opened.
    pub part: Option<panels::Part>,
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
    /// Whether keys and mouse arrange objects, not sculpt them.
    pub arranging: bool,
    /// How the chosen object is to be arranged, as soon as the mouse is over the scene.
    pub(super) arranges: Option<Change>,
    /// What is to be set by the mouse, as soon as it is over the scene.
    pub(super) adjusts: Option<What>,
    /// Where strokes act.
    pub limits: Limits,
    /// Objects that are not to be seen.
    pub hidden: BTreeSet<String>,
    /// The object that gets another name, and that as far as it is written.
    pub renames: Option<(String, String)>,
    /// Which keys do what.
    pub keys: Keys,
    /// The command palette, if it is shown.
    pub commands: Option<panels::Commands>,
    /// The table of shortcuts, if it is shown.
    pub shortcuts: Option<panels::Shortcuts>,
    /// The scene that is to be played.
    pub simulation: panels::Simulation,
    /// What the work costs.
    pub performance: panels::Performance,
    /// What is laid on all over.
    pub fill: panels::Fill,
    /// Which of the panels beside the scene are there.
    pub sides: Sides,
    /// What is to be done to their layout.
    pub(super) rearranges: Option<Rearrange>,
    /// Whether it does not matter how hard pens are pressed.
    pub ignores_pens: bool,
    /// Whether strokes without a pen are the stronger the slower they are.
    pub by_speed: bool,
    /// Whether there is a pen that tells it.
    pub has_pen: bool,
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
    /// The tool that the palette showed.
    pub(super) shown_tool: Option<Kind>,
    pub(super) told_limits: Limits,
    /// The object that they are of.
    pub(super) limits_of: Option<String>,
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

    /// Opens a file; of a large volume it is asked first how much.
    pub fn open(&mut self, path: PathBuf) {
        match panels::is_large(&path) {
            true => self.part = Some(panels::Part::of(path)),
            false => self.order(Order::Open(path)),
        }
    }

    /// Whether a panel is open.
    pub fn is_open(&self, panel: Panel) -> bool {
        let has_sides = self.sheet.is_some() && self.sides.are_shown;
        match panel {
            Panel::Scene => true,
            Panel::Tools => has_sides && self.sides.has_tools,
            Panel::Objects => has_sides && self.sides.has_objects,
            Panel::Simulation => self.sheet.is_some() && self.simulation.is_open,
            Panel::Performance => self.performance.is_open,
            Panel::Log => self.shows_log,
        }
    }

    /// Closes a panel.
    pub fn close_panel(&mut self, panel: Panel) {
        match panel {
            Panel::Scene => {}
            Panel::Tools => self.sides.has_tools = false,
            Panel::Objects => self.sides.has_objects = false,
            Panel::Simulation => self.simulation.is_open = false,
            Panel::Performance => self.performance.is_open = false,
            Panel::Log => self.shows_log = false,
        }
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
        let kind = match keys.shift {
            true if !self.tool.acts_at_once() => Kind::Smooth,
            _ => self.tool.kind,
        };
        Tool {
            kind,
            radius: self.tool.radius * self.scene.1,
            inverted: keys.command || keys.ctrl,
            ..self.tool
        }
    }

    /// Takes a tool of the palette.
    pub fn take(&mut self, kind: Kind) {
        self.tool.kind = kind;
        self.arranging = false;
        self.order(Order::Untry);
    }

    /// Whether another tool was taken since this was asked last.
    pub fn tool_changed(&mut self) -> bool {
        self.shown_tool.replace(self.tool.kind) != Some(self.tool.kind)
    }

    /// The chosen object.
    pub fn chosen(&self) -> Option<&Thing> {
        let sheet = self.sheet.as_ref()?;
        sheet.objects.get(sheet.chosen)
    }

    /// Asks for a stroke on the chosen object.
    ///
    /// # Panics
    /// If that is none that a script could have.
    pub fn stroke(&self, stroke: serde_json::Value) {
        let stroke = serde_json::from_value(stroke).expect("it is a stroke");
        self.order(Order::Do(Box::new(stroke)));
    }

    /// Asks for a copy of the chosen object, which is then moved.
    pub(super) fn duplicate(&mut self) {
        let Some(name) = self.chosen().map(|thing| thing.name.clone()) else {
            return;
        };
        let stem = name.trim_end_matches(|c: char| c.is_ascii_digit()).trim_end();
        let is_free = |name: &String| {
            let sheet = self.sheet.as_ref();
            sheet.is_none_or(|sheet| sheet.objects.iter().all(|thing| thing.name != *name))
        };
        let names = (2..).map(|n| format!("{stem} {n}"));
        let copy = names.into_iter().find(is_free).expect("numbers do not end");
        self.stroke(serde_json::json!({ "copy": { "to": copy } }));
        self.order(Order::Choose(copy));
        self.arranging = true;
        self.arranges = Some(Change::Shift);
    }

    /// Asks for the chosen object to go.
    pub(super) fn remove(&self) {
        if let Some(thing) = self.chosen() {
            let object = thing.name.clone();
            self.order(Order::Command(Box::new(Command::Remove { object })));
        }
    }

    pub(super) fn hide_chosen(&mut self) {
        let name = self.chosen().map(|thing| thing.name.clone());
        self.hidden.extend(name);
    }

    pub(super) fn hide_others(&mut self) {
        let Some(sheet) = &self.sheet else { return };
        let others = sheet
            .objects
            .iter()
            .enumerate()
            .filter(|(n, _)| *n != sheet.chosen);
        self.hidden = others.map(|(_, thing)| thing.name.clone()).collect();
    }

    /// Pins the surface of the chosen object at a place of the world.
    pub(super) fn pin(&self, p: DVec3) {
        let sheet = self.sheet.as_ref();
        let Some(thing) = sheet.and_then(|sheet| sheet.objects.get(sheet.chosen)) else {
            return;
        };
        let own = thing.world_from_object.inverse().transform_point3(p);
        let hold = serde_json::json!({ "name": panels::next_hold(thing, "pin"), "points": [own.to_array()] });
        let stroke = serde_json::from_value(serde_json::json!({ "hold": hold }));
        self.order(Order::Do(Box::new(stroke.expect("a finite place can be held"))));
    }

    /// Holds the surface of the chosen object within a box of its world; whether there is any.
    pub fn pin_box(&mut self, b: &Aabb) -> bool {
        let Some(thing) = self.chosen() else { return false };
        match surface_within(&*thing.field, thing.iso, b) {
            Ok(places) => {
                let points: Vec<[f64; 3]> = places.iter().map(DVec3::to_array).collect();
                let name = panels::next_hold(thing, "box");
                self.stroke(serde_json::json!({ "hold": { "name": name, "points": points } }));
                true
            }
            Err(why) => {
                self.tell(why, true);
                false
            }
        }
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

    /// Tells the desk where strokes act.
    pub(super) fn tell_changes(&mut self) {
        // Their places are those of the object that was chosen.
        let chosen = self.chosen().map(|thing| thing.name.clone());
        if self.limits_of != chosen {
            self.limits = Limits::default();
            self.limits_of = chosen;
        }
        if self.told_limits != self.limits {
            self.order(Order::Limit(self.limits.clone()));
            self.told_limits = self.limits.clone();
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

    /// Height of the clipping plane above the middle of the scene.
    pub fn plane_height(&self) -> Option<f64> {
        self.look.cut.map(|(at, normal)| (at - self.scene.0).dot(normal))
    }

    /// Moves the clipping plane to a height, within the scene.
    pub fn set_plane_height(&mut self, height: f64) {
        let (center, radius) = self.scene;
        if let Some((at, normal)) = &mut self.look.cut {
            *at = center + height.clamp(-radius, radius) * *normal;
        }
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
