//! The thread that works: a document, the stroke in the hand, and the triangles that show both. It does one order after the other,
//! and the window never waits for it.

mod drawing;
mod files;
mod lent;
mod opening;
mod showing;
mod strokes;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use bspline::Aabb;
use document::{Document, Live, State};
use fitting::Cancel;
use glam::DVec3;

use super::limits::Limits;
use super::orders::{News, Order};
use super::tool::{Drawn, Tool};
use super::touch::Wanted;
use crate::cli::desk_files;
use crate::view::{Budget, Ray, Shape};

/// Has the window look at the news, after a while at the latest.
pub type Wake = Arc<dyn Fn(Duration) + Send + Sync>;

/// Time in which it looks how far work has come: pictures of that take their time from the work.
const LOOK: Duration = Duration::from_millis(200);

/// What lies on the desk.
pub struct Desk {
    news: Sender<News>,
    wake: Wake,
    cancel: Arc<Mutex<Cancel>>,
    /// Where documents are kept that have no name yet.
    home: PathBuf,
    open: Option<Open>,
    /// Triangles that are shown, at most.
    triangles: Budget,
    /// What is to be in the hand.
    wanted: Option<Wanted>,
    /// Where strokes of the palette may act.
    limits: Limits,
    /// What is to be shown before it is done.
    tried: Option<(Tool, Ray)>,
}

/// An open document.
struct Open {
    /// Missing while a device has it.
    document: Option<Document>,
    path: PathBuf,
    is_untitled: bool,
    chosen: String,
    live: Option<InHand>,
    /// What is drawn for a tool that acts at once.
    drawn: Option<(Tool, Drawn)>,
    /// What was copied or cut out.
    clip: Option<Clip>,
    /// Whether what is shown is what a click would leave.
    is_tried: bool,
    shown: State,
    shapes: BTreeMap<String, Shape>,
    /// Triangles that each object may have.
    shares: BTreeMap<String, Budget>,
    origin: DVec3,
    /// Titles of the edits, those undone too, and how many are done.
    history: (Vec<String>, usize),
    /// Whether the eye is on it.
    is_seen: bool,
}

/// A box of an object, to be pasted.
struct Clip {
    from: String,
    /// In the world of that object.
    region: Aabb,
}

/// A stroke.
struct InHand {
    live: Live,
    tool: Tool,
    /// Where a tool that takes hold did so, and towards the eye: it goes in the plane there. In the object's world.
    hold: Option<[DVec3; 2]>,
}

impl Desk {
    /// A desk with nothing on it. `cancel` ends what takes a while.
    pub fn new(news: Sender<News>, wake: Wake, cancel: Arc<Mutex<Cancel>>, home: PathBuf) -> Self {
        Self {
            news,
            wake,
            cancel,
            home,
            open: None,
            triangles: Budget::PROCESSOR,
            wanted: None,
            limits: Limits::default(),
            tried: None,
        }
    }

    /// Does orders until nobody gives any more. What is seen follows when no more orders wait.
    pub fn work(mut self, orders: &Receiver<Order>) {
        loop {
            let mut next = match self.wanted.clone() {
                Some(wanted) => self.touch(&wanted, orders),
                None => orders.recv().ok(),
            };
            if next.is_none() {
                break;
            }
            while let Some(order) = next {
                self.obey(order);
                next = orders.try_recv().ok();
            }
            self.show_tried();
            self.show();
        }
        // A stroke in the hand becomes an edit: closing loses nothing.
        self.end();
        self.put_away();
    }

    pub(super) fn tell(&self, news: News) {
        let within = match news {
            News::Busy(Some(_)) => LOOK,
            _ => Duration::ZERO,
        };
        // Without a window nobody is left to be told.
        let _ = self.news.send(news);
        (self.wake)(within);
    }

    fn obey(&mut self, order: Order) {
        let done = match order {
            Order::Open(path) => self.open(&path, Vec::new()),
            Order::Clay => {
                desk_files::clay_block().and_then(|(name, object)| self.start(&name, object, false))
            }
            Order::Show(triangles) => {
                self.triangles = triangles;
                self.show_again(true);
                Ok(())
            }
            Order::Save(path) => self.save(&path),
            Order::Export { out, scan, of_mesh } => self.export(&out, scan.as_deref(), &of_mesh),
            Order::Choose(name) => self.choose(name),
            Order::Begin { tool, ray, press } => self.begin(tool, &ray, press),
            Order::Along { ray, press } => self.along(&ray, press),
            Order::End => {
                self.end();
                self.end_drawing()
            }
            Order::Try(tool, ray) => {
                self.tried = Some((tool, ray));
                Ok(())
            }
            Order::Untry => {
                self.untry();
                Ok(())
            }
            Order::Limit(limits) => {
                self.limits = limits;
                Ok(())
            }
            Order::SaveScript(path) => self.save_script(&path),
            Order::RunScript(path) => self.run_script(&path),
            Order::OpenPart(path, options) => self.open(&path, options),
            Order::Command(command) => self.apply_all(vec![*command]),
            Order::Drop => self.drop_stroke(),
            Order::Undo(count) => self.turn_back(|d| d.undo(count).map(drop)),
            Order::Redo(count) => self.turn_back(|d| d.redo(count).map(drop)),
            Order::Weigh(name) => {
                let shape = self.open.as_ref().and_then(|open| open.shapes.get(&name));
                if let Some(shape) = shape {
                    self.tell(News::Size(name, shape.area_and_volume()));
                }
                Ok(())
            }
            Order::Do(stroke) => self.apply(*stroke),
            Order::Take(wanted) => {
                self.wanted = Some(wanted);
                Ok(())
            }
            Order::Tool(tool) => {
                if let Some(wanted) = &mut self.wanted {
                    wanted.tool = tool;
                }
                Ok(())
            }
            Order::LetGo => {
                self.let_go();
                Ok(())
            }
        };
        if let Err(why) = done {
            self.tell(News::Failed(why));
        }
    }

    /// What ends the work that begins now, for the window to ask for it.
    fn begin_long(&self) -> Cancel {
        let cancel = Cancel::new();
        *self.cancel.lock().unwrap_or_else(PoisonError::into_inner) = cancel.clone();
        cancel
    }

    fn choose(&mut self, name: String) -> Result<(), String> {
        self.end();
        if let Some(open) = &mut self.open
            && open.shown.objects().contains_key(&name)
        {
            open.chosen = name;
        }
        self.lay_sheet();
        Ok(())
    }
}
