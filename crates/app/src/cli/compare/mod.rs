//! Other programs beside this one, on the same inputs.

mod peer;
mod row;
mod subject;

use std::ffi::{OsStr, OsString};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use fitting::Cancel;
use serde_json::{Map, Value};

use super::failure::Outcome;
use super::interrupt;
use super::output::Output;
use super::own;
use super::progress::Bar;
use super::python;
use super::quantity::{between, threads};
use super::source::scratch;
use peer::{Peer, Python};
use row::{Cost, Row};
use subject::{Kind, Subject};

/// Arguments of `isoclay compare`.
#[derive(clap::Args)]
pub struct Args {
    /// Meshes, whose vertices are fitted and whose triangles are the truth; clouds, with their own points as the truth; volumes
    #[arg(default_values = ["data/bunny.obj.gz", "data/head.nii.gz"])]
    inputs: Vec<PathBuf>,
    /// Options of `isoclay fit`, and after a | those of `isoclay mesh`; may be given several times [default: none; for volumes
    /// also '--method interpolate']
    #[arg(long, value_name = "OPTIONS", allow_hyphen_values = true)]
    ours: Vec<String>,
    /// Programs with their settings, as far as they are installed: PoissonRecon:DEPTH, SSDRecon:DEPTH, Open3D:DEPTH (Poisson),
    /// MeshLab:DEPTH (screened Poisson) and APSS:CELLS (also MeshLab's) for clouds; SciPy:interpolate and SciPy:VOXELS (least
    /// squares with a knot every so many voxels) for volumes
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "PoissonRecon:8,Open3D:8,MeshLab:8,APSS:128,SciPy:interpolate,SciPy:1.6"
    )]
    peers: Vec<Peer>,
    /// The Python that has Open3D, pymeshlab, SciPy and NumPy [default: python3]; PoissonRecon and SSDRecon are looked for in $POISSONRECON and
    /// on the PATH
    #[arg(long, value_name = "PROGRAM")]
    python: Option<PathBuf>,
    /// Runs of each, in turn with the others; medians are told
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = between::<u8>(1, 255))]
    runs: u8,
    /// Threads of each
    #[arg(long, value_name = "N", value_parser = threads, default_value = "1")]
    threads: NonZeroUsize,
    /// File for the table (.md), in place of standard output
    #[arg(short, long, value_name = "OUT")]
    pub output: Option<PathBuf>,
    /// Print one JSON object for each row instead of the table
    #[arg(long)]
    pub json: bool,
}

/// Who is measured.
enum Program {
    /// Options of `fit` and of `mesh`.
    Ours(String),
    /// Another one.
    Peer(Peer),
}

/// Runs all programs on all inputs and writes one table.
pub fn run(args: &Args) -> Outcome {
    let cancel = interrupt::cancel();
    let output = (args.output.as_ref())
        .map(|out| Output::check("-o", out, &["md"], None, &[]))
        .transpose()?;
    let scratch = scratch("the runs")?;
    let python = Python::new(python::chosen(args.python.as_deref())?, scratch.path())?;
    let subjects = (args.inputs.iter().enumerate())
        .map(|(n, input)| Subject::prepare(input, &scratch.path().join(n.to_string()), &cancel))
        .collect::<Outcome<Vec<_>>>()?;
    let (mut rows, mut notes) = (Vec::new(), Vec::new());
    for peer in &args.peers {
        if let Some(missing) = python.missing(peer) {
            notes.push(missing);
        }
    }
    for subject in &subjects {
        measure(args, subject, &python, &cancel, &mut rows, &mut notes)?;
    }
    notes.dedup();
    row::write(&rows, &notes, args.threads, args.runs, output.as_ref(), args.json)
}

