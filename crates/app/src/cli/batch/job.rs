//! One input from its file to its place in the manifest.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

use fitting::Cancel;
use serde_json::{Map, Value, json};
use sha2::{Digest, Sha256};

use super::super::failure::{Failure, OrFail, Outcome};
use super::super::quantity::Memory;
use super::super::summary::hex;
use super::child::{self, Bounds, Ended, Stop, ask};
use super::choice::Choice;
use super::digest;
use super::gather::Item;
use super::manifest::{Entry, PROGRAM, Reason, State, Written};

/// What all inputs have in common.
pub struct Plan<'a> {
    /// Options of fits.
    pub choice: &'a Choice,
    /// What of them goes into the manifest.
    pub parameters: &'a Map<String, Value>,
    /// Where outputs go.
    pub directory: &'a Path,
    /// Where they are made: on the same disk.
    pub work: &'a Path,
    /// Of each process.
    pub threads: usize,
    /// Of each process.
    pub memory: Option<Memory>,
    /// Of each input.
    pub time_limit: Option<Duration>,
    /// Whether pictures are drawn.
    pub has_pictures: bool,
    /// Ends the work.
    pub cancel: &'a Cancel,
}

/// Width and height of the pictures of a report.
const PICTURE: &str = "240x180";
/// Share of the work that the fit is, before mesh and pictures.
const FIT: f64 = 0.8;

/// Sub-directories of the batch, by what is in them.
const PLACES: [(&str, &str); 4] = [
    ("field", "fields"),
    ("mesh", "meshes"),
    ("picture", "pictures"),
    ("errors", "pictures"),
];

