use std::num::NonZeroUsize;
use std::path::PathBuf;

use document::Command;

use super::{Told, failure, open};
use crate::cli::failure::{Failure, Outcome};
use crate::cli::progress::Bar;
use crate::cli::quantity::threads;
use crate::cli::summary::hex;
use crate::cli::{interrupt, set_threads};

/// Arguments of `isoclay replay`.
#[derive(clap::Args)]
pub struct Args {
    /// Document (.isoclay); stays as it is
    document: PathBuf,
    /// Threads to work with [default: all cores]
    #[arg(long, value_name = "N", value_parser = threads)]
    threads: Option<NonZeroUsize>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    pub json: bool,
}

/// Does all edits of a document again, from its first state, and compares what comes out to the bit.
pub fn run(args: &Args) -> Outcome {
    let cancel = interrupt::cancel();
    set_threads(args.threads)?;
    let mut notes = Vec::new();
    let mut document = open(&args.document, &mut notes)?;
    let history = document.history().map_err(failure)?;
    let counts = document.counts().map_err(failure)?;
    let mut state = document.first_state().map_err(failure)?;
    let bar = Bar::new();
    let mut control = bar.control(&cancel);
    for (n, edit) in history.iter().enumerate().take(counts.done) {
        let number = counts.forgotten + n as u64 + 1;
        let about = |f: Failure| f.about(format!("edit {number} ({})", edit.title));
        let value = document.command(n).map_err(failure)?;
        let command: Command = serde_json::from_value(value)
            .map_err(|e| about(Failure::input(format!("cannot be done again ({e})"))))?;
        let (next, told) = command.apply(&state, &mut control).map_err(|e| about(e.into()))?;
        state = next;
        notes.extend(told.into_iter().map(|note| format!("edit {number}: {note}")));
        let found = hex(&state.sha256());
        if found != edit.sha256 {
            bar.clear();
            return Err(about(Failure::input(format!(
                "gives {found} when it is done again, {} is stored; was it made by another version of the program?",
                edit.sha256
            ))));
        }
    }
    bar.clear();
    notes.push(format!("edits done again with the same bits: {}", counts.done));
    Told::of(&mut document, notes)?.print(args.json)
}
