//! States and edits as records of the journal, and back.

use std::path::Path;

use formats::ReadLimits;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::body;
use crate::bulk::{Bulk, put};
use crate::entry::{EditHead, ObjectHead, SnapshotHead, hex};
use crate::error::{damaged, fault};
use crate::journal::{Journal, Parts, Record};
use crate::layers;
use crate::{Change, DocumentError, State};

/// All objects as a record.
pub(crate) fn snapshot(path: &Path, state: &State, forgotten: u64) -> Result<Parts, DocumentError> {
    let mut bulk = Vec::new();
    let mut objects = Vec::new();
    for (name, object) in state.objects() {
        let bytes = body::encode(&object.field, &object.meta).map_err(|f| fault(path, f))?;
        let count = put(bytes, &mut bulk);
        let layers = layers::write(&object.layers, &object.field.lattice(), path, &mut bulk)?;
        objects.push(ObjectHead::new(name, object, count, layers));
    }
    let sha256 = hex(state.sha256());
    Ok(Parts {
        text: json(&SnapshotHead {
            forgotten,
            objects,
            sha256,
        }),
        bulk,
    })
}

/// The objects of a snapshot.
pub(crate) fn restored(
    journal: &mut Journal,
    record: &Record,
    limits: &ReadLimits,
) -> Result<State, DocumentError> {
    let parts = journal.read(record)?;
    let path = journal.path();
    let head: SnapshotHead = from_json(path, &parts.text)?;
    let mut bulk = Bulk {
        rest: &parts.bulk,
        path,
        limits,
    };
    let mut state = State::new();
    for object in head.objects {
        let bare = bulk.object(object.bytes, &object.properties)?;
        state.set(&object.name, Some(layers::read(bare, &object.layers, &mut bulk)?));
    }
    checked(path, state, &head.sha256)
}

/// The state that an edit leads to from another, forth or back.
pub(crate) fn followed(
    journal: &mut Journal,
    edit: &Record,
    from: &State,
    forth: bool,
    limits: &ReadLimits,
) -> Result<State, DocumentError> {
    let parts = journal.read(edit)?;
    let path = journal.path();
    let head: EditHead = from_json(path, &parts.text)?;
    let mut bulk = Bulk {
        rest: &parts.bulk,
        path,
        limits,
    };
    let changes = head
        .changes
        .iter()
        .map(|change| Change::read(change, &mut bulk, from));
    let mut changes: Vec<Change> = changes.collect::<Result<_, _>>()?;
    if !forth {
        changes = changes.iter().rev().map(Change::reversed).collect();
    }
    let mut state = from.clone();
    for change in &changes {
        change.apply(&mut state).map_err(|why| damaged(path, why))?;
    }
    match forth {
        true => checked(path, state, &head.info.sha256),
        false => Ok(state),
    }
}

/// A state that is what it says it is.
fn checked(path: &Path, state: State, sha256: &str) -> Result<State, DocumentError> {
    state.check_all().map_err(|e| damaged(path, e.to_string()))?;
    match hex(state.sha256()) == sha256 {
        true => Ok(state),
        false => Err(damaged(
            path,
            "a state does not have the hash that was stored with it",
        )),
    }
}

pub(crate) fn json(head: &impl Serialize) -> Vec<u8> {
    serde_json::to_vec(head).expect("heads are plain values with text for keys")
}

fn from_json<T: DeserializeOwned>(path: &Path, text: &[u8]) -> Result<T, DocumentError> {
    serde_json::from_slice(text).map_err(|e| damaged(path, format!("a record cannot be understood ({e})")))
}

pub(crate) fn read_text<T: DeserializeOwned>(
    journal: &mut Journal,
    record: &Record,
) -> Result<T, DocumentError> {
    let text = journal.text(record)?;
    from_json(journal.path(), &text)
}
