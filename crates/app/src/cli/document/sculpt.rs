use std::num::NonZeroUsize;
use std::path::PathBuf;

use document::Command;
use fitting::Control;

use super::{Told, chosen, edited_meta, failure, open, open_to_change};
use crate::cli::failure::{Failure, Outcome};
use crate::cli::output::Output;
use crate::cli::progress::Bar;
use crate::cli::quantity::threads;
use crate::cli::simulate;
use crate::cli::source::Source;
use crate::cli::{field, interrupt, set_threads};

/// Arguments of `isoclay sculpt`.
#[derive(clap::Args)]
pub struct Args {
    /// Document (.isoclay)
    document: PathBuf,
    /// Session of strokes, or scene, (.toml); - reads standard input. docs/guide.md lists what they may say
    #[arg(long, value_name = "SCRIPT")]
    script: PathBuf,
    /// Object to work on, where there are several and the script names none
    #[arg(long, value_name = "NAME")]
    object: Option<String>,
    /// Write what the script would leave of its object as a field (.iclay), and leave the document as it is
    #[arg(long, value_name = "OUT")]
    pub preview: Option<PathBuf>,
    /// Threads to work with [default: all cores]
    #[arg(long, value_name = "N", value_parser = threads)]
    threads: Option<NonZeroUsize>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    pub json: bool,
}

/// Runs a script on a document: a scene is one edit, of a session every stroke. A preview is no edit.
pub fn run(args: &Args) -> Outcome {
    let cancel = interrupt::cancel();
    let script = Source::open(&args.script, Some("toml"), "scripts .toml", &cancel)?.under("--script");
    let text = simulate::text(&script)?;
    set_threads(args.threads)?;
    let preview = args.preview.as_ref();
    let preview = preview.map(|path| Output::check("--preview", path, &["iclay"], None, &[&script]));
    let preview = preview.transpose()?;
    let mut notes = Vec::new();
    let opened = if preview.is_some() { open } else { open_to_change };
    let mut document = opened(&args.document, &mut notes)?;
    let file = args.script.file_name().unwrap_or_default().to_string_lossy();
    let about = |e: Failure| e.about(script.name());
    let named = |own: Option<&str>| {
        let named = own.or(args.object.as_deref());
        chosen(document.state(), named).map(String::from)
    };
    let commands = Command::of_script(&text, named).map_err(about)?;
    let bar = Bar::new();
    let mut control = bar.control(&cancel);
    let mut shown = document.state().clone();
    let mut is_changed = false;
    for (n, command) in commands.iter().enumerate() {
        let title = format!("{} ({file})", command.title());
        let (next, told) = command.apply(&shown, &mut control).map_err(|e| {
            let e = Failure::from(e).about(&title);
            about(match is_changed {
                true => e.about(format!(
                    "stroke {} of {} (those before it are done, undo takes them back)",
                    n + 1,
                    commands.len()
                )),
                false => e,
            })
        })?;
        notes.extend(told.into_iter().map(|note| format!("{title}: {note}")));
        shown = next;
        if preview.is_some() {
            continue;
        }
        let is_edit = document
            .commit(&title, command.to_value(), shown.clone())
            .map_err(failure)?;
        is_changed |= is_edit;
        if !is_edit {
            notes.push(format!("{title}: changes nothing; no edit was made"));
        }
    }
    bar.clear();
    let mut told = Told::of(&mut document, notes)?;
    if let (Some(output), Some(last)) = (&preview, commands.last()) {
        let object = shown.object(last.object()).map_err(failure)?;
        let (levels, note) = object.in_levels(last.object(), &mut Control::default())?;
        field::save_as(output, &levels, &edited_meta(object))?;
        told.notes.extend(note);
        told.show(document.state(), &shown);
        return told.print_after(output, args.json);
    }
    told.print(args.json)
}
