//! Scenes played step by step.

use std::sync::{Arc, Mutex, MutexGuard};

use bspline::Real;
use formats::field::{AnyField, FieldMeta, Stored};
use numpy::{PyArray1, PyArray3, PyArray4, PyArrayMethods};
use pyo3::prelude::*;
use tools::paint::Layers;
use tools::scene::{Scene, SimulateError, Simulation};

use crate::failure::Failure;
use crate::field::CoreField;
use crate::run::{Wishes, brief, run};

/// The simulation that :class:`isoclay.Simulation` is laid over.
#[pyclass(frozen, module = "isoclay._isoclay")]
pub struct CoreSimulation {
    playing: Arc<Mutex<Playing>>,
    meta: FieldMeta,
}

enum Playing {
    F32(Simulation<f32>),
    F64(Simulation<f64>),
}

/// Asks the simulation of either precision.
macro_rules! each {
    ($playing:expr, $s:ident => $ask:expr) => {
        match $playing {
            Playing::F32($s) => $ask,
            Playing::F64($s) => $ask,
        }
    };
}

fn held(playing: &Mutex<Playing>) -> MutexGuard<'_, Playing> {
    playing.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
}

impl CoreSimulation {
    /// Asks without the interpreter, for which a step that was left to end by itself is waited for.
    fn ask<R: Send>(
        &self,
        py: Python<'_>,
        ask: impl FnOnce(&Playing) -> Result<R, Failure> + Send,
    ) -> PyResult<R> {
        brief(py, || ask(&held(&self.playing)))
    }
}

#[pymethods]
impl CoreSimulation {
    /// A scene, TOML or JSON, at its start.
    #[new]
    fn new(py: Python<'_>, field: PyRef<'_, CoreField>, scene: &str) -> PyResult<Self> {
        let scene = parsed(scene)?;
        let (iso, meta) = (field.meta.iso, field.meta.clone());
        let levels = field.stored()?;
        let playing = brief(py, || {
            Ok(match levels {
                AnyField::F32(field) => {
                    Playing::F32(Simulation::new(&scene, field.clone(), iso, &Layers::new())?)
                }
                AnyField::F64(field) => {
                    Playing::F64(Simulation::new(&scene, field.clone(), iso, &Layers::new())?)
                }
            })
        })?;
        Ok(Self {
            playing: Arc::new(Mutex::new(playing)),
            meta,
        })
    }

    /// Steps, at most so many, and as long as the scene lasts; what each did, as JSON.
    fn step(&self, py: Python<'_>, count: usize, wishes: Wishes) -> PyResult<Vec<String>> {
        let playing = Arc::clone(&self.playing);
        run(py, &wishes, move |control| {
            let mut playing = held(&playing);
            let mut lines = Vec::new();
            each!(&mut *playing, simulation => {
                for _ in 0..count {
                    if simulation.is_over() {
                        break;
                    }
                    control.step("simulating", simulation.progress())?;
                    let line = simulation.step()?;
                    lines.push(serde_json::to_string(&line).map_err(Failure::value)?);
                }
            });
            Ok(lines)
        })
    }

    #[getter]
    fn is_over(&self, py: Python<'_>) -> PyResult<bool> {
        self.ask(py, |playing| Ok(each!(playing, s => s.is_over())))
    }

    #[getter]
    fn progress(&self, py: Python<'_>) -> PyResult<f64> {
        self.ask(py, |playing| Ok(each!(playing, s => s.progress())))
    }

    #[getter]
    fn notes(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.ask(py, |playing| Ok(each!(playing, s => s.notes().to_vec())))
    }

    /// The field with all changes so far.
    fn field(&self, py: Python<'_>) -> PyResult<CoreField> {
        let baked = self.ask(py, |playing| {
            Ok(match playing {
                Playing::F32(s) => f32::any(s.baked()?),
                Playing::F64(s) => f64::any(s.baked()?),
            })
        })?;
        let mut meta = self.meta.clone();
        meta.notes
            .push("moved by a scene; its errors and leaves are those of the fit before".into());
        let report = document::read_report(&meta, 0).unwrap_or_default();
        Ok(CoreField::of_levels(baked, meta, report))
    }

    /// Densities at the samples of the region.
    fn densities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let (values, dims) = self.ask(py, |playing| {
            Ok(each!(playing, s => {
                let patch = s.region().patch();
                let values: Vec<f64> = patch.state().d.iter().map(|d| d.as_f64()).collect();
                (values, patch.lattice().sample_dims())
            }))
        })?;
        PyArray1::from_vec(py, values).reshape(dims)
    }

    /// World places of the samples of the region.
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray4<f64>>> {
        let (values, [nx, ny, nz]) = self.ask(py, |playing| {
            Ok(each!(playing, s => {
                let region = s.region();
                let [nx, ny, nz] = region.patch().lattice().sample_dims();
                let all = (0..nx * ny * nz).map(|n| [n / (ny * nz), n / nz % ny, n % nz]);
                let values: Vec<f64> = all.flat_map(|ijk| region.sample_position(ijk).to_array()).collect();
                (values, [nx, ny, nz])
            }))
        })?;
        PyArray1::from_vec(py, values).reshape([nx, ny, nz, 3])
    }
}

/// A scene; where it names no field, that is given.
fn parsed(text: &str) -> Result<Scene, Failure> {
    let wrong = |e: String| Failure::Script(e.trim_end().into());
    if text.trim_start().starts_with('{') {
        return serde_json::from_str(text).map_err(|e| wrong(e.to_string()));
    }
    let mut table: toml::Table = toml::from_str(text).map_err(|e| wrong(e.to_string()))?;
    match table.contains_key("field") {
        // Straight from the text, an error knows its line.
        true => toml::from_str(text).map_err(|e| wrong(e.to_string())),
        false => {
            table.insert("field".into(), "".into());
            table.try_into().map_err(|e| wrong(e.to_string()))
        }
    }
}

impl From<SimulateError> for Failure {
    fn from(error: SimulateError) -> Self {
        Self::Script(error.to_string())
    }
}
