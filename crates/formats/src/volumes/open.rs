//! From a path to its slices.

use std::path::Path;

use super::options::VolumeOptions;
use super::part::Part;
use super::several::Several;
use super::slices::SliceSource;
#[cfg(feature = "medical")]
use super::{dicom, metaimage, nifti, nrrd};
use super::{raw, tiff};
use crate::detect::detect;
use crate::kind::{Kind, VolumeFormat};
use crate::limits::Budget;
use crate::{Fault, FormatError};

/// Everything that [`super::read`] reads.
pub(crate) const VOLUMES: &str =
    "volumes .nii .hdr .nrrd .nhdr .mha .mhd .tif, also .gz, DICOM series, directories of .tif";

/// An open volume: its slices as asked, and what it is as a whole.
pub(super) struct Opened {
    pub source: Part<'static>,
    pub format: VolumeFormat,
    pub file_dims: [usize; 3],
}

/// Opens `path` as what its content, then its name tell.
pub(super) fn open(path: &Path, options: &VolumeOptions, budget: &mut Budget) -> Result<Opened, Fault> {
    let format = match &options.raw {
        Some(_) => VolumeFormat::Raw,
        None => format_of(path)?,
    };
    if let VolumeFormat::Tiff | VolumeFormat::TiffFolder | VolumeFormat::Raw = format {
        // These hold one.
        Several::choose(1, options.volume)?;
    }
    let inner: Box<dyn SliceSource> = match (format, &options.raw) {
        (VolumeFormat::Raw, Some(layout)) => Box::new(raw::open(path, layout)?),
        (VolumeFormat::Raw, None) => unreachable!("never told from a file"),
        #[cfg(feature = "medical")]
        (VolumeFormat::Dicom, _) => dicom::open(path, &options.dicom, options.volume, budget)?,
        #[cfg(feature = "medical")]
        (VolumeFormat::Nifti | VolumeFormat::NiftiPair, _) => nifti::open(path, options.volume)?,
        #[cfg(feature = "medical")]
        (VolumeFormat::Nrrd, _) => nrrd::open(path, options.volume, budget)?,
        #[cfg(feature = "medical")]
        (VolumeFormat::MetaImage, _) => metaimage::open(path, options.volume, budget)?,
        (VolumeFormat::Tiff | VolumeFormat::TiffFolder, _) => tiff::open(path, budget)?,
        #[cfg(not(feature = "medical"))]
        (other, _) => return Err(Fault::left_out(Kind::Volume(other), "medical")),
    };
    let file_dims = inner.header().dims;
    Ok(Opened {
        source: Part::new(inner, options)?,
        format,
        file_dims,
    })
}

pub(super) fn format_of(path: &Path) -> Result<VolumeFormat, Fault> {
    // What is no file cannot be looked into twice.
    if path.metadata().is_ok_and(|m| !m.is_file() && !m.is_dir()) {
        return Ok(VolumeFormat::Nifti);
    }
    match detect(path).map_err(|FormatError { fault, .. }| fault)? {
        Kind::Volume(format) => Ok(format),
        other => Err(Fault::UnknownKind {
            found: format!("a {other}"),
            purpose: "volume",
            supported: VOLUMES,
        }),
    }
}
