use std::io::{self, Write};
use std::ops::ControlFlow;
use std::path::PathBuf;

use bspline::Frame;
use fitting::Cancel;

use super::cost::cpu_seconds;
use super::failure::{Failure, OrFail, Outcome};
use super::field::OpenField;
use super::fineness::failed;
use super::progress::Bar;
use super::source::{FIELDS, Source};
use super::staged::{StagedFiles, publish};
use crate::charts::{Chart, MeshSubject, MeshTrial};

/// Arguments of `isoclay charts mesh`.
#[derive(clap::Args)]
pub struct Args {
    /// Fields to mesh (.iclay)
    #[arg(required = true)]
    fields: Vec<PathBuf>,
    /// Directory for the charts mesh-NAME-triangles.svg and mesh-NAME-time.svg; made if missing
    #[arg(short, long, value_name = "DIR", default_value = "docs/charts")]
    output: PathBuf,
}

/// Meshes every field in every way, prints a line of CSV each, and draws them.
pub fn run(args: &Args, cancel: &Cancel) -> Outcome {
    for path in &args.fields {
        let source = Source::open(path, None, FIELDS, cancel)?;
        let open = OpenField::load(&source)?;
        let lattice = open.lattice();
        let subject = MeshSubject {
            field: open.field(),
            iso: open.iso_or(None, &source)?,
            frame: Frame {
                world_from_grid: lattice.world_from_lattice,
                cells: lattice.cells,
            },
            finest: open.level_count() - 1,
            frame_of: &|n| open.frame_of_resolution(n),
            clock: cpu_seconds,
        };
        let bar = Bar::new();
        let trials = subject.trials(|fraction| {
            bar.show("meshing", fraction);
            if cancel.is_cancelled() {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        bar.clear();
        let trials = trials.map_err(failed)?;
        writeln!(io::stdout().lock(), "{}", MeshTrial::COLUMNS).or_limit()?;
        for trial in &trials {
            writeln!(io::stdout().lock(), "{}", trial.csv()).or_limit()?;
        }
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        let mut staged = StagedFiles::new("-o", &args.output)?;
        for (suffix, against_time) in [("triangles", false), ("time", true)] {
            let svg = Chart::of_meshes(&name, against_time, &trials)
                .svg()
                .map_err(Failure::limit)?;
            staged.write_text(&format!("mesh-{name}-{suffix}.svg"), &svg)?;
        }
        publish(staged, false)?;
    }
    Ok(())
}
