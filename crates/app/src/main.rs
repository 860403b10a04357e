//! The `isoclay` program: scans in, solids out.

mod charts;
mod check;
mod cli;
mod picture;
mod pieces;
mod simulate;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::main()
}
