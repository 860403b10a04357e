use std::num::NonZeroUsize;
use std::path::PathBuf;

use bspline::HierarchicalSpline;
use document::State;
use fitting::Cancel;
use serde::{Deserialize, Serialize};
use tools::scene::Simulation;

use super::{Told, chosen, failure, open};
use crate::cli::failure::{Failure, Outcome};
use crate::cli::progress::Bar;
use crate::cli::quantity::threads;
use crate::cli::simulate;
use crate::cli::source::Source;
use crate::cli::{interrupt, set_threads};

/// Arguments of `isoclay sculpt`.
#[derive(clap::Args)]
pub struct Args {
    /// Document (.isoclay)
    document: PathBuf,
    /// Scene (.toml) to run, - reads standard input; docs/guide.md lists what it may say. Its field is not read
    #[arg(long, value_name = "SCENE")]
    script: PathBuf,
    /// Object to work on, where there are several
    #[arg(long, value_name = "NAME")]
    object: Option<String>,
    /// Threads to work with [default: all cores]
    #[arg(long, value_name = "N", value_parser = threads)]
    threads: Option<NonZeroUsize>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    pub json: bool,
}

/// What the journal keeps of a run: enough to do it again.
#[derive(Serialize, Deserialize)]
#[serde(tag = "tool", rename_all = "lowercase", deny_unknown_fields)]
pub enum Command {
    /// A scene, as it was written.
    Scene { object: String, script: String },
}

impl Command {
    /// Does it on a state.
    pub fn run(&self, state: &State, cancel: &Cancel, bar: &Bar) -> Outcome<State> {
        let Self::Scene { object: name, script } = self;
        let mut object = state.object(name).map_err(failure)?.clone();
        let scene = simulate::parsed(script).map_err(Failure::input)?;
        let iso = scene.iso.map(|i| i.0).or(object.meta.iso);
        object.field = played(&scene, object.field, iso, cancel, bar)?;
        state.with(name, object).map_err(failure)
    }
}

/// What a scene leaves of a field.
fn played(
    scene: &tools::scene::Scene,
    field: HierarchicalSpline<f32>,
    iso: Option<f64>,
    cancel: &Cancel,
    bar: &Bar,
) -> Outcome<HierarchicalSpline<f32>> {
    let mut simulation = Simulation::new(scene, field, iso).map_err(Failure::input)?;
    while !simulation.is_over() {
        interrupt::check(cancel)?;
        simulation.step().map_err(Failure::input)?;
        bar.show("simulating", simulation.progress());
    }
    simulation.baked().map_err(Failure::input)
}

/// Runs a scene on an object of a document; what it leaves is one edit.
pub fn run(args: &Args) -> Outcome {
    let cancel = interrupt::cancel();
    let script = Source::open(&args.script, Some("toml"), "scenes .toml", &cancel)?.under("--script");
    let text = simulate::text(&script)?;
    set_threads(args.threads)?;
    let mut notes = Vec::new();
    let mut document = open(&args.document, &mut notes)?;
    let name = chosen(document.state(), args.object.as_deref())?.to_string();
    let file = args.script.file_name().unwrap_or_default().to_string_lossy();
    let title = format!("{file} on {name}");
    let command = Command::Scene {
        object: name,
        script: text,
    };
    let bar = Bar::new();
    let next = command
        .run(document.state(), &cancel, &bar)
        .map_err(|e| e.about(script.name()))?;
    bar.clear();
    let value = serde_json::to_value(&command).expect("a scene is text");
    if !document.commit(&title, value, next).map_err(failure)? {
        notes.push("the scene changes nothing; no edit was made".into());
    }
    Told::of(&mut document, notes)?.print(args.json)
}
