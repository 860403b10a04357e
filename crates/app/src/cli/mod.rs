//! The command line: one file a subcommand.
//!
//! Exit codes: 0 done, 2 wrong usage, 3 bad input, 4 a limit was reached or the work was cancelled.

mod batch;
mod belongs;
pub mod ceiling;
mod chart_all;
mod chart_dynamics;
mod chart_edits;
mod chart_fields;
mod chart_haptics;
mod chart_masks;
mod chart_mesh;
mod chart_orient;
mod chart_output;
mod chart_tools;
#[cfg(feature = "window")]
mod chart_window;
mod charts;
mod check;
mod coarse;
mod compare;
pub mod convert;
pub mod cost;
#[cfg(feature = "window")]
pub mod desk_files;
mod devices;
mod document;
mod end;
mod eval;
mod failure;
mod field;
mod fineness;
mod fit;
mod fit_choice;
mod fitted;
mod flags;
mod info;
pub mod input;
pub mod interrupt;
mod keep;
mod mesh;
mod mesh_check;
pub mod mesh_output;
#[cfg(feature = "window")]
mod open;
mod output;
mod overwrite;
mod own;
mod phantom;
pub mod picture;
mod progress;
mod python;
pub mod quantity;
#[cfg(feature = "window")]
mod render;
mod sample;
mod simulate;
mod solves;
mod source;
pub mod staged;
mod store;
mod summary;
mod trim;
mod unoriented;
mod volume_choice;

use std::ffi::OsString;
use std::num::NonZeroUsize;
use std::path::Path;
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use failure::{Failure, OrFail, Outcome, error_object};
use quantity::Memory;

/// Turns scans into elastic clay: point clouds and volumes become implicit B-spline solids and watertight
/// meshes.
#[derive(Parser)]
#[command(name = "isoclay", version, max_term_width = 100, after_help = EXIT_CODES)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    /// Memory that the process may hold, such as 2GiB
    #[arg(long, global = true, value_name = "SIZE")]
    memory: Option<Memory>,
}

const EXIT_CODES: &str =
    "Exit codes: 0 done, 2 wrong usage, 3 bad input, 4 a limit was reached or the work was cancelled.";

#[derive(Subcommand)]
enum Command {
    /// Fit a field to a point cloud, a mesh or a volume
    Fit(fit::Args),
    /// Fit many clouds, meshes and volumes, each isolated from the others, and report on all
    Batch(batch::Args),
    /// Turn a field into a closed triangle mesh
    Mesh(mesh::Args),
    /// Write the field at the voxel centres of a volume
    Sample(sample::Args),
    /// Print value and gradient of the field at given points
    Eval(eval::Args),
    /// Describe a cloud, a mesh, a volume or a field
    Info(info::Args),
    /// Measure the errors of a field against its input again, and draw them
    Check(check::Args),
    /// Write a cloud, a mesh or a volume in another format
    Convert(convert::Args),
    /// Write a test object with a known shape, as cloud or volume
    Phantom(phantom::Args),
    /// Draw the solid into a PNG picture
    Picture(picture::Args),
    /// Draw the same picture on the graphics card, faster; without one the processor draws it
    #[cfg(feature = "window")]
    Render(render::Args),
    /// Move a region of a field by a scripted scene: forces, matter and constraints over time
    Simulate(simulate::Args),
    /// Make a document of fields, to be edited with a history
    New(document::new::Args),
    /// Edit an object of a document by a scene
    Sculpt(document::sculpt::Args),
    /// List the edits of a document
    History(document::history::Args),
    /// Undo the last edits of a document
    Undo(document::undo::Args),
    /// Do edits of a document again that were undone
    Redo(document::undo::Args),
    /// Do all edits of a document again and compare the result
    Replay(document::replay::Args),
    /// Write an object of a document as a field, or into the scan that it was fitted to
    Export(document::export::Args),
    /// Touch a document through a device, and work on it by hand
    Feel(document::feel::Args),
    /// List devices for touch, test one, or print the rules that let users open them
    Devices(devices::Args),
    /// Draw speed against accuracy
    Charts(charts::Args),
    /// Run other programs, as far as they are installed, on the same inputs, and write one table of time and error
    Compare(compare::Args),
    /// Open the window, with files in it, as isoclay alone does
    #[cfg(feature = "window")]
    Open(open::Args),
}