/// Runs of one input. Each round runs every program once, so that a busy hour of the machine is nobody's alone.
fn measure(
    args: &Args,
    subject: &Subject,
    python: &Python,
    cancel: &Cancel,
    rows: &mut Vec<Row>,
    notes: &mut Vec<String>,
) -> Outcome {
    let usual: &[&str] = match subject.kind {
        Kind::Cloud => &[""],
        Kind::Volume => &["", "--method interpolate"],
    };
    let usual = usual.iter().map(|o| o.to_string()).collect();
    let ours = if args.ours.is_empty() { &usual } else { &args.ours };
    let peers = args
        .peers
        .iter()
        .filter(|p| p.takes(subject.kind) && python.has(p));
    let ours = ours.iter().cloned().map(Program::Ours);
    let mut programs: Vec<(Program, Vec<Cost>, Option<Row>)> = ours
        .chain(peers.cloned().map(Program::Peer))
        .map(|program| (program, Vec::new(), None))
        .collect();
    let bar = Bar::new();
    let total = usize::from(args.runs) * programs.len();
    for turn in 0..usize::from(args.runs) {
        let mut failed = Vec::new();
        for (n, (program, costs, row)) in programs.iter_mut().enumerate() {
            interrupt::check(cancel)?;
            bar.show(
                "comparing",
                (turn * (total / usize::from(args.runs)) + n) as f64 / total as f64,
            );
            let told = match program {
                Program::Ours(options) => ours_once(options, subject, args.threads)?,
                Program::Peer(peer) => match python.run(peer, subject, args.threads)? {
                    Ok(told) => told,
                    Err(why) => {
                        notes.push(format!("{peer} on {}: {why}", subject.name));
                        failed.push(n);
                        continue;
                    }
                },
            };
            costs.push(Cost::of(&told));
            if row.is_none() {
                let (name, setting) = match program {
                    Program::Ours(options) => ("isoclay".to_string(), options.trim().replace('|', "\\|")),
                    Program::Peer(peer) => (python.named(peer), peer.setting.clone()),
                };
                *row = Some(Row::new(subject, name, setting, &told)?);
            }
        }
        for n in failed.into_iter().rev() {
            programs.remove(n);
        }
    }
    bar.clear();
    rows.extend(
        programs
            .into_iter()
            .filter_map(|(_, costs, row)| Some(row?.with(Cost::median(costs)))),
    );
    Ok(())
}

/// `fit`, and of clouds `mesh`: whole processes, with reading and writing.
fn ours_once(given: &str, subject: &Subject, threads: NonZeroUsize) -> Outcome<Map<String, Value>> {
    let (fit, mesh) = given.split_once('|').unwrap_or((given, ""));
    let field = subject.directory.join("field.iclay");
    let once = |command: &str, from: &Path, to: &Path, options: &str| {
        let threads = threads.to_string();
        let fixed: [&OsStr; 5] = [
            from.as_ref(),
            "-o".as_ref(),
            to.as_ref(),
            "--threads".as_ref(),
            threads.as_ref(),
        ];
        let options = options.split_whitespace().map(OsStr::new);
        let told = own::ask(command, fixed.into_iter().chain(options).map(OsString::from));
        told.map_err(|why| match given.is_empty() {
            true => why.about(&subject.name),
            false => why.about(format!("--ours '{given}' on {}", subject.name)),
        })
    };
    let mut told = once("fit", &subject.fitted, &field, fit)?;
    if subject.kind == Kind::Cloud {
        let meshed = once("mesh", &field, &subject.result(), mesh)?;
        let figure =
            |told: &Map<String, Value>, key: &str| told.get(key).and_then(Value::as_f64).unwrap_or(0.0);
        for key in ["seconds", "cpu_seconds"] {
            told.insert(key.into(), (figure(&told, key) + figure(&meshed, key)).into());
        }
        let peak = f64::max(figure(&told, "peak_rss_bytes"), figure(&meshed, "peak_rss_bytes"));
        told.insert("peak_rss_bytes".into(), peak.into());
    }
    Ok(told)
}
