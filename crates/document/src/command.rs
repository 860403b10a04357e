//! What was asked for: enough to do it, and to do it again.

use std::collections::BTreeSet;

use bspline::HierarchicalSpline;
use fitting::{Control, FitError};
use glam::DAffine3;
use serde::{Deserialize, Serialize};
use tools::others::Others;
use tools::paint::Layers;
use tools::scene::{Scene, SimulateError, Simulation};
use tools::session::{Session, Stroke};
use tools::tool::{Canvas, Tool, ToolError};

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
    Tool(#[from] ToolError),
    /// A scene cannot be played.
    #[error(transparent)]
    Scene(#[from] SimulateError),
    /// The user said stop.
    #[error(transparent)]
    Cancelled(FitError),
}

impl Command {
    /// What a script asks for, in its order: a scene is one command, of a session every stroke is one. `object` names the
    /// object where a script names none.
    ///
    /// # Errors
    /// [`CommandError::Script`] with the line, and what `object` says.
    pub fn of_script<E: From<CommandError>>(
        text: &str,
        object: impl Fn(Option<&str>) -> Result<String, E>,
    ) -> Result<Vec<Self>, E> {
        let table: toml::Table = parsed(text)?;
        if !table.contains_key("stroke") {
            let _: Scene = parsed(text)?;
            let script = text.to_string();
            return Ok(vec![Self::Scene {
                object: object(None)?,
                script,
            }]);
        }
        let session: Session = parsed(text)?;
        let strokes = session.stroke.into_iter().enumerate();
        let mut made = BTreeSet::new();
        let commands = strokes.map(|(n, stroke)| {
            let wrong = |why| CommandError::Script(format!("stroke {}: {why}", n + 1));
            let copy = match stroke.tool().map_err(wrong)? {
                Tool::Copy(copy) => Some(copy.to.clone()),
                Tool::Cut(cut) => cut.to.clone(),
                _ => None,
            };
            // Objects that are made on the way are not known yet.
            let object = match &stroke.object {
                Some(name) if made.contains(name) => name.clone(),
                own => object(own.as_deref())?,
            };
            made.extend(copy);
            Ok(Self::Stroke {
                object,
                stroke: Box::new(stroke),
            })
        });
        commands.collect()
    }

    /// What it does, in a few words.
    pub fn title(&self) -> String {
        match self {
            Self::Scene { object, .. } => format!("scene on {object}"),
            Self::Stroke { object, stroke } => {
                let name = stroke.tool().map_or("stroke", |tool| tool.name());
                format!("{name} on {object}")
            }
        }
    }

    /// Does it, and says in sentences what is left to say.
    ///
    /// # Errors
    /// Any [`CommandError`].
    pub fn apply(&self, state: &State, control: &mut Control) -> Result<(State, Vec<String>), CommandError> {
        let (Self::Scene { object: name, .. } | Self::Stroke { object: name, .. }) = self;
        let mut object = state.object(name)?.clone();
        let mut next = state.clone();
        let notes;
        match self {
            Self::Scene { script, .. } => {
                let scene: Scene = parsed(script)?;
                let iso = scene.iso.map(|i| i.0).or(object.meta.iso);
                (object.field, notes) = played(&scene, object.field, iso, &object.layers, control)?;
            }
            Self::Stroke { stroke, .. } => {
                let iso = object
                    .meta
                    .iso
                    .ok_or_else(|| CommandError::NoSurface(name.clone()))?;
                let canvas = Canvas {
                    detail: object.detail(),
                    field: object.field,
                    iso,
                    layers: object.layers,
                    holds: object.properties.holds,
                    others: others(state, name)?,
                    copies: Vec::new(),
                };
                let (canvas, told) = stroke
                    .apply(canvas, control)
                    .map_err(|e| match e.is_cancelled() {
                        true => CommandError::Cancelled(FitError::Cancelled),
                        false => e.into(),
                    })?;
                for copy in canvas.copies {
                    if state.object(&copy).is_ok() {
                        return Err(CommandError::Taken(copy));
                    }
                    next = next.with(&copy, state.object(name)?.clone())?;
                }
                (object.field, object.layers) = (canvas.field, canvas.layers);
                object.properties.holds = canvas.holds;
                notes = told;
            }
        }
        Ok((next.with(name, object)?, notes))
    }
}

/// All objects that have a surface, as they lie to the one of a name.
fn others(state: &State, name: &str) -> Result<Others, CommandError> {
    let own = state.placement(name)?.inverse();
    let mut others = Others::default();
    for (other, object) in state.objects() {
        if let Some(iso) = object.meta.iso {
            // Of the object itself no rounding.
            let map = match other == name {
                true => DAffine3::IDENTITY,
                false => own * state.placement(other)?,
            };
            let put = others.put(other, &object.field, iso, map);
            put.map_err(|e| CommandError::Script(format!("object {other:?} cannot be used: {e}")))?;
        }
    }
    Ok(others)
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
) -> Result<(HierarchicalSpline<f32>, Vec<String>), CommandError> {
    let mut simulation = Simulation::new(scene, field, iso, layers)?;
    while !simulation.is_over() {
        control
            .step("simulating", simulation.progress())
            .map_err(CommandError::Cancelled)?;
        simulation.step()?;
    }
    Ok((simulation.baked()?, simulation.notes().to_vec()))
}
