//! NIfTI, one file: the bytes of the voxels are changed where they lie.

use std::io::Write;
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;

use crate::file_name::{extension, is_gz_name};
use crate::limits::Budget;
use crate::volumes::encode::LEVEL;
use crate::volumes::nifti::places;
use crate::volumes::revision::{Change, Revision, Scale, put};
use crate::{Fault, atomic, input};

pub(super) fn revise(
    like: &Path,
    volume: Option<usize>,
    changes: &[Change],
    output: &Path,
    budget: &mut Budget,
) -> Result<Revision, Fault> {
    if extension(output) != "nii" {
        return Err(Fault::Value {
            what: "the name of the output",
            value: output.display().to_string(),
            remedy: "an edited NIfTI volume is written as .nii or .nii.gz",
        });
    }
    let mut bytes = input::open(like)?.read_all(budget)?;
    let places = places(&bytes, volume)?;
    let scale = Scale::of(places.stored, places.rescale);
    let voxels = &mut bytes[places.bytes];
    let size = places.stored.size();
    let mut told = Revision::default();
    for change in changes {
        let number = scale.number(change.density, &mut told);
        let place = &mut voxels[change.voxel * size..][..size];
        told.changed += usize::from(put(place, places.stored, places.big_endian, number));
    }
    let written = atomic::replace(output, |out| match is_gz_name(output) {
        true => {
            let mut gz = GzEncoder::new(out, Compression::new(LEVEL));
            gz.write_all(&bytes)?;
            gz.finish().map(drop)
        }
        false => out.write_all(&bytes),
    });
    written.map_err(|e| e.fault)?;
    Ok(told)
}
