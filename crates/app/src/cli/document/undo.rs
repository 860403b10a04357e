use std::num::NonZeroUsize;
use std::path::PathBuf;

use super::{Told, failure, open_to_change};
use crate::cli::failure::Outcome;
use crate::cli::quantity::count;

/// Arguments of `isoclay undo` and `isoclay redo`.
#[derive(clap::Args)]
pub struct Args {
    /// Document (.isoclay)
    document: PathBuf,
    /// How many edits
    #[arg(default_value = "1", value_parser = count)]
    steps: NonZeroUsize,
    /// Print one JSON object instead of a table
    #[arg(long)]
    pub json: bool,
}

/// Undoes the last edits, or does again what was undone.
pub fn run(args: &Args, again: bool) -> Outcome {
    let mut notes = Vec::new();
    let mut document = open_to_change(&args.document, &mut notes)?;
    let asked = args.steps.get();
    let done = match again {
        true => document.redo(asked),
        false => document.undo(asked),
    };
    let done = done.map_err(failure)?;
    if done < asked {
        let what = if again { "done again" } else { "undone" };
        notes.push(format!(
            "{done} of {asked} edits could be {what}: there were no more"
        ));
    }
    Told::of(&mut document, notes)?.print(args.json)
}
