//! The command line: one file a subcommand.
//!
//! Exit codes: 0 done, 2 wrong usage, 3 bad input, 4 a limit was reached or the work was cancelled.

mod chart_dynamics;
mod chart_orient;
mod charts;
mod check;
mod convert;
mod cost;
mod eval;
mod failure;
mod field;
mod fit;
mod flags;
mod info;
mod input;
mod interrupt;
mod mesh;
mod phantom;
mod picture;
mod progress;
mod quantity;
mod sample;
mod simulate;
mod summary;
mod trim;
mod unoriented;
mod volume_choice;

use std::num::NonZeroUsize;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use failure::{Failure, OrFail, Outcome};

/// Turns scans into elastic clay: point clouds and volumes become implicit B-spline solids and watertight
/// meshes.
#[derive(Parser)]
#[command(name = "isoclay", version, max_term_width = 100, after_help = EXIT_CODES)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

const EXIT_CODES: &str =
    "Exit codes: 0 done, 2 wrong usage, 3 bad input, 4 a limit was reached or the work was cancelled.";

#[derive(Subcommand)]
enum Command {
    /// Fit a field to a point cloud with normals or to a volume
    Fit(fit::Args),
    /// Turn a field into a closed triangle mesh
    Mesh(mesh::Args),
    /// Write the field at the voxel centres of a volume
    Sample(sample::Args),
    /// Print value and gradient of the field at given points
    Eval(eval::Args),
    /// Describe a cloud, a volume or a field
    Info(info::Args),
    /// Measure the errors of a field against its input again, and draw them
    Check(check::Args),
    /// Write a cloud, a mesh or a volume in another format
    Convert(convert::Args),
    /// Write a test object with a known shape, as cloud or volume
    Phantom(phantom::Args),
    /// Draw the solid into a PNG picture
    Picture(picture::Args),
    /// Move a region of a field by a scripted scene: forces, matter and constraints over time
    Simulate(simulate::Args),
    /// Draw speed against accuracy
    Charts(charts::Args),
}

/// Reads the command line, does what it says, and turns the outcome into an exit code.
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(e) => {
            // Help and version are no errors; a closed pipe is nobody's loss.
            let _ = e.print();
            return ExitCode::from(e.exit_code() as u8);
        }
    };
    let outcome = match &cli.command {
        Command::Fit(a) => fit::run(a),
        Command::Mesh(a) => mesh::run(a),
        Command::Sample(a) => sample::run(a),
        Command::Eval(a) => eval::run(a),
        Command::Info(a) => info::run(a),
        Command::Check(a) => check::run(a),
        Command::Convert(a) => convert::run(a),
        Command::Phantom(a) => phantom::run(a),
        Command::Picture(a) => picture::run(a),
        Command::Simulate(a) => simulate::run(a),
        Command::Charts(a) => charts::run(a),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(f) if f.is_broken_pipe() => ExitCode::SUCCESS,
        Err(f) => {
            eprintln!("isoclay: {f}");
            ExitCode::from(f.code())
        }
    }
}

/// Gives the thread pool its size; without a wish, one thread a core.
fn set_threads(threads: Option<NonZeroUsize>) -> Outcome<usize> {
    if let Some(n) = threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(n.get())
            .build_global()
            .map_err(|e| anyhow::anyhow!("cannot start {n} threads ({e}); lower --threads"))
            .or_limit()?;
    }
    Ok(rayon::current_num_threads())
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    #[test]
    fn command_line_is_consistent() {
        super::Cli::command().debug_assert();
    }
}