impl Plan<'_> {
    /// Does an input, unless `found` says that it is done already, and tells whether that was so. `None` after a cancel.
    ///
    /// # Errors
    /// Exit code 4 if outputs cannot be put where they belong: that would meet every other input too.
    pub fn one(
        &self,
        item: &Item,
        found: Option<&Entry>,
        show: &dyn Fn(&str, f64),
    ) -> Outcome<Option<(Entry, bool)>> {
        let start = Instant::now();
        let mut entry = Entry {
            input: item.path.display().to_string(),
            name: item.name.clone(),
            state: State::Failed,
            kind: item.kind.map(|k| k.to_string()),
            input_bytes: item.bytes,
            input_sha256: None,
            key: None,
            failure: None,
            fit: Map::new(),
            mesh: Map::new(),
            outputs: BTreeMap::new(),
            seconds: 0.0,
            peak_rss_bytes: None,
            notes: Vec::new(),
        };
        let reading = |message: String| Reason {
            stage: "reading".into(),
            exit_code: None,
            signal: None,
            message,
        };
        if let Some(trouble) = &item.trouble {
            entry.failure = Some(reading(trouble.clone()));
            return Ok(Some((entry, false)));
        }
        show("reading", 0.0);
        let stamp = stamp(&item.path);
        let deadline = self.time_limit.map(|limit| (start + limit, limit));
        let late = || child::late("reading", deadline, Instant::now());
        match digest::of(&item.path, &|| self.cancel.is_cancelled() || late().is_some()) {
            Ok((content, bytes)) => {
                entry.key = Some(self.key(&content));
                (entry.input_sha256, entry.input_bytes) = (Some(content), bytes);
            }
            Err(_) if self.cancel.is_cancelled() => return Ok(None),
            Err(e) => {
                entry.failure = Some(late().unwrap_or_else(|| reading(unreadable(&e))));
                return Ok(Some((entry, false)));
            }
        }
        if let Some(found) = found.filter(|f| f.key == entry.key && self.stands(f)) {
            return Ok(Some((found.clone(), true)));
        }
        let scratch = self.work.join(&item.name);
        fs::create_dir_all(&scratch).map_err(|e| no_room(self.directory, &e))?;
        let done = self.make(item, &scratch, deadline, &mut entry, show);
        let whole = match done {
            Ok(made) => {
                if entry.failure.is_none() && self::stamp(&item.path) != stamp {
                    entry.failure = Some(reading(
                        "changed while it was read; do it again by --resume".into(),
                    ));
                }
                self.publish(&made, &mut entry)
            }
            Err(()) => {
                let _ = fs::remove_dir_all(&scratch);
                return Ok(None);
            }
        };
        let _ = fs::remove_dir_all(&scratch);
        match whole {
            Ok(()) => {}
            Err(_) if self.cancel.is_cancelled() => return Ok(None),
            Err(e) => return Err(no_room(self.directory, &e)),
        }
        if entry.failure.is_none() {
            entry.state = State::Done;
        }
        entry.seconds = start.elapsed().as_secs_f64();
        Ok(Some((entry, false)))
    }

    /// Content, options and program in one.
    fn key(&self, content: &str) -> String {
        let all = json!([PROGRAM, self.parameters, content]).to_string();
        hex(&Sha256::digest(all.as_bytes()))
    }

    /// Whether a result holds: its files are there, to the bit; or the input is bad, which trying again does not mend.
    fn stands(&self, found: &Entry) -> bool {
        let is_there = |w: &Written| {
            let path = self.directory.join(&w.path);
            let is_inside = Path::new(&w.path)
                .components()
                .all(|c| matches!(c, std::path::Component::Normal(_)));
            is_inside
                && path.metadata().is_ok_and(|m| m.is_file() && m.len() == w.bytes)
                && digest::of_file(&path, &|| self.cancel.is_cancelled())
                    .is_ok_and(|(sha, _)| hex(&sha) == w.sha256)
        };
        match (found.state, &found.failure) {
            (State::Done, _) => found.outputs.values().all(is_there),
            (State::Failed, Some(reason)) => {
                matches!(reason.exit_code, Some(2 | 3)) && found.outputs.values().all(is_there)
            }
            (State::Failed, None) => false,
        }
    }

    /// Makes the outputs in `scratch`; `Err` after a cancel.
    fn make(
        &self,
        item: &Item,
        scratch: &Path,
        deadline: Option<(Instant, Duration)>,
        entry: &mut Entry,
        show: &dyn Fn(&str, f64),
    ) -> Result<Vec<(&'static str, PathBuf)>, ()> {
        let bounds = Bounds {
            cancel: self.cancel,
            deadline,
            scratch,
            is_aside: false,
        };
        let path = |ending: &str| scratch.join(format!("{}.{ending}", item.name));
        let field = path("iclay");
        let mut made = Vec::new();

        let mut arguments = self.common(&field);
        arguments.extend(self.choice.arguments(item.kind).into_iter().map(OsString::from));
        arguments.extend(["--".into(), item.path.clone().into_os_string()]);
        let ended = ask("fit", &arguments, &bounds, &|stage, f| show(stage, FIT * f));
        let Some(fit) = settle(ended, scratch, entry)? else {
            return Ok(made);
        };
        entry.notes.extend(notes(&fit));
        entry.fit = without_place(fit);
        made.push(("field", field.clone()));

        if let Some(format) = &self.choice.mesh {
            show("meshing", FIT);
            let mesh = path(format);
            let mut arguments = self.common(&mesh);
            arguments.push(field.clone().into());
            let ended = ask("mesh", &arguments, &bounds, &|stage, _| show(stage, FIT));
            let Some(said) = settle(ended, scratch, entry)? else {
                return Ok(made);
            };
            entry.notes.extend(notes(&said));
            entry.mesh = without_place(said);
            made.push(("mesh", mesh));
        }

        if self.has_pictures {
            show("drawing", 0.9);
            let (picture, errors) = (path("png"), path("errors.png"));
            let mut arguments = self.common(&picture);
            arguments.extend(["--size", PICTURE, "--errors"].map(OsString::from));
            arguments.extend([errors.clone().into(), field.into()]);
            if matches!(item.kind, Some(formats::Kind::Volume(_))) {
                // Patients lie or stand along z.
                arguments.extend(["--up", "z", "--azimuth", "30"].map(OsString::from));
            }
            let ended = ask("picture", &arguments, &bounds, &|stage, _| show(stage, 0.9));
            entry.peak_rss_bytes = entry.peak_rss_bytes.max(ended.peak);
            match ended.said {
                Ok(_) => made.extend([("picture", picture), ("errors", errors)]),
                Err(Stop::Cancelled) => return Err(()),
                // The result is there all the same.
                Err(Stop::Failed(reason)) => {
                    let why = without_scratch(&reason.message, scratch);
                    entry.notes.push(format!("no picture: {why}"));
                }
            }
        }
        Ok(made)
    }

    /// Arguments of every command.
    fn common(&self, output: &Path) -> Vec<OsString> {
        let mut arguments = vec![
            "-o".into(),
            output.into(),
            format!("--threads={}", self.threads).into(),
        ];
        arguments.extend(self.memory.map(|m| format!("--memory={}", m.0).into()));
        arguments
    }

    /// Puts the outputs in their places.
    fn publish(&self, made: &[(&str, PathBuf)], entry: &mut Entry) -> io::Result<()> {
        for (role, path) in made {
            let place = PLACES.iter().find(|p| p.0 == *role).map_or("", |p| p.1);
            let name = path.file_name().unwrap_or_default();
            let (sha256, bytes) = digest::of_file(path, &|| self.cancel.is_cancelled())?;
            fs::create_dir_all(self.directory.join(place))?;
            fs::rename(path, self.directory.join(place).join(name))?;
            let written = Written {
                path: format!("{place}/{}", name.to_string_lossy()),
                bytes,
                sha256: hex(&sha256),
            };
            entry.outputs.insert((*role).into(), written);
        }
        Ok(())
    }
}

