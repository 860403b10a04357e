use std::path::PathBuf;

use super::failure::{Failure, Outcome};

/// Arguments of `isoclay open`.
#[derive(clap::Args, Default)]
pub struct Args {
    /// Documents, fields or scans to begin with
    #[arg(value_name = "FILE")]
    files: Vec<PathBuf>,
}

/// Opens the window.
pub fn run(args: &Args) -> Outcome {
    crate::window::run(args.files.clone()).map_err(Failure::limit)
}
