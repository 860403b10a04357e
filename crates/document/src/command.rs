//! What was asked for: enough to do it, and to do it again.

use std::collections::BTreeSet;

use bspline::HierarchicalSpline;
use fitting::{Control, FitError};
use serde::{Deserialize, Serialize};
use tools::body::Body;
use tools::paint::Layers;
use tools::scene::{Scene, SimulateError, Simulation, StepLine};
use tools::session::{Session, Stroke};
use tools::tool::{Tool, ToolError};

use crate::canvas::{canvas, left};
use crate::family::{removed, renamed};
use crate::{DocumentError, State};

/// What makes an edit. The journal keeps it beside the difference that it made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "tool", rename_all = "lowercase", deny_unknown_fields)]
pub enum Command {
    /// A scene, as it was written.
    Scene {
        /// What it moves.
        object: String,
        /// Its text, TOML.
        script: String,
    },
    /// One stroke of a session.
    Stroke {
        /// What it works on.
        object: String,
        /// The stroke.
        stroke: Box<Stroke>,
    },
    /// Takes an object out of the document; what hangs on it hangs on its parent then, and stays where it is.
    Remove {
        /// Which.
        object: String,
    },
    /// Gives an object another name.
    Rename {
        /// Which.
        object: String,
        /// Its new name.
        to: String,
    },
}

/// A line of a script in JSON: a stroke, or a whole command as the journal has it.
enum Line {
    Stroke(Box<Stroke>),
    Command(Command),
}

/// Why a command cannot be done. The state is as it was.
#[derive(Debug, thiserror::Error)]
pub enum CommandError {
    /// A script says what nobody understands.
    #[error("{0}")]
    Script(String),
    /// There is no such object, or what comes out cannot be one.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// The object has no surface for a tool to work on.
    #[error("object {0:?} names no surface; fit it with an iso-value")]
    NoSurface(String),
    /// A copy would take the place of an object.
    #[error("there is an object {0:?} already; give the copy another name")]
    Taken(String),
    /// A tool cannot be used.
    #[error(transparent)]
    Tool(ToolError),
    /// The document went on beside a stroke in a hand.
    #[error("object {0:?} or another one was changed since the stroke began; begin the stroke anew")]
    Changed(String),
    /// A scene cannot be played.
    #[error(transparent)]
    Scene(#[from] SimulateError),
    /// The user said stop.
    #[error(transparent)]
    Cancelled(FitError),
}

impl Command {
    /// What a script asks for, in its order: a scene is one command, of a session every stroke is one, and a text without keys is a session without strokes. `object` names the
    /// object where a script names none. A text whose first sign is a brace is a session in JSON, one stroke or command a line; any other
    /// is TOML.
    ///
    /// # Errors
    /// [`CommandError::Script`] with the line, and what `object` says.
    pub fn of_script<E: From<CommandError>>(
        text: &str,
        object: impl Fn(Option<&str>) -> Result<String, E>,
    ) -> Result<Vec<Self>, E> {
        if text.trim_start().starts_with('{') {
            return Self::of_lines(lines_of(text)?, object);
        }
        let table: toml::Table = parsed(text)?;
        if table.is_empty() {
            return Ok(Vec::new());
        }
        if !table.contains_key("stroke") {
            let _: Scene = parsed(text)?;
            let script = text.to_string();
            return Ok(vec![Self::Scene {
                object: object(None)?,
                script,
            }]);
        }
        let session: Session = parsed(text)?;
        let strokes = session.stroke.into_iter().map(Box::new);
        Self::of_lines(strokes.map(Line::Stroke).collect(), object)
    }

    fn of_lines<E: From<CommandError>>(
        lines: Vec<Line>,
        object: impl Fn(Option<&str>) -> Result<String, E>,
    ) -> Result<Vec<Self>, E> {
        let mut made = BTreeSet::new();
        let commands = lines.into_iter().enumerate().map(|(n, line)| {
            // Objects that are made on the way are not known yet.
            let named = |own: Option<&str>, made: &BTreeSet<String>| match own {
                Some(name) if made.contains(name) => Ok(name.to_string()),
                own => object(own),
            };
            let command = match line {
                Line::Stroke(stroke) => Self::Stroke {
                    object: named(stroke.object.as_deref(), &made)?,
                    stroke,
                },
                Line::Command(command) => {
                    named(Some(command.object()), &made)?;
                    command
                }
            };
            let wrong = |why| CommandError::Script(format!("stroke {}: {why}", n + 1));
            made.extend(command.makes().map_err(wrong)?);
            Ok(command)
        });
        commands.collect()
    }

    /// The name of an object that it puts in, if it does.
    fn makes(&self) -> Result<Option<String>, String> {
        Ok(match self {
            Self::Stroke { stroke, .. } => match stroke.tool()? {
                Tool::Copy(copy) => Some(copy.to.clone()),
                Tool::Cut(cut) => cut.to.clone(),
                _ => None,
            },
            Self::Rename { to, .. } => Some(to.clone()),
            Self::Scene { .. } | Self::Remove { .. } => None,
        })
    }

