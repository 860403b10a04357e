//! What went wrong, as an exception of `isoclay.errors`.

use bspline::CsgError;
use bspline::hierarchical::EditError;
use bspline::polygonize::PolygonizeError;
use document::SurfaceError;
use fitting::FitError;
use formats::{Fault, FormatError};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// What went wrong in a library, or in a callback.
#[derive(Debug)]
pub enum Failure {
    /// A fit.
    Fit(FitError),
    /// A file.
    File(FormatError),
    /// A cancel.
    Cancelled,
    /// A value that cannot be used.
    Value(String),
    /// A document.
    Document(String),
    /// A script.
    Script(String),
    /// Python itself.
    Python(PyErr),
}

impl Failure {
    /// A value that cannot be used; the sentence says what would do.
    pub fn value(why: impl ToString) -> Self {
        Self::Value(why.to_string())
    }
}

impl From<FitError> for Failure {
    fn from(error: FitError) -> Self {
        match error {
            FitError::Cancelled => Self::Cancelled,
            error => Self::Fit(error),
        }
    }
}

impl From<FormatError> for Failure {
    fn from(error: FormatError) -> Self {
        Self::File(error)
    }
}

impl From<PolygonizeError> for Failure {
    fn from(error: PolygonizeError) -> Self {
        match error {
            PolygonizeError::Cancelled => Self::Cancelled,
            error => Self::value(error),
        }
    }
}

impl From<SurfaceError> for Failure {
    fn from(error: SurfaceError) -> Self {
        match error {
            SurfaceError::Mesher(error) => error.into(),
            error => Self::value(error),
        }
    }
}

impl From<CsgError> for Failure {
    fn from(error: CsgError) -> Self {
        Self::value(error)
    }
}

impl From<EditError> for Failure {
    fn from(error: EditError) -> Self {
        Self::value(error)
    }
}

impl From<PyErr> for Failure {
    fn from(error: PyErr) -> Self {
        Self::Python(error)
    }
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        Python::attach(|py| raised(py, failure).unwrap_or_else(|error| error))
    }
}

/// The exception; or what kept it from being made.
fn raised(py: Python<'_>, failure: Failure) -> PyResult<PyErr> {
    let (class, arguments) = match failure {
        Failure::Python(error) => return Ok(error),
        Failure::Value(why) => return Ok(PyValueError::new_err(why)),
        Failure::Cancelled => ("Cancelled", ("cancelled",).into_pyobject(py)?),
        Failure::Document(why) => ("DocumentProblem", (why,).into_pyobject(py)?),
        Failure::Script(why) => ("BadScript", (why,).into_pyobject(py)?),
        Failure::Fit(error) => of_fit(py, error)?,
        Failure::File(error) => of_file(py, error)?,
    };
    let exception = py.import("isoclay.errors")?.getattr(class)?.call1(arguments)?;
    Ok(PyErr::from_value(exception))
}

fn of_fit(py: Python<'_>, error: FitError) -> PyResult<(&'static str, Bound<'_, PyTuple>)> {
    let message = error.to_string();
    Ok(match error {
        FitError::Cancelled => ("Cancelled", (message,).into_pyobject(py)?),
        FitError::MemoryLimit { needed, limit } => {
            ("MemoryLimit", (message, needed, limit).into_pyobject(py)?)
        }
        FitError::NotEnoughSamples { found, needed } => {
            ("NotEnoughSamples", (message, found, needed).into_pyobject(py)?)
        }
        FitError::Degenerate(_) => ("Degenerate", (message,).into_pyobject(py)?),
        FitError::Option { option, value, .. } => ("BadOption", (message, option, value).into_pyobject(py)?),
    })
}

fn of_file(py: Python<'_>, error: FormatError) -> PyResult<(&'static str, Bound<'_, PyTuple>)> {
    let (message, path) = (error.to_string(), error.path.display().to_string());
    Ok(match error.fault {
        Fault::Io { source, .. } => {
            let number = source.raw_os_error().unwrap_or(0);
            ("FileFailed", (message, path, number).into_pyobject(py)?)
        }
        Fault::Limit { needed, limit, .. } => ("MemoryLimit", (message, needed, limit).into_pyobject(py)?),
        _ => ("BadFile", (message, path).into_pyobject(py)?),
    })
}

/// A thread of ours ended without an answer.
pub fn lost(what: &str) -> PyErr {
    PyRuntimeError::new_err(format!(
        "isoclay failed inside: {what}; please report it with its input"
    ))
}
