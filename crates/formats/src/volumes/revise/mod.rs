//! A volume written again with new densities at some voxels: all else of the file stays as it is, to the bit.

mod nifti;

use std::path::Path;

use super::dicom;
use super::open::format_of;
use super::options::VolumeOptions;
use super::revision::{Change, Revision};
use crate::kind::{Kind, VolumeFormat};
use crate::limits::Budget;
use crate::{Fault, FormatError, ReadLimits};

/// Writes the volume `like` to `output` with `changes`, which are in ascending order of their voxels.
///
/// | `like` | `output` | what else changes |
/// | --- | --- | --- |
/// | NIfTI, one file | `.nii` or `.nii.gz` | nothing |
/// | DICOM series | a new directory, the files under their names | new SOP and series UIDs, made from `identity`; image type `DERIVED`; a reference to each source; explicit little endian |
///
/// # Errors
/// Those of [`read`](super::read); [`Fault::Value`] for what is not written back: other formats, pairs of files, a part, a
/// stride or another spacing than the file's, slices that had to be resampled; I/O. The target is whole or untouched.
///
/// # Panics
/// If a voxel is beyond the volume.
pub fn save_revised(
    like: &Path,
    options: &VolumeOptions,
    changes: &[Change],
    identity: &[u8; 32],
    output: &Path,
    limits: &ReadLimits,
) -> Result<Revision, FormatError> {
    let revise = || {
        if options.region.is_some() || options.stride != [1; 3] || options.spacing_mm.is_some() {
            return Err(Fault::Value {
                what: "the part of the volume",
                value: "a region, a stride or another spacing".into(),
                remedy: "an edited volume is written as a whole, with its own geometry",
            });
        }
        let format = match options.raw {
            Some(_) => VolumeFormat::Raw,
            None => format_of(like)?,
        };
        let mut budget = Budget::new(limits);
        match format {
            VolumeFormat::Nifti => nifti::revise(like, options.volume, changes, output, &mut budget),
            VolumeFormat::Dicom => {
                dicom::revise::revise(like, options, changes, identity, output, &mut budget)
            }
            other => Err(Fault::Value {
                what: "the format of the scan",
                value: Kind::Volume(other).to_string(),
                remedy: "edited volumes are written as NIfTI in one file or as DICOM; convert the scan to .nii and \
                         fit that",
            }),
        }
    };
    revise().map_err(|fault| fault.at(like))
}
