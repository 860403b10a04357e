use std::path::PathBuf;

use super::{chosen, edited_meta, open};
use crate::cli::cost::Cost;
use crate::cli::failure::Outcome;
use crate::cli::field;
use crate::cli::output::Output;
use crate::cli::summary::Summary;

/// Arguments of `isoclay export`.
#[derive(clap::Args)]
pub struct Args {
    /// Document (.isoclay)
    document: PathBuf,
    /// Field to write (.iclay), for mesh, picture, sample and the others; - writes to standard output
    #[arg(short, long, value_name = "OUT")]
    pub output: PathBuf,
    /// Object to write, where there are several
    #[arg(long, value_name = "NAME")]
    object: Option<String>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    pub json: bool,
}

/// Writes an object's field as it is now, in the object's own place.
pub fn run(args: &Args) -> Outcome {
    let cost = Cost::start();
    let output = Output::check("-o", &args.output, &["iclay"], None, &[])?;
    let mut notes = Vec::new();
    let document = open(&args.document, &mut notes)?;
    let state = document.state();
    let name = chosen(state, args.object.as_deref())?;
    let object = &state.objects()[name];
    let sha256 = field::save_as(&output, &object.field, &edited_meta(object))?;
    let summary = Summary {
        coefficients: Some(object.field.coefficient_count()),
        field_sha256: Some(sha256),
        notes,
        ..Summary::default()
    };
    summary.with_cost(&cost).print_after(&output, args.json)
}
