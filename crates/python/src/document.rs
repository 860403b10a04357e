//! Documents.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard};

use document::{
    Command, CommandError, Course, Document, DocumentError, Lost, Object, Options, Samples, State,
    WriteBackError,
};
use fitting::FitReport;
use fitting::volume::VolumeView;
use formats::field::AnyField;
use formats::volumes::VolumeOptions;
use formats::{Kind, ReadLimits};
use numpy::PyArray2;
use pyo3::prelude::*;
use tools::body::Body;
use tools::force::Solid;
use tools::malleable::Malleable;

use crate::arrays::points;
use crate::failure::Failure;
use crate::field::{CoreField, Grids};
use crate::run::{Wishes, brief, run};

/// The document that :class:`isoclay.Document` is laid over.
#[pyclass(frozen, module = "isoclay._isoclay")]
pub struct CoreDocument(Mutex<Option<Document>>);

/// What is told of an edit: its title, its time, whether it is done, the state after it, and what was asked for as JSON.
type Edit = (String, u64, bool, String, String);

fn options() -> Options {
    Options {
        limits: ReadLimits { max_bytes: u64::MAX },
        ..Options::default()
    }
}

fn hex(digest: [u8; 32]) -> String {
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

impl CoreDocument {
    fn held(&self) -> MutexGuard<'_, Option<Document>> {
        self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    /// Asks the open document.
    fn with<R: Send>(
        &self,
        py: Python<'_>,
        ask: impl FnOnce(&mut Document) -> Result<R, Failure> + Send,
    ) -> PyResult<R> {
        brief(py, || match &mut *self.held() {
            Some(document) => ask(document),
            None => Err(Failure::value("the document is closed; open it again")),
        })
    }

    fn state(&self, py: Python<'_>) -> PyResult<State> {
        self.with(py, |document| Ok(document.state().clone()))
    }
}

#[pymethods]
impl CoreDocument {
    /// A new document of fields under their names, which are kept as clay, or spring back.
    #[staticmethod]
    fn create(
        py: Python<'_>,
        path: PathBuf,
        fields: Vec<(String, PyRef<'_, CoreField>)>,
        elastic: bool,
    ) -> PyResult<Self> {
        let mut state = State::new();
        for (name, field) in &fields {
            state = state
                .with(name, object_of(field, elastic)?)
                .map_err(Failure::from)?;
        }
        brief(py, || {
            Ok(Self(Mutex::new(Some(Document::create(&path, state, options())?))))
        })
    }

    /// Opens a document; also what of it could not be read.
    #[staticmethod]
    fn open(py: Python<'_>, path: PathBuf) -> PyResult<(Self, Option<String>)> {
        brief(py, || {
            let opened = Document::open(&path, options())?;
            let lost = opened.lost.map(|Lost { bytes, is_torn, why }| match is_torn {
                true => format!("the last edit was not whole ({bytes} bytes), as after a crash, and is left out"),
                false => format!(
                    "{bytes} bytes at the end cannot be followed ({why}); they are copied to a file .damaged before the \
                     document is changed"
                ),
            });
            Ok((Self(Mutex::new(Some(opened.document))), lost))
        })
    }

    /// Lets others open it.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        brief(py, || {
            drop(self.held().take());
            Ok(())
        })
    }

    #[getter]
    fn is_closed(&self) -> bool {
        self.held().is_none()
    }

    fn names(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        Ok(self.state(py)?.objects().keys().cloned().collect())
    }

    /// The field of an object, in its own world.
    fn field(&self, py: Python<'_>, name: &str) -> PyResult<CoreField> {
        let state = self.state(py)?;
        let object = state.object(name).map_err(Failure::from)?;
        Ok(field_of(object))
    }

    /// The map from the world of an object to that of the document, three rows.
    fn placement(&self, py: Python<'_>, name: &str) -> PyResult<[[f64; 4]; 3]> {
        let map = self.state(py)?.placement(name).map_err(Failure::from)?;
        Ok(crate::arrays::matrix_rows(&map))
    }

    /// Names all objects with their placements.
    fn sha256(&self, py: Python<'_>) -> PyResult<String> {
        self.with(py, |document| Ok(hex(document.state().sha256())))
    }

    /// Edits that are done, that are undone, and that can no longer be undone.
    fn counts(&self, py: Python<'_>) -> PyResult<(usize, usize, u64)> {
        self.with(py, |document| {
            let counts = document.counts()?;
            Ok((counts.done, counts.undone, counts.forgotten))
        })
    }

    fn history(&self, py: Python<'_>) -> PyResult<Vec<Edit>> {
        self.with(py, |document| {
            let (history, done) = (document.history()?, document.counts()?.done);
            let edits = history.into_iter().enumerate();
            edits
                .map(|(n, edit)| {
                    let command = document.command(n)?.to_string();
                    Ok((edit.title, edit.time, n < done, edit.sha256, command))
                })
                .collect()
        })
    }

    fn undo(&self, py: Python<'_>, count: usize) -> PyResult<usize> {
        self.with(py, |document| Ok(document.undo(count)?))
    }

    fn redo(&self, py: Python<'_>, count: usize) -> PyResult<usize> {
        self.with(py, |document| Ok(document.redo(count)?))
    }

    /// Runs a script: a scene is one edit, of a session every stroke. Returns how many edits were made, and what is to be told.
    fn sculpt(
        &self,
        py: Python<'_>,
        script: &str,
        object: Option<&str>,
        label: &str,
        wishes: Wishes,
    ) -> PyResult<(usize, Vec<String>)> {
        let state = self.state(py)?;
        let named = |own: Option<&str>| -> Result<String, Failure> { chosen(&state, own.or(object)) };
        let commands = Command::of_script(script, named)?;
        let (mut made, mut notes) = (0, Vec::new());
        for command in commands {
            let title = match label {
                "" => command.title(),
                label => format!("{} ({label})", command.title()),
            };
            let (value, before) = (command.to_value(), self.state(py)?);
            let (next, told) = run(py, &wishes, move |control| Ok(command.apply(&before, control)?))?;
            notes.extend(told.into_iter().map(|note| format!("{title}: {note}")));
            match self.with(py, |document| Ok(document.commit(&title, value, next)?))? {
                true => made += 1,
                false => notes.push(format!("{title}: changes nothing; no edit was made")),
            }
        }
        Ok((made, notes))
    }

    /// Puts a field in under a name, in place of an object that had it.
    fn put(&self, py: Python<'_>, name: &str, field: PyRef<'_, CoreField>, elastic: bool) -> PyResult<bool> {
        let object = object_of(&field, elastic)?;
        let command = serde_json::json!({ "tool": "import", "object": name });
        self.with(py, |document| {
            let next = document.state().with(name, object)?;
            Ok(document.commit(&format!("import {name}"), command, next)?)
        })
    }

    /// Takes an object out.
    fn remove(&self, py: Python<'_>, name: &str) -> PyResult<bool> {
        let command = serde_json::json!({ "tool": "remove", "object": name });
        self.with(py, |document| {
            let next = document.state().without(name)?;
            Ok(document.commit(&format!("remove {name}"), command, next)?)
        })
    }

    /// Does all edits again from the first state, and compares what comes out to the bit; how many they were.
    fn replay(&self, py: Python<'_>, wishes: Wishes) -> PyResult<usize> {
        let (history, done, mut state) = self.with(py, |document| {
            Ok((
                document.history()?,
                document.counts()?.done,
                document.first_state()?,
            ))
        })?;
        for (n, edit) in history.iter().enumerate().take(done) {
            let value = self.with(py, |document| Ok(document.command(n)?))?;
            let about = |why: String| Failure::Document(format!("edit {} ({}): {why}", n + 1, edit.title));
            let command: Command =
                serde_json::from_value(value).map_err(|e| about(format!("cannot be done again ({e})")))?;
            let before = state;
            (state, _) = run(py, &wishes, move |control| Ok(command.apply(&before, control)?))?;
            let found = brief(py, || Ok(hex(state.sha256())))?;
            if found != edit.sha256 {
                return Err(about(format!(
                    "gives {found} when it is done again, {} is stored; was it made by another version of isoclay?",
                    edit.sha256
                ))
                .into());
            }
        }
        Ok(done)
    }

    /// Writes the scan that an object was fitted to with the object's edits; what is to be told.
    fn export_like(
        &self,
        py: Python<'_>,
        name: &str,
        scan: PathBuf,
        fill: Option<f64>,
        output: PathBuf,
    ) -> PyResult<Vec<String>> {
        let course = self.with(py, |document| Ok(Course::of(document, name)?))?;
        brief(py, || {
            let limits = ReadLimits { max_bytes: u64::MAX };
            let belongs = |samples: Samples| {
                let (object, file) = (format!("object {name:?}"), scan.display().to_string());
                let differs = samples.differ_from(course.meta(), course.extent(), &object, &file);
                differs.map_or(Ok(()), |differs| {
                    Err(Failure::value(format!(
                        "{differs}; give the whole scan that it was fitted to"
                    )))
                })
            };
            match formats::detect(&scan)? {
                Kind::Volume(_) => {
                    let options = VolumeOptions::default();
                    let volume = formats::volumes::read(&scan, &options, &limits)?;
                    belongs(Samples::Volume(&VolumeView {
                        dims: volume.header.dims,
                        values: (&volume.values).into(),
                        world_from_voxel: volume.header.world_from_voxel,
                    }))?;
                    Ok(course.write_volume(&scan, &options, &volume, fill, &output, &limits)?)
                }
                Kind::Cloud(_) => {
                    let cloud = formats::points::read(&scan, &limits)?;
                    belongs(Samples::Cloud(&cloud.positions))?;
                    Ok(course.write_cloud(&scan, &cloud, &output, &limits)?)
                }
                Kind::Mesh(_) | Kind::Field => Err(Failure::value(format!(
                    "{}: volumes and clouds are written back, and this is neither; mesh the object, or export its field",
                    scan.display()
                ))),
            }
        })
    }

    /// Corners of the box of an object, in its own world.
    fn object_box<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let state = self.state(py)?;
        let around = state.object(name).map_err(Failure::from)?.field.world_box();
        points(py, &[around.min, around.max])
    }
}

