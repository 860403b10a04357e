use std::num::NonZeroUsize;
use std::path::PathBuf;

use bspline::HierarchicalSpline;
use document::State;
use fitting::{Cancel, Control};
use serde::{Deserialize, Serialize};
use tools::geometric::Operation;
use tools::scene::Simulation;
use tools::session::{Session, Stroke};

use super::{Told, chosen, failure, open};
use crate::cli::failure::{Failure, Outcome};
use crate::cli::progress::Bar;
use crate::cli::quantity::{human_count, threads};
use crate::cli::simulate;
use crate::cli::source::Source;
use crate::cli::{interrupt, set_threads};

/// Arguments of `isoclay sculpt`.
#[derive(clap::Args)]
pub struct Args {
    /// Document (.isoclay)
    document: PathBuf,
    /// Session of strokes, or scene, (.toml); - reads standard input. docs/guide.md lists what they may say
    #[arg(long, value_name = "SCRIPT")]
    script: PathBuf,
    /// Object to work on, where there are several and the script names none
    #[arg(long, value_name = "NAME")]
    object: Option<String>,
    /// Threads to work with [default: all cores]
    #[arg(long, value_name = "N", value_parser = threads)]
    threads: Option<NonZeroUsize>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    pub json: bool,
}

/// What the journal keeps of an edit: enough to do it again.
#[derive(Serialize, Deserialize)]
#[serde(tag = "tool", rename_all = "lowercase", deny_unknown_fields)]
pub enum Command {
    /// A scene, as it was written.
    Scene { object: String, script: String },
    /// One stroke of a session.
    Stroke { object: String, stroke: Box<Stroke> },
}

impl Command {
    /// What a script asks for, in its order, each with a title.
    fn of_script(
        text: &str,
        file: &str,
        chosen: impl Fn(Option<&str>) -> Outcome<String>,
    ) -> Outcome<Vec<(String, Self)>> {
        let wrong = |e: toml::de::Error| Failure::input(e.to_string().trim_end());
        if !toml::from_str::<toml::Table>(text)
            .map_err(wrong)?
            .contains_key("stroke")
        {
            let object = chosen(None)?;
            let script = text.to_string();
            return Ok(vec![(
                format!("{file} on {object}"),
                Self::Scene { object, script },
            )]);
        }
        let session: Session = toml::from_str(text).map_err(wrong)?;
        let strokes = session.stroke.into_iter().enumerate();
        let commands = strokes.map(|(n, stroke)| {
            let number = n + 1;
            let (operation, _) = stroke
                .tool()
                .map_err(|why| Failure::input(format!("stroke {number}: {why}")))?;
            let object = chosen(stroke.object.as_deref())?;
            let verb = match operation {
                Operation::Carve => "carve",
                Operation::Add => "add to",
            };
            Ok((
                format!("{verb} {object}: stroke {number} of {file}"),
                Self::Stroke {
                    object,
                    stroke: Box::new(stroke),
                },
            ))
        });
        commands.collect()
    }

    /// Does it on a state; what is left to say goes to the notes.
    pub fn run(&self, state: &State, cancel: &Cancel, bar: &Bar, notes: &mut Vec<String>) -> Outcome<State> {
        let (Self::Scene { object: name, .. } | Self::Stroke { object: name, .. }) = self;
        let mut object = state.object(name).map_err(failure)?.clone();
        object.field = match self {
            Self::Scene { script, .. } => {
                let scene = simulate::parsed(script).map_err(Failure::input)?;
                let iso = scene.iso.map(|i| i.0).or(object.meta.iso);
                played(&scene, object.field, iso, cancel, bar)?
            }
            Self::Stroke { stroke, .. } => {
                let (operation, tool) = stroke.tool().map_err(Failure::input)?;
                let iso = object.meta.iso.ok_or_else(|| {
                    Failure::input(format!(
                        "object {name:?} names no surface; fit it with an iso-value"
                    ))
                })?;
                let shown = bar.clone();
                let mut control = Control {
                    cancel: cancel.clone(),
                    on_progress: Box::new(move |p| shown.show("sculpting", p.fraction)),
                    ..Control::default()
                };
                let (field, report) = tool
                    .apply(operation, &object.field, iso, &mut control)
                    .map_err(Failure::input)?;
                if let Some(left) = report.left.filter(|left| left.wrong_signs > 0) {
                    notes.push(format!(
                        "{} of {} points have the wrong sign: parts thinner than a knot interval; allow more levels \
                         (finer)",
                        human_count(left.wrong_signs),
                        human_count(report.samples as usize),
                    ));
                }
                field
            }
        };
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

/// Runs a script on a document: a scene is one edit, of a session every stroke.
pub fn run(args: &Args) -> Outcome {
    let cancel = interrupt::cancel();
    let script = Source::open(&args.script, Some("toml"), "scripts .toml", &cancel)?.under("--script");
    let text = simulate::text(&script)?;
    set_threads(args.threads)?;
    let mut notes = Vec::new();
    let mut document = open(&args.document, &mut notes)?;
    let file = args.script.file_name().unwrap_or_default().to_string_lossy();
    let about = |e: Failure| e.about(script.name());
    let named = |own: Option<&str>| {
        let named = own.or(args.object.as_deref());
        chosen(document.state(), named).map(String::from)
    };
    let commands = Command::of_script(&text, &file, named).map_err(about)?;
    let bar = Bar::new();
    for (title, command) in &commands {
        let next = command
            .run(document.state(), &cancel, &bar, &mut notes)
            .map_err(about)?;
        let value = serde_json::to_value(command).expect("a command is plain values with text for keys");
        if !document.commit(title, value, next).map_err(failure)? {
            notes.push(format!("{title}: changes nothing; no edit was made"));
        }
    }
    bar.clear();
    Told::of(&mut document, notes)?.print(args.json)
}
