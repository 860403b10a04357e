//! A document comes on the desk, and goes.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use document::{Document, Object, State};

use super::{Desk, Open};
use crate::cli::desk_files;
use crate::view::is_heavy;
use crate::window::orders::{News, Sheet, Thing};
use crate::window::preview;

fn is_any_heavy(state: &State) -> bool {
    state.objects().values().any(is_heavy)
}

impl Desk {
    /// Closes the document. One without a name in which nothing was done leaves no file.
    pub(super) fn put_away(&mut self) {
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

    /// Opens a document, or makes one of a field or a scan, by options of `fit`.
    pub(super) fn open(&mut self, path: &Path, options: Vec<OsString>) -> Result<(), String> {
        self.end();
        let file = path.file_name().unwrap_or_default().to_string_lossy();
        self.tell(News::Busy(Some((format!("{file}: opening"), 0.0))));
        let opened = self.open_any(path, options);
        self.tell(News::Busy(None));
        opened
    }

    fn open_any(&mut self, path: &Path, options: Vec<OsString>) -> Result<(), String> {
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
            None => self.fit(path, options)?,
        };
        let started = self.start(&name, object, is_seen);
        if started.is_err() {
            self.show_again(false);
        }
        started
    }

    /// The object that a scan becomes, and whether a coarse one is seen meanwhile.
    fn fit(&mut self, scan: &Path, mut options: Vec<OsString>) -> Result<((String, Object), bool), String> {
        let file = scan.file_name().unwrap_or_default().to_string_lossy();
        let (memory, most) = desk_files::memory();
        let show = |stage: &str, share: f64| {
            self.tell(News::Busy(Some((format!("{file}: {stage}{most}"), share))));
        };
        show("reading", 0.0);
        let cancel = self.begin_long();
        let fit = |options: &[OsString]| desk_files::fit(scan, options, memory, &cancel, &show);
        options.insert(0, "--coarse".into());
        let mut coarse = fit(&options);
        if let Err(why) = &coarse
            && let Some(remedy) = desk_files::remedy(why)
        {
            options.push(remedy);
            coarse = fit(&options);
        }
        options.remove(0);
        // Whatever a few samples do not show may still be in all of them.
        let coarse = coarse.and_then(|(name, object)| {
            let state = State::new().with(&name, object);
            state.map_err(|e| e.to_string())
        });
        let is_seen = coarse.is_ok_and(|state| self.preview(scan, &state));
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

    /// The same as [`preview`](Self::preview), where finer triangles take long.
    fn preview_heavy(&self, path: &Path, state: &State) -> bool {
        is_any_heavy(state) && self.preview(path, state)
    }

    /// Shows coarse triangles of objects that are not open yet; whether it could.
    fn preview(&self, path: &Path, state: &State) -> bool {
        let seen = preview::news(path, state);
        let is_seen = seen.is_ok();
        seen.into_iter().flatten().for_each(|news| self.tell(news));
        is_seen
    }

    /// All that is open, on which the eye may be still.
    pub(super) fn show_again(&mut self, is_seen: bool) {
        match &mut self.open {
            None => self.tell(News::Empty),
            Some(open) => {
                open.shapes.clear();
                open.shares.clear();
                open.is_seen = is_seen;
                self.show();
                self.lay_sheet();
            }
        }
    }

    /// A new document with one object, which may be seen already.
    pub(super) fn start(&mut self, name: &str, object: Object, is_seen: bool) -> Result<(), String> {
        self.end();
        let state = State::new().with(name, object).map_err(|e| e.to_string())?;
        let path = desk_files::untitled(&self.home, name)?;
        let is_seen = is_seen || self.preview_heavy(&path, &state);
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
        let is_seen = is_seen || self.preview_heavy(&path, &state);
        if is_seen && is_any_heavy(&state) {
            self.tell(News::Note("finer triangles are being made".into()));
        }
        self.put_away();
        self.open = Some(Open {
            document: Some(document),
            path,
            is_untitled,
            chosen,
            live: None,
            drawn: None,
            clip: None,
            is_tried: false,
            shown: state,
            shapes: BTreeMap::new(),
            shares: BTreeMap::new(),
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
    pub(super) fn lay_sheet(&mut self) {
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
}