/// The object that the user named, or the only one.
fn chosen(state: &State, named: Option<&str>) -> Result<String, Failure> {
    let names: Vec<&String> = state.objects().keys().collect();
    match (named, &names[..]) {
        (Some(name), _) => {
            state.object(name)?;
            Ok(name.into())
        }
        (None, [one]) => Ok((*one).clone()),
        (None, names) => Err(Failure::value(format!(
            "the document has {} objects ({names:?}); name one by object=",
            names.len()
        ))),
    }
}

fn object_of(field: &CoreField, elastic: bool) -> Result<Object, Failure> {
    if field.meta.iso.is_none() {
        return Err(Failure::value(
            "the field names no surface; give it one by .with_iso(density)",
        ));
    }
    let mut object = Object::new(field.stored()?, field.meta.clone())?;
    object.properties.material.solid = match elastic {
        true => Solid::Elastic,
        false => Solid::Clay,
    };
    Ok(object)
}

fn field_of(object: &Object) -> CoreField {
    let mut meta = (*object.meta).clone();
    meta.notes
        .push("from a document; errors and leaves are those of the fit, before any edit".into());
    match &object.field {
        Body::Levels(field) => {
            let report = document::read_report(&meta, field.coefficient_count()).unwrap_or_default();
            CoreField::of_levels(AnyField::F32(field.clone()), meta, report)
        }
        Body::Knots(field) => CoreField {
            solid: Arc::new(field.clone()),
            levels: None,
            grids: Grids {
                lattice: field.grids(),
                levels: field.depth(),
                slope: field.steepness(),
            },
            meta,
            report: FitReport::default(),
        },
    }
}

impl From<DocumentError> for Failure {
    fn from(error: DocumentError) -> Self {
        match error {
            DocumentError::File(error) => Self::File(error),
            error => Self::Document(error.to_string()),
        }
    }
}

impl From<CommandError> for Failure {
    fn from(error: CommandError) -> Self {
        match error {
            CommandError::Document(error) => error.into(),
            CommandError::Cancelled(error) => error.into(),
            error => Self::Script(error.to_string()),
        }
    }
}

impl From<WriteBackError> for Failure {
    fn from(error: WriteBackError) -> Self {
        match error {
            WriteBackError::Document(error) => error.into(),
            WriteBackError::Reading(error) | WriteBackError::Writing(error) => Self::File(error),
            error => Self::Document(error.to_string()),
        }
    }
}
