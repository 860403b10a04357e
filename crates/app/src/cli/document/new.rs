use std::path::PathBuf;

use document::{Document, Object, State};
use fitting::Cancel;
use formats::field::AnyField;

use super::{Told, failure, options};
use crate::cli::failure::{Failure, Outcome};
use crate::cli::field::OpenField;
use crate::cli::source::{FIELDS, Source};

/// Arguments of `isoclay new`.
#[derive(clap::Args)]
pub struct Args {
    /// Document to make (.isoclay)
    document: PathBuf,
    /// Fields (.iclay) that become its objects, under the names of their files
    #[arg(required = true, value_name = "FIELD")]
    fields: Vec<PathBuf>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    pub json: bool,
}

/// Makes a document of fields.
pub fn run(args: &Args) -> Outcome {
    let mut state = State::new();
    let mut notes = Vec::new();
    for path in &args.fields {
        let source = Source::open(path, None, FIELDS, &Cancel::new())?;
        let open = OpenField::load(&source)?;
        let name = path
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        if state.objects().contains_key(&name) {
            return Err(Failure::usage(format!(
                "{}: another field has the name {name:?} already; rename one of the files",
                source.name()
            )));
        }
        let loaded = open.loaded();
        if matches!(loaded.field, AnyField::F64(_)) {
            notes.push(format!(
                "{name}: documents hold single precision; the field was rounded to it"
            ));
        }
        let object = Object::new(&loaded.field, loaded.meta.clone())
            .map_err(|e| Failure::input(format!("{}: {e}", source.name())))?;
        state = state.with(&name, object).map_err(failure)?;
    }
    let mut document = Document::create(&args.document, state, options()).map_err(failure)?;
    Told::of(&mut document, notes)?.print(args.json)
}