/// What a command said; `None` and a reason in the entry if it failed, `Err` after a cancel.
fn settle(ended: Ended, scratch: &Path, entry: &mut Entry) -> Result<Option<Map<String, Value>>, ()> {
    entry.peak_rss_bytes = entry.peak_rss_bytes.max(ended.peak);
    match ended.said {
        Ok(said) => Ok(Some(said)),
        Err(Stop::Cancelled) => Err(()),
        Err(Stop::Failed(mut reason)) => {
            reason.message = without_scratch(&reason.message, scratch);
            entry.failure = Some(reason);
            Ok(None)
        }
    }
}

/// A message that names files as they are called, not where they were made: that directory is gone when it is read.
fn without_scratch(message: &str, scratch: &Path) -> String {
    message.replace(&format!("{}/", scratch.display()), "")
}

fn notes(said: &Map<String, Value>) -> Vec<String> {
    let notes = said.get("notes").and_then(Value::as_array);
    let texts = notes.into_iter().flatten().filter_map(Value::as_str);
    texts.map(String::from).collect()
}

/// An object without what the entry has in a place of its own.
fn without_place(mut said: Map<String, Value>) -> Map<String, Value> {
    said.remove("output");
    said.remove("notes");
    said
}

/// When a file or directory was last written.
fn stamp(path: &Path) -> Option<(u64, SystemTime)> {
    let metadata = path.metadata().ok()?;
    Some((metadata.len(), metadata.modified().ok()?))
}

fn unreadable(e: &io::Error) -> String {
    match e.kind() {
        io::ErrorKind::PermissionDenied => {
            format!("cannot be read ({e}); give yourself the right to read it")
        }
        _ => format!("cannot be read ({e}); check the path and the disk"),
    }
}

fn no_room(directory: &Path, e: &io::Error) -> Failure {
    Failure::limit(format!(
        "-o {}: outputs cannot be put there ({e}); free some space, and go on by --resume",
        directory.display()
    ))
}

/// Makes the directory of the batch.
pub fn make_directory(directory: &Path) -> Outcome {
    if directory.exists() && !directory.is_dir() {
        return Err(Failure::usage(format!(
            "-o {}: is no directory; name another",
            directory.display()
        )));
    }
    fs::create_dir_all(directory)
        .map_err(|e| {
            anyhow::anyhow!(
                "-o {}: cannot be made ({e}); name another directory",
                directory.display()
            )
        })
        .or_limit()
}
