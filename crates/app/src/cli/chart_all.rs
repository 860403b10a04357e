//! All charts of the documentation again.

use std::ffi::OsString;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::Command;

use fitting::Cancel;

use super::failure::{Failure, OrFail, Outcome};
use super::interrupt;
use super::own;
use super::progress::Bar;
use super::python;
use super::source::scratch;
use super::staged::StagedFiles;

/// Arguments of `isoclay charts all`.
#[derive(clap::Args)]
pub struct Args {
    /// Directory for the charts; made if missing
    #[arg(short, long, value_name = "DIR", default_value = "docs/charts")]
    output: PathBuf,
    /// The Python that has isoclay and matplotlib, for the chart of fits in blocks [default: python3]
    #[arg(long, value_name = "PROGRAM")]
    python: Option<PathBuf>,
}

/// The scan of which meshes are drawn; its field is fitted first.
const BUNNY: &str = "data/bunny.obj.gz";
/// Orientation of clouds that are too large to be carried along, as it was measured.
const ORIENTED: &str = "benches/peers/orientation.csv";
/// Measures fits in blocks, which only Python does.
const BLOCKS: &str = "crates/python/benches/blocks.py";

/// Draws them one after the other. One that fails does not stop the others.
pub fn run(args: &Args, cancel: &Cancel) -> Outcome {
    StagedFiles::new("-o", &args.output)?;
    let python = python::chosen(args.python.as_deref())?;
    for needed in [BUNNY, ORIENTED, BLOCKS] {
        if !Path::new(needed).is_file() {
            return Err(Failure::usage(format!(
                "{needed}: is not here; start in the folder of isoclay's sources"
            )));
        }
    }
    let scratch = scratch("the runs")?;
    let bunny = scratch.path().join("bunny.iclay");
    own::ask(
        "fit",
        [BUNNY.into(), "-o".into(), bunny.clone().into_os_string()].into_iter(),
    )?;
    let ours = |subject: &str, inputs: &[OsString]| -> Outcome<(String, Command)> {
        let mut command = own::program().or_limit()?;
        command
            .arg("charts")
            .arg(subject)
            .args(inputs)
            .arg("-o")
            .arg(&args.output);
        Ok((subject.to_string(), command))
    };
    let mut commands = vec![
        ours("fit", &[])?,
        ours("hard", &[])?,
        ours("mesh", &[bunny.into_os_string()])?,
        ours("orient", &["--measured".into(), ORIENTED.into()])?,
        ours("dynamics", &[])?,
        ours("masks", &[])?,
        ours("edits", &[])?,
        ours("fields", &[])?,
        ours("tools", &[])?,
        ours("haptics", &[])?,
    ];
    #[cfg(feature = "window")]
    commands.push(ours("window", &[])?);
    let mut blocks = Command::new(python);
    blocks
        .arg(BLOCKS)
        .arg("--chart")
        .arg(args.output.join("blocks.svg"));
    commands.push(("blocks".into(), blocks));

    let bar = Bar::new();
    let total = commands.len();
    let mut failed = Vec::new();
    for (n, (subject, command)) in commands.iter_mut().enumerate() {
        interrupt::check(cancel)?;
        bar.show("drawing", n as f64 / total as f64);
        let why = match own::output(command) {
            Ok(out) if out.status.success() => None,
            Ok(out) => Some(String::from_utf8_lossy(&out.stderr).trim().to_string()),
            Err(e) => Some(e.to_string()),
        };
        bar.clear();
        let told = why.as_deref().unwrap_or("drawn");
        writeln!(io::stdout().lock(), "{subject:<9}{told}").or_limit()?;
        if why.is_some() {
            failed.push(subject.as_str());
        }
    }
    match failed.is_empty() {
        true => Ok(()),
        false => Err(Failure::limit(format!(
            "charts not drawn: {}; see above",
            failed.join(", ")
        ))),
    }
}