/// The tree of commands. Where a shared option means something else in one of them, its help says so there.
fn command() -> clap::Command {
    Cli::command().mut_subcommand("sample", |sample| {
        sample.mut_arg("spacing", |a| {
            a.help(
                "Voxels of this size in place of those of VOLUME, in mm (in the file's own unit if it tells none): the box \
                 stays the same and holds a whole number of them. One number, or three. With --shape: the spacing of \
                 that file in mm",
            )
        })
    })
}

/// Reads the command line, does what it says, and turns the outcome into an exit code.
pub fn main() -> ExitCode {
    ExitCode::from(obey(&std::env::args_os().collect::<Vec<_>>()))
}

/// Does what a command line says; the exit code.
fn obey(line: &[OsString]) -> u8 {
    own::follow();
    let cli = match command()
        .try_get_matches_from(line)
        .and_then(|m| Cli::from_arg_matches(&m))
    {
        Ok(cli) => cli,
        Err(e) => return refuse(&e, line),
    };
    let Some(asked) = cli.command.or_else(window) else {
        let missing = clap::error::ErrorKind::MissingSubcommand;
        let e = command().error(missing, "say what to do: isoclay --help lists the commands");
        return refuse(&e, line);
    };
    let (json, data_on_stdout) = asked.stdout();
    end::tell_as(json, data_on_stdout);
    if cli.memory.is_none() {
        crate::allocator::take_large_steps();
    }
    let ready = interrupt::listen().and_then(|()| cli.memory.map_or(Ok(()), ceiling::hold));
    let outcome = ready.and_then(|()| match &asked {
        Command::Fit(a) => fit::run(a),
        Command::Batch(a) => batch::run(a),
        Command::Mesh(a) => mesh::run(a),
        Command::Sample(a) => sample::run(a),
        Command::Eval(a) => eval::run(a),
        Command::Info(a) => info::run(a),
        Command::Check(a) => check::run(a),
        Command::Convert(a) => convert::run(a),
        Command::Phantom(a) => phantom::run(a),
        Command::Picture(a) => picture::run(a),
        #[cfg(feature = "window")]
        Command::Render(a) => render::run(a),
        Command::Simulate(a) => simulate::run(a),
        Command::New(a) => document::new::run(a),
        Command::Sculpt(a) => document::sculpt::run(a),
        Command::History(a) => document::history::run(a),
        Command::Undo(a) => document::undo::run(a, false),
        Command::Redo(a) => document::undo::run(a, true),
        Command::Replay(a) => document::replay::run(a),
        Command::Export(a) => document::export::run(a),
        Command::Feel(a) => document::feel::run(a),
        Command::Devices(a) => devices::run(a),
        Command::Charts(a) => charts::run(a),
        Command::Compare(a) => compare::run(a),
        #[cfg(feature = "window")]
        Command::Open(a) => open::run(a),
    });
    match outcome {
        Ok(()) => 0,
        Err(f) if f.is_broken_pipe() => 0,
        Err(f) => {
            end::tell(&f);
            f.code()
        }
    }
}

/// What isoclay alone does where there is a screen.
fn window() -> Option<Command> {
    #[cfg(feature = "window")]
    if ["DISPLAY", "WAYLAND_DISPLAY"]
        .iter()
        .any(|name| std::env::var_os(name).is_some())
    {
        return Some(Command::Open(open::Args::default()));
    }
    None
}

/// Prints what is wrong with the command line itself, or the help that was asked for.
fn refuse(e: &clap::Error, line: &[OsString]) -> u8 {
    // Help and version are no errors; a closed pipe is nobody's loss.
    let _ = e.print();
    let code = e.exit_code() as u8;
    let options = line.iter().skip(1).take_while(|a| *a != "--");
    let json = options.into_iter().any(|a| a == "--json");
    if code != 0 && json {
        let text = e.render().to_string();
        let (message, rest) = text.split_once("\n\n").unwrap_or((&text, ""));
        let message = message
            .trim_start_matches("error: ")
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ");
        let remedy = rest
            .lines()
            .map(str::trim)
            .find(|l| l.starts_with("tip:") || l.starts_with("Usage:"));
        end::print_quietly(&error_object(code, &message, remedy));
    }
    code
}

pub use ceiling::out_of_memory;

