//! The thread that works: a document, the stroke in the hand, and the triangles that show both. It does one order after the other,
//! and the window never waits for it.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender};
use std::sync::{Arc, Mutex, PoisonError};

use document::{Command, CommandError, Document, Live, Object, State};
use fitting::{Cancel, Control};
use glam::DVec3;
use tools::live::Pose;
use tools::session::Stroke;

use super::orders::{News, Order, Sheet, Thing};
use super::preview;
use super::tool::Tool;
use super::touch::Wanted;
use crate::cli::desk_files;
use crate::view::{Ray, Shape, Solid, pick};

/// What lies on the desk.
pub struct Desk {
    news: Sender<News>,
    wake: Arc<dyn Fn() + Send + Sync>,
    cancel: Arc<Mutex<Cancel>>,
    /// Where documents are kept that have no name yet.
    home: PathBuf,
    open: Option<Open>,
    /// What is to be in the hand.
    wanted: Option<Wanted>,
}

/// An open document.
struct Open {
    /// Missing while a device has it.
    document: Option<Document>,
    path: PathBuf,
    is_untitled: bool,
    chosen: String,
    live: Option<InHand>,
    shown: State,
    shapes: BTreeMap<String, Shape>,
    origin: DVec3,
    /// Titles of the edits, those undone too, and how many are done.
    history: (Vec<String>, usize),
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
        wake: Arc<dyn Fn() + Send + Sync>,
        cancel: Arc<Mutex<Cancel>>,
        home: PathBuf,
    ) -> Self {
        Self {
            news,
            wake,
            cancel,
            home,
            open: None,
            wanted: None,
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
            self.show();
        }
        // A stroke in the hand becomes an edit: closing loses nothing.
        self.end();
        self.put_away();
    }

    /// Closes the document. One without a name in which nothing was done leaves no file.
    fn put_away(&mut self) {
        let Some(mut open) = self.open.take() else { return };
        let counts = open.document.as_mut().map(Document::counts);
        let is_idle = counts.is_some_and(|counts| counts.is_ok_and(|c| c.done + c.undone == 0));
        let (path, is_untitled) = (open.path.clone(), open.is_untitled);
        drop(open);
        if is_untitled && is_idle {
            // What cannot be removed is only in the way.
            let _ = std::fs::remove_file(path);
        }
    }

    pub(super) fn tell(&self, news: News) {
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
            document: Some(document),
            path,
            is_untitled,
            chosen,
            live: None,
            shown: state,
            shapes: BTreeMap::new(),
            origin: all.center(),
            history: (Vec::new(), 0),
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
        if let Some(document) = &mut open.document {
            open.history = match (document.counts(), document.history()) {
                (Ok(counts), Ok(all)) => (all.into_iter().map(|edit| edit.title).collect(), counts.done),
                (Err(e), _) | (_, Err(e)) => {
                    let why = e.to_string();
                    return self.tell(News::Failed(why));
                }
            };
        }
        let (history, done) = open.history.clone();
        let sheet = Sheet {
            path: open.path.clone(),
            is_untitled: open.is_untitled,
            chosen: objects.iter().position(|t| t.name == open.chosen).unwrap_or(0),
            objects,
            history,
            done,
        };
        self.tell(News::Sheet(Arc::new(sheet)));
    }

    /// Goes on in a copy under another name.
    fn save(&mut self, path: &Path) -> Result<(), String> {
        self.end();
        let Some(open) = &mut self.open else { return Ok(()) };
        let (from, was_untitled) = (open.path.clone(), open.is_untitled);
        if from == path {
            return Ok(());
        }
        // Every edit is in its file already.
        open.document = None;
        let copied = formats::atomic::replace(path, |out| {
            std::io::copy(&mut std::fs::File::open(&from)?, out).map(drop)
        });
        if copied.is_ok() {
            (open.path, open.is_untitled) = (path.to_path_buf(), false);
        }
        self.reopen()?;
        if was_untitled && copied.is_ok() {
            // It has a name now. What cannot be removed is only in the way.
            let _ = std::fs::remove_file(&from);
        }
        copied.map_err(|e| format!("{}: {e}", path.display()))
    }

    /// Opens the file anew whose document was closed; what is seen of it stays.
    fn reopen(&mut self) -> Result<(), String> {
        let Some(open) = &mut self.open else { return Ok(()) };
        match desk_files::open(&open.path, &mut Vec::new()) {
            Ok(document) => self.take_back(document),
            Err(why) => {
                self.open = None;
                self.tell(News::Empty);
                return Err(why);
            }
        }
        Ok(())
    }

    fn export(&mut self, out: &Path, scan: Option<&Path>) -> Result<(), String> {
        self.end();
        let Some(open) = &mut self.open else { return Ok(()) };
        // The command opens it for itself alone.
        open.document = None;
        let (path, chosen) = (open.path.clone(), open.chosen.clone());
        let file = out.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let show = |stage: &str, share: f64| self.tell(News::Busy(Some((format!("{file}: {stage}"), share))));
        show("writing", 0.0);
        let written = desk_files::export(&path, &chosen, out, scan, &self.begin_long(), &show);
        self.tell(News::Busy(None));
        self.reopen()?;
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
        let live = Live::begin(open.state(), &open.chosen, stroke).map_err(|e| e.to_string())?;
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
                open.shown = open.state().clone();
                Err(format!("the stroke was left out: {why}"))
            }
        }
    }

    pub(super) fn end(&mut self) {
        let Some(open) = &mut self.open else { return };
        let (Some(hand), Some(document)) = (open.live.take(), &mut open.document) else {
            return;
        };
        let ended = hand.live.end(document, &mut Control::default());
        open.shown = document.state().clone();
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
            open.shown = open.state().clone();
        }
        Ok(())
    }

    /// Does a stroke that needs no hand.
    fn apply(&mut self, stroke: Stroke) -> Result<(), String> {
        self.end();
        let Some(open) = &self.open else { return Ok(()) };
        let (state, object) = (open.state().clone(), open.chosen.clone());
        let command = Command::Stroke {
            object,
            stroke: Box::new(stroke),
        };
        let title = command.title();
        let (what, news, wake) = (title.clone(), self.news.clone(), self.wake.clone());
        let mut control = Control {
            cancel: self.begin_long(),
            on_progress: Box::new(move |at| {
                let _ = news.send(News::Busy(Some((format!("{what}: {}", at.stage), at.fraction))));
                wake();
            }),
            ..Control::default()
        };
        let done = command.apply(&state, &mut control);
        self.tell(News::Busy(None));
        let (next, notes) = done.map_err(|e| e.to_string())?;
        self.turn_back(|document| document.commit(&title, command.to_value(), next).map(drop))?;
        notes.into_iter().for_each(|note| self.tell(News::Note(note)));
        Ok(())
    }

    /// What is open, and the name of the chosen object.
    pub(super) fn chosen(&self) -> Option<(&State, &str)> {
        let open = self.open.as_ref()?;
        Some((open.state(), &open.chosen))
    }

    /// Lends the document to a device.
    pub(super) fn lend(&mut self) -> Option<Document> {
        self.open.as_mut()?.document.take()
    }

    /// Takes the document back; without one it was lost, and is opened anew.
    ///
    /// # Errors
    /// That it cannot be opened; then nothing is open any more.
    pub(super) fn return_lent(&mut self, document: Option<Document>) -> Result<(), String> {
        match document {
            Some(document) => self.take_back(document),
            None => self.reopen()?,
        }
        Ok(())
    }

    fn take_back(&mut self, document: Document) {
        if let Some(open) = &mut self.open {
            open.shown = document.state().clone();
            open.document = Some(document);
        }
        self.lay_sheet();
    }

    /// A device has done edits.
    pub(super) fn hear_edits(&mut self, titles: Vec<String>) {
        if let Some(Open {
            history: (all, done), ..
        }) = &mut self.open
        {
            all.truncate(*done);
            all.extend(titles);
            *done = all.len();
        }
        self.lay_sheet();
    }

    /// Nothing is to be in the hand any more.
    pub(super) fn let_go(&mut self) {
        self.wanted = None;
    }

    /// Shows what a device made of the document.
    pub(super) fn look_at(&mut self, state: State) {
        if let Some(open) = &mut self.open {
            open.shown = state;
        }
        self.show();
    }

    fn turn_back(
        &mut self,
        turn: impl FnOnce(&mut Document) -> Result<(), document::DocumentError>,
    ) -> Result<(), String> {
        self.end();
        let Some(open) = &mut self.open else { return Ok(()) };
        let Some(document) = &mut open.document else {
            return Ok(());
        };
        let turned = turn(document).map_err(|e| e.to_string());
        open.shown = document.state().clone();
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
            let (Some(iso), Ok(placed)) = (object.iso(), open.shown.placement(name)) else {
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
                Ok(patches) => {
                    told.push(News::Patches(patches));
                    let solid = Solid::of(object, iso, placed).map(Box::new);
                    told.extend(solid.map(|solid| News::Solid(name.clone(), solid)));
                }
                Err(why) => told.push(News::Failed(format!("{name} cannot be shown: {why}"))),
            }
        }
        let scene = is_new.then(|| open.scene());
        scene.into_iter().chain(told).for_each(|news| self.tell(news));
    }
}

impl Open {
    /// The state of the document, or what a device shows of it.
    fn state(&self) -> &State {
        self.document.as_ref().map_or(&self.shown, Document::state)
    }

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
        let object = self.state().object(&self.chosen).ok()?;
        let own = self.own_ray(ray)?;
        let field = object.field.as_field();
        let (at, normal) = pick(field, object.iso()?, &object.field.world_box(), &own)?;
        Some((at, normal, own))
    }
}
