//! What the journal's records hold, but for the changes' own bytes.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::change::ChangeHead;
use crate::layers::LayerHead;
use crate::{Object, Properties};

/// What kind of record it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub(crate) enum Kind {
    /// All objects, where the journal stands.
    Snapshot = 1,
    /// An edit. It takes the place of what could be done again.
    Edit = 2,
    /// Undone or done again, up to some edit.
    Move = 3,
}

impl Kind {
    pub fn from_code(code: u32) -> Option<Self> {
        [Self::Snapshot, Self::Edit, Self::Move]
            .into_iter()
            .find(|kind| *kind as u32 == code)
    }
}

/// Head of a snapshot; the fields follow.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SnapshotHead {
    /// Edits that were made before the file's first record.
    pub forgotten: u64,
    pub objects: Vec<ObjectHead>,
    /// SHA-256 of the state, hexadecimal.
    pub sha256: String,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ObjectHead {
    pub name: String,
    pub properties: Properties,
    pub bytes: u64,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub layers: Vec<LayerHead>,
}

/// Head of an edit; fields and differences follow.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct EditHead {
    pub info: EditInfo,
    /// What was asked for, such as a tool with its poses: enough to do it again.
    pub command: Value,
    pub changes: Vec<ChangeHead>,
}

/// What is told of an edit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EditInfo {
    /// What it did, in a few words.
    pub title: String,
    /// When it was made: seconds since 1970-01-01 UTC. Nothing depends on it.
    pub time: u64,
    /// Names the state after it: its SHA-256, hexadecimal.
    pub sha256: String,
}

/// Head of a move.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MoveHead {
    /// How many of the edits are done from now on.
    pub done: u64,
}

/// How many edits there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EditCounts {
    /// Edits that are done, and can be undone.
    pub done: usize,
    /// Edits that are undone, and can be done again.
    pub undone: usize,
    /// Edits before these, which can no longer be undone.
    pub forgotten: u64,
}

impl ObjectHead {
    pub fn new(name: &str, object: &Object, bytes: u64, layers: Vec<LayerHead>) -> Self {
        Self {
            name: name.into(),
            properties: object.properties.clone(),
            bytes,
            layers,
        }
    }
}

/// A digest as text.
pub(crate) fn hex(digest: [u8; 32]) -> String {
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}
