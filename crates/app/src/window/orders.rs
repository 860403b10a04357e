//! What the window asks of the desk, and what the desk tells it.

use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::Arc;

use bspline::{Aabb, Field};
use document::{Command, Live, Object, State};
use formats::Unit;
use formats::field::SourceKind;
use glam::{DAffine3, DVec3};
use tools::force::Solid as Solidity;
use tools::hold::Held;
use tools::paint::Substance;
use tools::scene::StepLine;
use tools::session::Stroke;

use super::limits::Limits;
use super::tool::Tool;
use super::touch::{self, Seen, Wanted};
use crate::view::{Budget, Patch, Ray, Solid, pick};

/// What the window asks. Lines are those under the mouse, in the world.
#[derive(Clone, Debug)]
pub enum Order {
    /// A document, or a field or scan that becomes an object of a new one.
    Open(PathBuf),
    /// A new document with a block of clay.
    Clay,
    /// All that is open is shown again, within so many triangles, as all that follows.
    Show(Budget),
    /// The document goes on under another name.
    Save(PathBuf),
    /// Writes the chosen object: a mesh, a field, or its scan with its edits.
    Export {
        /// What is written.
        out: PathBuf,
        /// Over which scan.
        scan: Option<PathBuf>,
        /// Of a mesh: options of the command.
        of_mesh: Vec<OsString>,
    },
    /// Tools work on this object from now on.
    Choose(String),
    /// A stroke begins.
    Begin {
        /// With which tool.
        tool: Tool,
        /// Where.
        ray: Ray,
        /// How hard the pen is pressed, 0 to 1, if that counts.
        press: Option<f64>,
    },
    /// It goes on.
    Along {
        /// Where.
        ray: Ray,
        /// As above.
        press: Option<f64>,
    },
    /// It ends.
    End,
    /// It leaves nothing.
    Drop,
    /// What a click with this tool would leave there is shown.
    Try(Tool, Ray),
    /// It is no longer shown.
    Untry,
    /// Strokes of the palette act within these limits from now on.
    Limit(Limits),
    /// Writes the edits that are done as a script.
    SaveScript(PathBuf),
    /// Does a script on the chosen object.
    RunScript(PathBuf),
    /// Opens a scan by these options of `fit`.
    OpenPart(PathBuf, Vec<OsString>),
    /// Any command.
    Command(Box<Command>),
    /// Undoes the last edits.
    Undo(usize),
    /// Does edits again.
    Redo(usize),
    /// Asks for area and volume of an object.
    Weigh(String),
    /// One stroke that needs no hand.
    Do(Box<Stroke>),
    /// Takes a device in the hand, or another one.
    Take(Wanted),
    /// Does another thing with what is in the hand.
    Tool(Tool),
    /// Puts it down.
    LetGo,
}

/// What the desk tells.
#[derive(Clone, Debug)]
pub enum News {
    /// All that panels show.
    Sheet(Arc<Sheet>),
    /// Another scene: where its surfaces are, and what is up.
    Scene {
        /// Of the triangles that follow.
        origin: DVec3,
        /// Middle of all surfaces.
        center: DVec3,
        /// Of a ball round them.
        radius: f64,
        /// In the world.
        up: DVec3,
        /// Whether it is the scene that is shown, only finer: the eye stays where it is.
        is_finer: bool,
    },
    /// Triangles in place of those that there were.
    Patches(Vec<Patch>),
    /// The spline of an object, in place of the one that there was.
    Solid(String, Box<Solid>),
    /// An object is no more.
    Gone(String),
    /// Nothing is open any more.
    Empty,
    /// What takes a while, and the share done; none when it is done.
    Busy(Option<(String, f64)>),
    /// Area and volume of an object, of the world's lengths.
    Size(String, [f64; 2]),
    /// What is in the hand now.
    Held(Option<touch::Held>),
    /// What it does and feels.
    Seen(Seen),
    /// The force of the stroke in the hand; none when it has ended.
    Acting(Option<Acting>),
    /// Forces that a device was given, a second.
    Touched(f64),
    /// What a step of a stroke took, seconds.
    Step(f64),
    /// What a step of a scene that is played did.
    Moved(StepLine),
    /// An object is not to be seen for now.
    Hide(String),
    /// A file was written, of which a command told this.
    Written(PathBuf, serde_json::Map<String, serde_json::Value>),
    /// Something to tell.
    Note(String),
    /// Something that could not be done.
    Failed(String),
}

