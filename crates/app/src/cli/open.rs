use std::path::PathBuf;

use super::failure::{Failure, Outcome};

/// Arguments of `isoclay open`.
#[derive(clap::Args, Default)]
pub struct Args {
    /// Documents, fields or scans to begin with
    #[arg(value_name = "FILE")]
    files: Vec<PathBuf>,
}

/// Opens the window; not if a file is missing, which whoever typed its name wants to know here.
pub fn run(args: &Args) -> Outcome {
    for file in &args.files {
        let found = file.metadata();
        found.map_err(|e| Failure::input(format!("{}: {e}; check the path", file.display())))?;
    }
    crate::window::run(args.files.clone()).map_err(Failure::limit)
}
