//! What the window asks of the desk, and what the desk tells it.

use std::path::PathBuf;
use std::sync::Arc;

use bspline::{Aabb, Field};
use glam::{DAffine3, DVec3};
use tools::hold::Held;
use tools::session::Stroke;

use super::tool::Tool;
use super::touch::{self, Seen, Wanted};
use crate::view::{Patch, Ray};

/// What the window asks. Lines are those under the mouse, in the world.
#[derive(Clone, Debug)]
pub enum Order {
    /// A document, or a field or scan that becomes an object of a new one.
    Open(PathBuf),
    /// A new document with a block of clay.
    Clay,
    /// The document goes on under another name.
    Save(PathBuf),
    /// Writes the chosen object: a mesh, a field, or its scan with its edits.
    Export {
        /// What is written.
        out: PathBuf,
        /// Over which scan.
        scan: Option<PathBuf>,
    },
    /// Tools work on this object from now on.
    Choose(String),
    /// A stroke begins.
    Begin {
        /// With which tool.
        tool: Tool,
        /// Where.
        ray: Ray,
    },
    /// It goes on.
    Along(Ray),
    /// It ends.
    End,
    /// It leaves nothing.
    Drop,
    /// Undoes the last edits.
    Undo(usize),
    /// Does edits again.
    Redo(usize),
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
    },
    /// Triangles in place of those that there were.
    Patches(Vec<Patch>),
    /// An object is no more.
    Gone(String),
    /// What takes a while, and the share done; none when it is done.
    Busy(Option<(String, f64)>),
    /// What is in the hand now.
    Held(Option<touch::Held>),
    /// What it does and feels.
    Seen(Seen),
    /// Something to tell.
    Note(String),
    /// Something that could not be done.
    Failed(String),
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
    /// Whether it was fitted to a volume: then its world is a patient's.
    pub is_volume: bool,
    /// Of its lengths, as people write it.
    pub unit: &'static str,
    /// Coefficients of its field.
    pub coefficients: usize,
    /// Its constraints, in its own world.
    pub holds: Vec<Held>,
}

impl std::fmt::Debug for Sheet {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "sheet of {} with {} edits", self.path.display(), self.done)
    }
}
