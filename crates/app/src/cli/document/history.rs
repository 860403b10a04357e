use std::path::PathBuf;

use serde_json::json;

use super::{Told, failure, open};
use crate::cli::failure::{Failure, Outcome};
use crate::cli::output::Output;
use crate::cli::summary;

/// Arguments of `isoclay history`.
#[derive(clap::Args)]
pub struct Args {
    /// Document (.isoclay)
    document: PathBuf,
    /// Write what was asked for by the edits that are done, for sculpt to do again (.jsonl)
    #[arg(long, value_name = "OUT")]
    pub script: Option<PathBuf>,
    /// Print one JSON object for each edit, with what was asked for, and one at the end
    #[arg(long)]
    pub json: bool,
}

/// Lists the edits of a document, the oldest first, or writes those that are done as a script.
pub fn run(args: &Args) -> Outcome {
    let script = args.script.as_ref();
    let script = script.map(|path| Output::check("--script", path, &["jsonl"], None, &[]));
    let script = script.transpose()?;
    let mut notes = Vec::new();
    let mut document = open(&args.document, &mut notes)?;
    let edits = document.history().map_err(failure)?;
    let counts = document.counts().map_err(failure)?;
    if let Some(output) = &script {
        let text = document.script().map_err(failure)?;
        formats::atomic::replace(output.path(), |out| out.write_all(text.as_bytes()))
            .map_err(|e| Failure::limit(format!("{}: {e}", output.name())))?;
        notes.push(match counts.forgotten {
            0 => format!("{} edits are written; they begin on the objects as they were put in", counts.done),
            forgotten => format!(
                "{} edits are written; {forgotten} before them are forgotten, so they begin on the objects as these left them",
                counts.done
            ),
        });
        return Told::of(&mut document, notes)?.print_after(output, args.json);
    }
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