/// What a force tool does to the solid, in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Acting {
    /// Where the tool is.
    pub at: DVec3,
    /// The force, in the units of density that the springs have.
    pub force: DVec3,
    /// Corners of the box that moves, number `4x + 2y + z`.
    pub region: [DVec3; 8],
}

impl Acting {
    /// Of a stroke whose tool is at a place of its object's world, and pushes so there; none where no forces are at work.
    pub fn of(live: &Live, at: DVec3, force: DVec3, world_from_object: DAffine3) -> Option<Self> {
        let place = |p: DVec3| world_from_object.transform_point3(p);
        Some(Self {
            at: place(at),
            force: world_from_object.transform_vector3(force),
            region: live.moving()?.map(place),
        })
    }
}

impl News {
    /// The scene of surfaces in a box, if there are any.
    pub fn scene(origin: DVec3, surfaces: Option<Aabb>, is_volume: bool, is_finer: bool) -> Self {
        Self::Scene {
            origin,
            center: surfaces.map_or(origin, |b| b.center()),
            radius: surfaces.map_or(1.0, |b| 0.5 * b.size().length()),
            up: if is_volume { DVec3::Z } else { DVec3::Y },
            is_finer,
        }
    }
}

/// All that panels show of a document.
#[derive(Clone)]
pub struct Sheet {
    /// Its file.
    pub path: PathBuf,
    /// Whether that is where documents without a name are kept.
    pub is_untitled: bool,
    /// Its objects.
    pub objects: Vec<Thing>,
    /// The one that tools work on.
    pub chosen: usize,
    /// Titles of its edits, those undone too.
    pub history: Vec<String>,
    /// How many of them are done.
    pub done: usize,
}

/// An object on the sheet.
#[derive(Clone)]
pub struct Thing {
    /// Its name.
    pub name: String,
    /// Its field, of its own world.
    pub field: Arc<dyn Field>,
    /// Where its surface is.
    pub iso: f64,
    /// Its field's box.
    pub own_box: Aabb,
    /// Where it stands.
    pub world_from_object: DAffine3,
    /// Where its parent stands, or the world itself.
    pub world_from_parent: DAffine3,
    /// The object that it moves with.
    pub parent: Option<String>,
    /// Whether it springs back when force tools let go.
    pub is_elastic: bool,
    /// What is painted on it.
    pub layers: Vec<Substance>,
    /// Whether it was fitted to a volume: then its world is a patient's.
    pub is_volume: bool,
    /// Of its lengths, as people write it.
    pub unit: &'static str,
    /// Coefficients of its field.
    pub coefficients: usize,
    /// Its constraints, in its own world.
    pub holds: Vec<Held>,
    /// All of it.
    pub object: Object,
}

impl Thing {
    /// An object of a state; none where it has no surface or no place.
    pub fn of(state: &State, name: &str) -> Option<Self> {
        let object = state.object(name).ok()?;
        let parent = object.properties.parent.clone();
        let world_from_parent = match &parent {
            Some(parent) => state.placement(parent).ok()?,
            None => DAffine3::IDENTITY,
        };
        let painted = object.layers.iter().filter(|(_, layer)| !layer.is_empty());
        Some(Self {
            world_from_parent,
            parent,
            is_elastic: object.properties.material.solid == Solidity::Elastic,
            layers: painted.map(|(substance, _)| *substance).collect(),
            name: name.into(),
            field: object.field.shared(),
            iso: object.iso()?,
            own_box: object.field.world_box(),
            world_from_object: state.placement(name).ok()?,
            is_volume: object.meta.source == SourceKind::Volume,
            unit: match object.meta.unit {
                Unit::Unknown => "",
                unit => unit.symbol(),
            },
            coefficients: object.field.coefficient_count(),
            holds: object.properties.holds.clone(),
            object: object.clone(),
        })
    }
}

impl Thing {
    /// Where a line of the world meets it, and the outward normal there, in the world.
    pub fn under(&self, ray: &Ray) -> Option<(DVec3, DVec3)> {
        let own = self.world_from_object.inverse();
        let ray = Ray {
            from: own.transform_point3(ray.from),
            along: own.transform_vector3(ray.along).try_normalize()?,
        };
        let (p, normal) = pick(&*self.field, self.iso, &self.own_box, &ray)?;
        let turned = own.matrix3.transpose() * normal;
        Some((
            self.world_from_object.transform_point3(p),
            turned.normalize_or_zero(),
        ))
    }
}

impl std::fmt::Debug for Sheet {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "sheet of {} with {} edits", self.path.display(), self.done)
    }
}
