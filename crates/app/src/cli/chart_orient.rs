use std::io::{self, Write};
use std::path::{Path, PathBuf};

use fitting::orient::{OrientOptions, Route, orient_points};
use fitting::{Cancel, Control};
use formats::ReadLimits;
use glam::DVec3;

use super::cost::cpu_seconds;
use super::failure::{Failure, OrFail, Outcome};
use super::interrupt;
use super::source::{POINTS, Source};
use super::staged::StagedFiles;
use crate::charts::{Chart, Oriented};

/// Arguments of `isoclay charts orient`.
#[derive(clap::Args)]
pub struct Args {
    /// Clouds with their true normals, of which only the positions are used; a zero normal is that of an outlier
    inputs: Vec<PathBuf>,
    /// What was measured before, as this command and benches/peers/orientation.py print it, to be drawn too
    #[arg(long, value_name = "CSV", required_unless_present = "inputs")]
    measured: Vec<PathBuf>,
    /// Directory for the chart orient.svg; made if missing
    #[arg(short, long, value_name = "DIR", default_value = "docs/charts")]
    output: PathBuf,
}

/// Orients every cloud on both routes, prints a line of CSV each, and draws them and what was measured before.
pub fn run(args: &Args, cancel: &Cancel) -> Outcome {
    let mut staged = StagedFiles::new("-o", &args.output)?;
    let mut runs = Vec::new();
    if !args.inputs.is_empty() {
        writeln!(io::stdout().lock(), "{}", Oriented::COLUMNS).or_limit()?;
    }
    for route in Route::ALL {
        for path in &args.inputs {
            interrupt::check(cancel)?;
            let run = measure(path, route, cancel)?;
            writeln!(io::stdout().lock(), "{}", run.csv()).or_limit()?;
            runs.push(run);
        }
    }
    for path in &args.measured {
        let bad = |e: String| Failure::input(format!("--measured {}: {e}", path.display()));
        let text = std::fs::read_to_string(path).map_err(|e| bad(format!("{e}; check the path")))?;
        runs.extend(Oriented::read_csv(&text).map_err(bad)?);
    }
    let svg = Chart::of_orientation(&runs).svg().map_err(Failure::limit)?;
    staged.write_text("orient.svg", &svg)?;
    staged.publish().map(drop)
}

fn measure(path: &Path, route: Route, cancel: &Cancel) -> Outcome<Oriented> {
    let source = Source::open(path, None, POINTS, cancel)?;
    let cloud = formats::points::read(path, &ReadLimits::default()).map_err(|e| source.reading(e))?;
    let Some(truth) = &cloud.normals else {
        return Err(Failure::input(format!(
            "{}: has no normals to compare with; give a cloud with true ones",
            path.display()
        )));
    };
    let mut control = Control {
        cancel: cancel.clone(),
        ..Control::default()
    };
    let before = cpu_seconds();
    let found = orient_points(&cloud.positions, &OrientOptions { route }, &mut control)?;
    let cpu_seconds = cpu_seconds() - before;
    let known = || truth.iter().zip(&found.normals).filter(|p| *p.0 != DVec3::ZERO);
    Ok(Oriented {
        cloud: path
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned(),
        method: route.name().into(),
        points: known().count(),
        wrong: known().filter(|(t, n)| t.dot(**n) <= 0.0).count(),
        cpu_seconds,
    })
}