impl Command {
    /// Whether `--json` was given, and whether standard output is taken by data.
    fn stdout(&self) -> (bool, bool) {
        let is_stdout = |path: &Path| path == Path::new("-");
        match self {
            Self::Fit(a) => (a.json, is_stdout(&a.output)),
            Self::Batch(a) => (a.json, false),
            Self::Mesh(a) => (a.json, is_stdout(&a.output)),
            Self::Sample(a) => (a.json, is_stdout(&a.output)),
            Self::Eval(_) => (false, true),
            Self::Info(a) => (a.json, false),
            Self::Check(a) => (a.json, false),
            Self::Convert(a) => (a.json, is_stdout(&a.output)),
            Self::Phantom(a) => (a.json, is_stdout(&a.output)),
            Self::Picture(a) => (a.json, is_stdout(&a.output)),
            #[cfg(feature = "window")]
            Self::Render(a) => (a.picture.json, is_stdout(&a.picture.output)),
            Self::Simulate(a) => (a.json, is_stdout(&a.output)),
            Self::New(a) => (a.json, false),
            Self::Sculpt(a) => (a.json, a.preview.as_deref().is_some_and(is_stdout)),
            Self::History(a) => (a.json, a.script.as_deref().is_some_and(is_stdout)),
            Self::Undo(a) | Self::Redo(a) => (a.json, false),
            Self::Replay(a) => (a.json, false),
            Self::Export(a) => (a.json, is_stdout(&a.output)),
            Self::Feel(a) => (a.json, a.output.as_deref().is_some_and(is_stdout)),
            Self::Devices(a) => (a.json, false),
            Self::Charts(a) => (a.json(), false),
            Self::Compare(a) => (a.json, a.output.as_deref().is_some_and(is_stdout)),
            #[cfg(feature = "window")]
            Self::Open(_) => (false, false),
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
pub use own::ask as command_line;

#[cfg(test)]
#[path = "../../tests/suite/common/wrong_values.rs"]
#[allow(dead_code, reason = "the rows alone are looked at here")]
mod wrong_values;

#[cfg(test)]
mod tests {
    use super::wrong_values::ROWS;

    /// Leaves of the tree of commands under names such as `charts_fit`.
    fn leaves(command: &clap::Command, name: &str, found: &mut Vec<(String, clap::Command)>) {
        for sub in command.get_subcommands().filter(|s| s.get_name() != "help") {
            let name = if name.is_empty() {
                sub.get_name().to_string()
            } else {
                format!("{name}_{}", sub.get_name())
            };
            match sub.has_subcommands() {
                true => leaves(sub, &name, found),
                false => found.push((name, sub.clone())),
            }
        }
    }

    /// A new option needs a row in `tests/suite/common/wrong_values.rs`, which the test
    /// `a_wrong_value_is_named_with_its_option_and_its_remedy` types in.
    #[test]
    fn every_option_has_a_wrong_value_in_the_table() {
        let mut commands = Vec::new();
        let mut root = super::command();
        root.build();
        leaves(&root, "", &mut commands);
        assert!(commands.len() > 10);
        let mut missing = Vec::new();
        for (name, command) in &commands {
            // What clap itself looks for in debug builds alone: two arguments of one name, of which one is deaf.
            let mut ids: Vec<_> = command.get_arguments().map(|a| a.get_id().as_str()).collect();
            ids.sort_unstable();
            assert!(ids.windows(2).all(|w| w[0] != w[1]), "{name}: {ids:?}");
            for argument in command.get_arguments() {
                let option = match argument.get_long() {
                    Some("help" | "version") => continue,
                    Some(long) => format!("--{long}"),
                    None => argument.get_id().to_string(),
                };
                let has_row = ROWS.iter().any(|(commands, options, ..)| {
                    commands.split(' ').any(|c| c == name) && options.split(' ').any(|o| o == option)
                });
                if argument.get_action().takes_values() {
                    if !has_row {
                        missing.push(format!("{name} {option}"));
                    }
                    continue;
                }
                // A switch takes no value, and says so.
                let typed = name
                    .split('_')
                    .map(String::from)
                    .chain([format!("{option}=maybe")]);
                let refused = root
                    .clone()
                    .try_get_matches_from(["isoclay".into()].into_iter().chain(typed));
                let said = refused.unwrap_err().to_string();
                assert!(
                    said.contains(&option) && said.contains("maybe"),
                    "{name} {option}: {said}"
                );
            }
        }
        assert!(missing.is_empty(), "no wrong value for {missing:?}");
        for (rows, ..) in ROWS {
            for name in rows.split(' ') {
                assert!(commands.iter().any(|(c, _)| c == name), "{name} is no command");
            }
        }
    }

    #[test]
    fn command_line_is_consistent() {
        super::command().debug_assert();
    }
}
