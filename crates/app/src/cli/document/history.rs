use std::path::PathBuf;

use serde_json::json;

use super::{Told, failure, open};
use crate::cli::failure::Outcome;
use crate::cli::summary;

/// Arguments of `isoclay history`.
#[derive(clap::Args)]
pub struct Args {
    /// Document (.isoclay)
    document: PathBuf,
    /// Print one JSON object for each edit, with what was asked for, and one at the end
    #[arg(long)]
    pub json: bool,
}

/// Lists the edits of a document, the oldest first.
pub fn run(args: &Args) -> Outcome {
    let mut notes = Vec::new();
    let mut document = open(&args.document, &mut notes)?;
    let edits = document.history().map_err(failure)?;
    let counts = document.counts().map_err(failure)?;
    for (n, edit) in edits.iter().enumerate() {
        let (number, is_done) = (counts.forgotten + n as u64 + 1, n < counts.done);
        let line = if args.json {
            let command = document.command(n).map_err(failure)?;
            json!({
                "edit": number, "title": edit.title, "done": is_done, "time": edit.time, "command": command,
                "state_sha256": edit.sha256,
            })
            .to_string()
        } else {
            let mark = if is_done { "" } else { "  (undone)" };
            format!("{number:>6}  {}  {}{mark}", &edit.sha256[..12], edit.title)
        };
        summary::print(&line, false)?;
    }
    Told::of(&mut document, notes)?.print(args.json)
}
