//! The thread that works: a document, the stroke in the hand, and the triangles that show both. It does one order after the other,
//! and the window never waits for it.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender};
use std::sync::{Arc, Mutex, PoisonError};

use document::{CommandError, Document, Live, Object, State};
use fitting::{Cancel, Control};
use glam::DVec3;
use tools::live::Pose;

use super::orders::{News, Order, Sheet, Thing};
use super::preview;
use super::tool::Tool;
use crate::cli::desk_files;
use crate::view::{Ray, Shape, pick};

/// What lies on the desk.
pub struct Desk {
    news: Sender<News>,
    wake: Box<dyn Fn() + Send>,
    cancel: Arc<Mutex<Cancel>>,
    /// Where documents are kept that have no name yet.
    home: PathBuf,
    open: Option<Open>,
}

/// An open document.
struct Open {
    document: Document,
    path: PathBuf,
    is_untitled: bool,
    chosen: String,
    live: Option<InHand>,
    shown: State,
    shapes: BTreeMap<String, Shape>,
    origin: DVec3,
    /// Whether the eye is on it.
    is_seen: bool,
}

/// A stroke.
struct InHand {
    live: Live,
    tool: Tool,
    /// Where a tool that takes hold did so, and towards the eye: it goes in the plane there. In the object's world.
    hold: Option<[DVec3; 2]>,
}

impl Desk {
    /// A desk with nothing on it. `wake` has the window look at the news; `cancel` ends what takes a while.
    pub fn new(
        news: Sender<News>,
        wake: Box<dyn Fn() + Send>,
        cancel: Arc<Mutex<Cancel>>,
        home: PathBuf,
    ) -> Self {
        Self {
            news,
            wake,
            cancel,
            home,
            open: None,
        }
    }

    /// Does orders until nobody gives any more. What is seen follows when no more orders wait.
    pub fn work(mut self, orders: &Receiver<Order>) {
        while let Ok(order) = orders.recv() {
            let mut next = Some(order);
            while let Some(order) = next {
                self.obey(order);
                next = orders.try_recv().ok();
            }
            self.show();
        }
        // A stroke in the hand becomes an edit: closing loses nothing.
        self.end();
        self.put_away();
    }

    /// Closes the document. One without a name in which nothing was done leaves no file.
    fn put_away(&mut self) {
        let Some(mut open) = self.open.take() else { return };
        let is_idle = open.document.counts().is_ok_and(|c| c.done + c.undone == 0);
        let (path, is_untitled) = (open.path.clone(), open.is_untitled);
        drop(open);
        if is_untitled && is_idle {
            // What cannot be removed is only in the way.
            let _ = std::fs::remove_file(path);
        }
    }

    fn tell(&self, news: News) {
        // Without a window nobody is left to be told.
        let _ = self.news.send(news);
        (self.wake)();
    }

