//! The `isoclay` program: scans in, solids out.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::main()
}
