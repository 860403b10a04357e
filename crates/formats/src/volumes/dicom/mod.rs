//! DICOM series: many files of one slice, or one of many.
//!
//! A directory is read with what lies in it; with the directories below it, up to eight deep, if it holds a
//! `DICOMDIR` or no DICOM picture itself. A file stands for its series in its directory, a file of several frames
//! for itself. What is no DICOM is passed over. Positions and orientations decide on order, spacing and axes; world
//! coordinates are RAS millimetres. `docs/guide.md` has a table of the odd cases.

mod check;
mod codec;
mod dataset;
mod decode;
mod element;
mod fragments;
mod pixels;
mod plane;
mod resample;
pub(super) mod revise;
mod scan;
mod series;
mod stack;
mod stream;
mod syntax;
mod value;

use std::path::Path;
use std::sync::Arc;

pub(crate) use dataset::looks_like_dicom;
pub(crate) use scan::holds_dicom;

use super::options::{DicomOptions, Tilt, Uneven};
use super::slices;
use super::slices::SliceSource;
use super::volume::Volume;
use crate::limits::Budget;
use crate::{Fault, ReadLimits};

/// Opens the series that `path` stands for; of several volumes at the same positions number `volume`.
pub(super) fn open(
    path: &Path,
    options: &DicomOptions,
    volume: Option<usize>,
    budget: &mut Budget,
) -> Result<Box<dyn SliceSource>, Fault> {
    let found = scan::find(path, options, budget)?;
    Ok(Box::new(series::Series::new(found, options, volume, budget)?))
}

/// Reads the bytes of one file.
///
/// # Errors
/// As [`super::read`], without the path.
pub fn parse_dicom(bytes: &[u8], options: &DicomOptions, limits: &ReadLimits) -> Result<Volume, Fault> {
    let mut budget = Budget::new(limits);
    budget.reserve("the file's content", bytes.len() as u64, 1)?;
    let found = scan::one(Arc::from(bytes), &mut budget)?;
    slices::read(
        &mut series::Series::new(found, options, None, &mut budget)?,
        &mut budget,
    )
}