    fn obey(&mut self, order: Order) {
        let done = match order {
            Order::Open(path) => self.open(&path),
            Order::Clay => {
                desk_files::clay_block().and_then(|(name, object)| self.start(&name, object, false))
            }
            Order::Show => {
                self.show_again(true);
                Ok(())
            }
            Order::Save(path) => self.save(&path),
            Order::Export { out, scan } => self.export(&out, scan.as_deref()),
            Order::Choose(name) => self.choose(name),
            Order::Begin { tool, ray } => self.begin(tool, &ray),
            Order::Along(ray) => self.along(&ray),
            Order::End => {
                self.end();
                Ok(())
            }
            Order::Drop => self.drop_stroke(),
            Order::Undo(count) => self.turn_back(|d| d.undo(count).map(drop)),
            Order::Redo(count) => self.turn_back(|d| d.redo(count).map(drop)),
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

    /// Opens a document, or makes one of a field or a scan.
    fn open(&mut self, path: &Path) -> Result<(), String> {
        self.end();
        if desk_files::is_document(path) {
            let mut notes = Vec::new();
            let document = desk_files::open(path, &mut notes)?;
            let is_untitled = path.parent() == Some(&self.home);
            self.lay(document, path.to_path_buf(), is_untitled, false)?;
            notes.into_iter().for_each(|note| self.tell(News::Note(note)));
            return Ok(());
        }
        let ((name, object), is_seen) = match desk_files::field(path) {
            Some(object) => (object?, false),
            None => {
                let fitted = self.fit(path);
                self.tell(News::Busy(None));
                fitted?
            }
        };
        let started = self.start(&name, object, is_seen);
        if started.is_err() && is_seen {
            self.show_again(false);
        }
        started
    }

    /// The object that a scan becomes, and whether a coarse one is seen meanwhile.
    fn fit(&mut self, scan: &Path) -> Result<((String, Object), bool), String> {
        let file = scan.file_name().unwrap_or_default().to_string_lossy();
        let (memory, most) = desk_files::memory();
        let show = |stage: &str, share: f64| {
            self.tell(News::Busy(Some((format!("{file}: {stage}{most}"), share))));
        };
        show("reading", 0.0);
        let cancel = self.begin_long();
        let fit = |options: &[OsString]| desk_files::fit(scan, options, memory, &cancel, &show);
        let mut options: Vec<OsString> = vec!["--coarse".into()];
        let mut coarse = fit(&options);
        if let Err(why) = &coarse
            && let Some(remedy) = desk_files::remedy(why)
        {
            options.push(remedy);
            coarse = fit(&options);
        }
        options.remove(0);
        // Whatever a few samples do not show may still be in all of them.
        let seen = coarse.and_then(|(name, object)| preview::news(scan, &name, object));
        let is_seen = seen.is_ok();
        seen.into_iter().flatten().for_each(|news| self.tell(news));
        let whole = match cancel.is_cancelled() {
            true => Err("cancelled".into()),
            false => {
                show("reading all of it", 0.0);
                fit(&options)
            }
        };
        if whole.is_err() && is_seen {
            self.show_again(false);
        }
        whole.map(|whole| (whole, is_seen))
    }

    /// All that is open, on which the eye may be still.
    fn show_again(&mut self, is_seen: bool) {
        match &mut self.open {
            None => self.tell(News::Empty),
            Some(open) => {
                open.shapes.clear();
                open.is_seen = is_seen;
                self.show();
                self.lay_sheet();
            }
        }
    }

    /// A new document with one object, which may be seen already.
    fn start(&mut self, name: &str, object: Object, is_seen: bool) -> Result<(), String> {
        self.end();
        let state = State::new().with(name, object).map_err(|e| e.to_string())?;
        let path = desk_files::untitled(&self.home, name)?;
        let document = desk_files::create(&path, state)?;
        self.lay(document, path, true, is_seen)
    }

    /// `is_seen`: the eye is on what is in it already.
    fn lay(
        &mut self,
        document: Document,
        path: PathBuf,
        is_untitled: bool,
        is_seen: bool,
    ) -> Result<(), String> {
        let state = document.state().clone();
        let Some(chosen) = state.objects().keys().next().cloned() else {
            return Err(format!("{}: has no objects", path.display()));
        };
        let boxes = state.objects().iter().filter_map(|(name, object)| {
            let placed = state.placement(name).ok()?;
            Some(object.field.world_box().transformed(&placed))
        });
        let all = boxes.reduce(bspline::Aabb::hull).ok_or("the document is empty")?;
        self.put_away();
        self.open = Some(Open {
            document,
            path,
            is_untitled,
            chosen,
            live: None,
            shown: state,
            shapes: BTreeMap::new(),
            origin: all.center(),
            is_seen,
        });
        // The eye goes to the surface before panels tell of it.
        self.show();
        self.lay_sheet();
        Ok(())
    }

    /// Tells of all that panels show.
    fn lay_sheet(&mut self) {
        let Some(open) = &mut self.open else { return };
        let names = open.shown.objects().keys();
        let objects: Vec<Thing> = names.filter_map(|name| Thing::of(&open.shown, name)).collect();
        let counts = open.document.counts();
        let history = open.document.history();
        let (counts, history) = match (counts, history) {
            (Ok(counts), Ok(history)) => (counts, history),
            (Err(e), _) | (_, Err(e)) => {
                let why = e.to_string();
                return self.tell(News::Failed(why));
            }
        };
        let sheet = Sheet {
            path: open.path.clone(),
            is_untitled: open.is_untitled,
            chosen: objects.iter().position(|t| t.name == open.chosen).unwrap_or(0),
            objects,
            history: history.into_iter().map(|edit| edit.title).collect(),
            done: counts.done,
        };
        self.tell(News::Sheet(Arc::new(sheet)));
    }

    /// Goes on in a copy under another name.
    fn save(&mut self, path: &Path) -> Result<(), String> {
        self.end();
        let Some(open) = self.open.take() else {
            return Ok(());
        };
        // Every edit is in its file already.
        let (from, chosen) = (open.path.clone(), open.chosen.clone());
        let open_untitled = open.is_untitled;
        drop(open);
        let copied = match from == path {
            true => Ok(()),
            false => formats::atomic::replace(path, |out| {
                std::io::copy(&mut std::fs::File::open(&from)?, out).map(drop)
            }),
        };
        let (path, is_untitled) = match &copied {
            Ok(()) => (path.to_path_buf(), false),
            Err(_) => (from.clone(), open_untitled),
        };
        let was_untitled = open_untitled && copied.is_ok();
        self.reopen(path.clone(), is_untitled, chosen)?;
        if was_untitled && from != path {
            // It has a name now. What cannot be removed is only in the way.
            let _ = std::fs::remove_file(&from);
        }
        copied.map_err(|e| format!("{}: {e}", path.display()))
    }

    fn reopen(&mut self, path: PathBuf, is_untitled: bool, chosen: String) -> Result<(), String> {
        let document = desk_files::open(&path, &mut Vec::new())?;
        self.lay(document, path, is_untitled, true)?;
        self.choose(chosen)
    }

    fn export(&mut self, out: &Path, scan: Option<&Path>) -> Result<(), String> {
        self.end();
        let Some(open) = self.open.take() else {
            return Ok(());
        };
        let (path, is_untitled, chosen) = (open.path.clone(), open.is_untitled, open.chosen.clone());
        // The command opens it for itself alone.
        drop(open);
        let file = out.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let show = |stage: &str, share: f64| self.tell(News::Busy(Some((format!("{file}: {stage}"), share))));
        show("writing", 0.0);
        let written = desk_files::export(&path, &chosen, out, scan, &self.begin_long(), &show);
        self.tell(News::Busy(None));
        self.reopen(path, is_untitled, chosen)?;
        written.map(|()| self.tell(News::Note(format!("{} is written", out.display()))))
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

    fn begin(&mut self, tool: Tool, ray: &Ray) -> Result<(), String> {
        self.end();
        let Some(open) = &mut self.open else { return Ok(()) };
        let Some((at, normal, own)) = open.under(ray) else {
            return Ok(());
        };
        let stroke = tool.stroke(at);
        let live = Live::begin(open.document.state(), &open.chosen, stroke).map_err(|e| e.to_string())?;
        let hold = tool.takes_hold().then_some([at, -own.along]);
        open.live = Some(InHand { live, tool, hold });
        self.step(tool.middle(at, normal))
    }

    fn along(&mut self, ray: &Ray) -> Result<(), String> {
        let Some(open) = &self.open else { return Ok(()) };
        let Some(hand) = &open.live else { return Ok(()) };
        let at = match hand.hold {
            Some([at, toward_eye]) => open.own_ray(ray).and_then(|own| {
                let fall = own.along.dot(toward_eye);
                let far = (at - own.from).dot(toward_eye) / fall;
                (fall.abs() > 1e-6 && far > 0.0).then(|| own.from + far * own.along)
            }),
            None => open
                .under(ray)
                .map(|(at, normal, _)| hand.tool.middle(at, normal)),
        };
        at.map_or(Ok(()), |at| self.step(at))
    }

    /// One step of the stroke in the hand.
    fn step(&mut self, at: DVec3) -> Result<(), String> {
        let Some(open) = &mut self.open else { return Ok(()) };
        let Some(hand) = &mut open.live else { return Ok(()) };
        let done = hand.live.step(Pose::at(at), &mut Control::default());
        let seen = done.and_then(|_| hand.live.look());
        match seen {
            Ok((state, _)) => {
                open.shown = state;
                Ok(())
            }
            Err(why) => {
                open.live = None;
                open.shown = open.document.state().clone();
                Err(format!("the stroke was left out: {why}"))
            }
        }
    }

    fn end(&mut self) {
        let Some(open) = &mut self.open else { return };
        let Some(hand) = open.live.take() else { return };
        let ended = hand.live.end(&mut open.document, &mut Control::default());
        open.shown = open.document.state().clone();
        match ended {
            Ok((_, notes)) => notes.into_iter().for_each(|note| self.tell(News::Note(note))),
            Err(CommandError::Document(why)) => {
                self.tell(News::Failed(format!("the edit is not on the disk: {why}")));
            }
            Err(why) => self.tell(News::Failed(format!("the stroke was left out: {why}"))),
        }
        self.lay_sheet();
    }

    fn drop_stroke(&mut self) -> Result<(), String> {
        if let Some(open) = &mut self.open {
            open.live = None;
            open.shown = open.document.state().clone();
        }
        Ok(())
    }

    fn turn_back(
        &mut self,
        turn: impl FnOnce(&mut Document) -> Result<(), document::DocumentError>,
    ) -> Result<(), String> {
        self.end();
        let Some(open) = &mut self.open else { return Ok(()) };
        let turned = turn(&mut open.document).map_err(|e| e.to_string());
        open.shown = open.document.state().clone();
        self.lay_sheet();
        turned
    }

    /// Makes the triangles of what is shown now.
    fn show(&mut self) {
        let Some(open) = &mut self.open else { return };
        let is_new = open.shapes.is_empty();
        let mut told = Vec::new();
        let names: Vec<String> = open.shapes.keys().cloned().collect();
        for name in names.iter().filter(|n| !open.shown.objects().contains_key(*n)) {
            open.shapes.remove(name);
            told.push(News::Gone(name.clone()));
        }
        for (name, object) in open.shown.objects() {
            let (Some(iso), Ok(placed)) = (object.meta.iso, open.shown.placement(name)) else {
                continue;
            };
            let followed = match open.shapes.get_mut(name) {
                Some(shape) if shape.follows(object, placed) => shape.follow(name, object, open.origin),
                _ => Shape::new(object, iso, placed).map(|mut shape| {
                    told.push(News::Gone(name.clone()));
                    let all = shape.all(name, open.origin);
                    open.shapes.insert(name.clone(), shape);
                    all
                }),
            };
            match followed {
                Ok(patches) if patches.is_empty() => {}
                Ok(patches) => told.push(News::Patches(patches)),
                Err(why) => told.push(News::Failed(format!("{name} cannot be shown: {why}"))),
            }
        }
        let scene = is_new.then(|| open.scene());
        scene.into_iter().chain(told).for_each(|news| self.tell(news));
    }
}

impl Open {
    /// Where all surfaces lie, and what is up.
    fn scene(&mut self) -> News {
        let boxes = self.shapes.values().filter_map(Shape::bounding_box);
        let is_volume = Thing::of(&self.shown, &self.chosen).is_some_and(|thing| thing.is_volume);
        let all = boxes.reduce(bspline::Aabb::hull);
        News::scene(
            self.origin,
            all,
            is_volume,
            std::mem::replace(&mut self.is_seen, true),
        )
    }

    /// A line of the world in the chosen object's.
    fn own_ray(&self, ray: &Ray) -> Option<Ray> {
        let own = self.shown.placement(&self.chosen).ok()?.inverse();
        Some(Ray {
            from: own.transform_point3(ray.from),
            along: own.transform_vector3(ray.along).try_normalize()?,
        })
    }

    /// Where a line meets the chosen object as the stroke found it, the outward normal there, and the line, all in the object's world. So a
    /// tool that carves does not follow what it carved, deeper and deeper.
    fn under(&self, ray: &Ray) -> Option<(DVec3, DVec3, Ray)> {
        let object = self.document.state().object(&self.chosen).ok()?;
        let own = self.own_ray(ray)?;
        let field = object.field.as_field();
        let (at, normal) = pick(field, object.meta.iso?, &object.field.world_box(), &own)?;
        Some((at, normal, own))
    }
}
