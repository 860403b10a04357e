use std::io::{self, Write};
use std::ops::ControlFlow;
use std::path::PathBuf;

use bspline::Frame;
use fitting::Cancel;

use super::cost::cpu_seconds;
use super::failure::{Failure, OrFail, Outcome};
use super::field::OpenField;
use super::fineness::failed;
use super::input::writing;
use super::progress::Bar;
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
    super::charts::make(&args.output)?;
    let mut out = io::stdout().lock();
    for path in &args.fields {
        let open = OpenField::load(path)?;
        let lattice = open.lattice();
        let subject = MeshSubject {
            field: open.field(),
            iso: open.iso_or(None, path)?,
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
        writeln!(out, "{}", MeshTrial::COLUMNS).or_limit()?;
        for trial in &trials {
            writeln!(out, "{}", trial.csv()).or_limit()?;
        }
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        for (suffix, against_time) in [("triangles", false), ("time", true)] {
            let svg = Chart::of_meshes(&name, against_time, &trials)
                .svg()
                .map_err(Failure::limit)?;
            let target = args.output.join(format!("mesh-{name}-{suffix}.svg"));
            formats::atomic::replace(&target, |out| out.write_all(svg.as_bytes())).map_err(writing)?;
            writeln!(out, "written  {}", target.display()).or_limit()?;
        }
    }
    Ok(())
}