    /// What it does, in a few words.
    pub fn title(&self) -> String {
        match self {
            Self::Scene { object, .. } => format!("scene on {object}"),
            Self::Remove { object } => format!("remove {object}"),
            Self::Rename { object, to } => format!("rename {object} to {to}"),
            Self::Stroke { object, stroke } => {
                let name = stroke.tool().map_or("stroke", |tool| tool.name());
                match stroke.step_count() {
                    Some(1) => format!("{name} on {object} by hand, 1 step"),
                    Some(count) => format!("{name} on {object} by hand, {count} steps"),
                    None => format!("{name} on {object}"),
                }
            }
        }
    }

    /// The object that it works on.
    pub fn object(&self) -> &str {
        match self {
            Self::Scene { object, .. }
            | Self::Stroke { object, .. }
            | Self::Remove { object }
            | Self::Rename { object, .. } => object,
        }
    }

    /// As the journal keeps it.
    pub fn to_value(&self) -> serde_json::Value {
        serde_json::to_value(self).expect("a command is plain values with text for keys")
    }

    /// Does it, and says in sentences what is left to say.
    ///
    /// # Errors
    /// Any [`CommandError`].
    pub fn apply(&self, state: &State, control: &mut Control) -> Result<(State, Vec<String>), CommandError> {
        self.apply_watched(state, control, &mut |_| ())
    }

    /// The same, and tells what each step of a scene did.
    ///
    /// # Errors
    /// Any [`CommandError`].
    pub fn apply_watched(
        &self,
        state: &State,
        control: &mut Control,
        on_step: &mut dyn FnMut(&StepLine),
    ) -> Result<(State, Vec<String>), CommandError> {
        let name = self.object();
        match self {
            Self::Scene { script, .. } => {
                let mut object = state.object(name)?.clone();
                let scene: Scene = parsed(script)?;
                let iso = scene.iso.map(|i| i.0).or(object.iso());
                let (field, told) = object.in_levels(name, control)?;
                let (field, notes) = played(&scene, field, iso, &object.layers, control, on_step)?;
                object.field = Body::Levels(field);
                Ok((state.with(name, object)?, told.into_iter().chain(notes).collect()))
            }
            Self::Stroke { stroke, .. } => {
                let (canvas, notes) = stroke.applied(canvas(state, name)?, control)?;
                Ok((left(state, name, canvas)?, notes))
            }
            Self::Remove { .. } => Ok((removed(state, name)?, Vec::new())),
            Self::Rename { to, .. } => Ok((renamed(state, name, to)?, Vec::new())),
        }
    }
}

impl From<ToolError> for CommandError {
    fn from(error: ToolError) -> Self {
        match error.is_cancelled() {
            true => Self::Cancelled(FitError::Cancelled),
            false => Self::Tool(error),
        }
    }
}

/// Strokes and commands in JSON, one a line; empty lines count for the numbers alone. Commands are told by their `tool`.
fn lines_of(text: &str) -> Result<Vec<Line>, CommandError> {
    let lines = text
        .lines()
        .enumerate()
        .filter(|(_, line)| !line.trim().is_empty());
    let read = |(n, text): (usize, &str)| {
        let is_command =
            serde_json::from_str::<serde_json::Value>(text).is_ok_and(|all| all.get("tool").is_some());
        let line = match is_command {
            true => serde_json::from_str(text).map(Line::Command),
            false => serde_json::from_str(text).map(Line::Stroke),
        };
        line.map_err(|e| {
            let (told, column) = (e.to_string(), e.column());
            let why = told.rsplit_once(" at line ").map_or(&told[..], |(why, _)| why);
            CommandError::Script(format!("line {}, column {column}: {why}", n + 1))
        })
    };
    lines.map(read).collect()
}

fn parsed<T: serde::de::DeserializeOwned>(text: &str) -> Result<T, CommandError> {
    toml::from_str(text).map_err(|e| CommandError::Script(e.to_string().trim_end().into()))
}

/// What a scene leaves of a field, and what is to be told of it.
fn played(
    scene: &Scene,
    field: HierarchicalSpline<f32>,
    iso: Option<f64>,
    layers: &Layers,
    control: &mut Control,
    on_step: &mut dyn FnMut(&StepLine),
) -> Result<(HierarchicalSpline<f32>, Vec<String>), CommandError> {
    let mut simulation = Simulation::new(scene, field, iso, layers)?;
    while !simulation.is_over() {
        control
            .step("simulating", simulation.progress())
            .map_err(CommandError::Cancelled)?;
        on_step(&simulation.step()?);
    }
    Ok((simulation.baked()?, simulation.notes().to_vec()))
}
