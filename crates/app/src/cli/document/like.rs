//! Edited scans: `isoclay export --like`.

use std::path::Path;

use document::{Course, Document, WriteBackError};

use super::failure;
use crate::cli::belongs;
use crate::cli::failure::{Failure, Outcome};
use crate::cli::input::{self, Input, limits, writing};
use crate::cli::source::Source;
use crate::cli::volume_choice::VolumeChoice;

/// A scan to be written with an object's edits.
pub struct Like<'a> {
    /// The scan.
    pub source: &'a Source,
    /// How to read it.
    pub choice: &'a VolumeChoice,
    /// Density of what was carved, if the user says it.
    pub fill: Option<f64>,
}

impl Like<'_> {
    /// Writes the scan with what was done to an object since the document began; returns what is to be told.
    pub fn export(&self, document: &mut Document, name: &str, output: &Path) -> Outcome<Vec<String>> {
        let course = Course::of(document, name).map_err(|e| self.failed(e))?;
        let input = input::read(self.source, None, self.choice, None, None)?;
        let object = format!("object {name:?}");
        let differs = belongs::differs(
            course.meta(),
            course.extent(),
            &object,
            &input,
            self.source.name(),
        );
        if let Some(differs) = differs {
            return Err(Failure::usage(format!(
                "{differs}; give the whole scan that it was fitted to"
            )));
        }
        let path = self.source.path();
        let told = match input {
            Input::Volume(volume) => {
                let options = self.choice.options(None)?;
                course.write_volume(path, &options, &volume, self.fill, output, &limits(None))
            }
            Input::Cloud(cloud) => course.write_cloud(path, &cloud, output, &limits(None)),
            Input::Mesh(_) => {
                return Err(Failure::usage(format!(
                    "{}: volumes and clouds are written back, and this is a mesh; mesh the object, or export its field",
                    self.source.name()
                )));
            }
        };
        told.map_err(|e| self.failed(e))
    }

    fn failed(&self, error: WriteBackError) -> Failure {
        match error {
            WriteBackError::Document(e) => failure(e),
            WriteBackError::NoScan(_) => Failure::usage(error),
            WriteBackError::NoFit(_) | WriteBackError::Replaced(_) => Failure::input(error),
            WriteBackError::LeftOut(_) => Failure::input(format!("{}: {error}", self.source.name())),
            WriteBackError::Reading(e) => self.source.reading(e),
            WriteBackError::Writing(e) => writing(e),
        }
    }
}
