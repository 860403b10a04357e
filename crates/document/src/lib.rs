//! Documents: objects that are edited, and a journal from which nothing is lost.
//!
//! A [`Document`] is one file. It begins with a snapshot of all objects; every edit is appended as the difference that it
//! made, and is on the disk before it shows. So the file is the undo history, the crash journal and the record of where a
//! result comes from, in one. Opening reads the nearest snapshot and the differences after it; nothing is computed again.
//! `docs/document.md` has the format.
//!
//! A [`State`] is a value: cheap to copy, and copies share all that is equal. An edit makes a new one;
//! [`Document::commit`] finds out what differs. A [`Command`] is what was asked for; the journal keeps it beside the edit.
//! A [`Live`] stroke is made step by step, by a hand, and becomes a command at its end. A [`Preview`] shows what a command
//! would leave before it is made.

mod body;
mod bulk;
mod canvas;
mod change;
mod command;
mod document;
mod entry;
mod error;
mod family;
mod fineness;
mod journal;
mod layers;
mod layout;
mod live;
mod object;
mod preview;
mod records;
mod report;
mod revision;
mod samples;
mod state;
mod words;

pub use change::Change;
pub use command::{Command, CommandError};
pub use document::{Document, Lost, Opened, Options};
pub use entry::{EditCounts, EditInfo};
pub use error::DocumentError;
pub use fineness::{Fineness, Meshed, Surface, SurfaceError, is_of_mesh};
pub use journal::is_document;
pub use live::Live;
pub use object::{Object, Properties};
pub use preview::Preview;
pub use report::{Solve, read_report, with_report};
pub use revision::{
    CloudError, Course, Journey, VolumeRevision, WriteBackError, revise_cloud, revise_volume,
};
pub use samples::Samples;
pub use state::State;
pub use words::{human_count, human_number};
