//! Commands on documents.

pub mod export;
pub mod feel;
pub mod history;
pub mod info;
mod knots;
mod like;
pub mod new;
pub mod replay;
pub mod sculpt;
pub mod undo;

use std::collections::BTreeMap;
use std::path::Path;

use bspline::Aabb;
use document::{CommandError, Document, DocumentError, Object, Options, State};
use formats::Fault;
use formats::field::FieldMeta;
use serde::Serialize;

use super::failure::{Failure, Outcome};
use super::input::limits;
use super::output::Output;
use super::quantity::{human_bytes, human_count, human_number};
use super::summary::{self, hex, table};

/// Opens a document for the command alone; what was lost goes to the notes.
pub fn open(path: &Path, notes: &mut Vec<String>) -> Outcome<Document> {
    let opened = Document::open(path, options()).map_err(failure)?;
    if let Some(lost) = &opened.lost {
        let bytes = human_bytes(lost.bytes);
        notes.push(match lost.is_torn {
            true => format!("the last edit was not whole ({bytes}), as after a crash, and is left out"),
            false => format!(
                "{bytes} at the end cannot be followed ({}); they are copied to a file .damaged before the document is \
                 changed",
                lost.why
            ),
        });
    }
    Ok(opened.document)
}

/// The same, for a command that changes it.
pub fn open_to_change(path: &Path, notes: &mut Vec<String>) -> Outcome<Document> {
    let document = open(path, notes)?;
    document.writable().map_err(failure)?;
    Ok(document)
}

pub fn options() -> Options {
    Options {
        limits: limits(None),
        ..Options::default()
    }
}

/// What stands beside an object's field when it leaves the document.
pub fn edited_meta(object: &Object) -> FieldMeta {
    let mut meta = (*object.meta).clone();
    meta.iso = object.iso();
    meta.notes
        .push("from a document; errors and leaves are those of the fit, before any edit".into());
    meta
}

/// Sorts an error of a document under an exit code.
fn failure(error: DocumentError) -> Failure {
    match &error {
        DocumentError::File(e) => match &e.fault {
            Fault::Io {
                doing: "writing" | "creating the output",
                ..
            }
            | Fault::Output { .. }
            | Fault::Limit { .. } => Failure::limit(error),
            _ => Failure::input(error),
        },
        DocumentError::InUse(_) => Failure::limit(error),
        _ => Failure::usage(error),
    }
}

impl From<CommandError> for Failure {
    fn from(error: CommandError) -> Self {
        match error {
            CommandError::Document(error) => failure(error),
            CommandError::Cancelled(error) => error.into(),
            error => Self::input(error),
        }
    }
}

/// The object that the user named, or the only one.
fn chosen<'a>(state: &'a State, named: Option<&'a str>) -> Outcome<&'a str> {
    let names: Vec<&String> = state.objects().keys().collect();
    match (named, &names[..]) {
        (Some(name), _) => state
            .object(name)
            .map(|_| name)
            .map_err(|e| Failure::usage(format!("--object: {e}"))),
        (None, [one]) => Ok(one),
        (None, _) => Err(Failure::usage(format!(
            "the document has {} objects ({}); name one with --object",
            names.len(),
            names.iter().map(|n| n.as_str()).collect::<Vec<_>>().join(", ")
        ))),
    }
}

/// What a command on a document tells when it is done.
#[derive(Serialize)]
struct Told {
    /// SHA-256 of the field of every object.
    field_sha256: BTreeMap<String, String>,
    /// SHA-256 of all objects with their placements.
    state_sha256: String,
    /// Edits that are done.
    done: usize,
    /// Edits that are undone.
    undone: usize,
    /// Edits that can no longer be undone.
    forgotten: u64,
    /// Bytes of the file.
    bytes: u64,
    /// Of a preview: corners of the box, of its own world, in which the field of each object would change.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    changed: BTreeMap<String, [[f64; 3]; 2]>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    notes: Vec<String>,
}

impl Told {
    fn of(document: &mut Document, mut notes: Vec<String>) -> Outcome<Self> {
        let counts = document.counts().map_err(failure)?;
        if let Some(trouble) = document.trouble() {
            notes.push(format!(
                "the edit is safe, but the file could not be shortened: {trouble}"
            ));
        }
        let objects = document.state().objects().iter();
        Ok(Self {
            field_sha256: objects
                .map(|(name, o)| (name.clone(), hex(&o.field.sha256())))
                .collect(),
            state_sha256: hex(&document.state().sha256()),
            done: counts.done,
            undone: counts.undone,
            forgotten: counts.forgotten,
            bytes: document.size(),
            changed: BTreeMap::new(),
            notes,
        })
    }

    /// Tells of a state that is shown in place of the document's own.
    fn show(&mut self, before: &State, shown: &State) {
        let objects = shown.objects().iter();
        self.field_sha256 = objects
            .map(|(name, o)| (name.clone(), hex(&o.field.sha256())))
            .collect();
        self.state_sha256 = hex(&shown.sha256());
        for (name, object) in shown.objects() {
            let whole = object.field.world_box();
            let boxes = before
                .objects()
                .get(name)
                .map_or(vec![whole], |old| object.field.changed_boxes(&old.field));
            if let Some(b) = boxes.into_iter().reduce(Aabb::hull) {
                self.changed
                    .insert(name.clone(), [b.min.to_array(), b.max.to_array()]);
            }
        }
    }

    fn print(&self, json: bool) -> Outcome {
        summary::print(&self.text(json), false)
    }

    fn print_after(&self, output: &Output, json: bool) -> Outcome {
        output.finish()?;
        summary::print(&self.text(json), output.is_stdout())
    }

    fn text(&self, json: bool) -> String {
        if json {
            return serde_json::to_string(self).expect("a struct of plain fields is always JSON");
        }
        let rows = [
            ("edits done", human_count(self.done)),
            ("edits undone", human_count(self.undone)),
            ("edits forgotten", human_count(self.forgotten as usize)),
            ("file", human_bytes(self.bytes)),
        ];
        let objects = self
            .field_sha256
            .iter()
            .map(|(name, hash)| ("object", format!("{name}  {hash}")));
        let changed = self.changed.iter();
        let corner = |p: &[f64; 3]| p.map(human_number).join(", ");
        let changed = changed.map(|(name, [min, max])| {
            let part = format!("{name}  between ({}) and ({})", corner(min), corner(max));
            ("would change", part)
        });
        table(rows.into_iter().chain(objects).chain(changed), &self.notes)
    }
}
