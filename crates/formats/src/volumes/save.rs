//! Volumes out, slice by slice: the format is told by the name.

use std::io;
use std::path::Path;

use glam::DAffine3;

use super::encode::{Grid, NextSlice, Slices};
use super::voxel::StoreAs;
use super::vti;
#[cfg(feature = "medical")]
use super::{metaimage, nifti, nrrd};
use crate::atomic::directory_of;
use crate::file_name::{extension, is_gz_name};
use crate::{Fault, FormatError, Unit};

/// Writes a volume that is in memory: see [`save_slices`].
///
/// `values` are in file order, `values[x + nx·(y + ny·z)]`.
///
/// # Errors
/// As [`save_slices`].
///
/// # Panics
/// If `values` is not `nx·ny·nz` long.
pub fn save(
    path: &Path,
    dims: [usize; 3],
    values: &[f32],
    world_from_voxel: &DAffine3,
    unit: Unit,
    store: StoreAs,
) -> Result<(), FormatError> {
    let grid = Grid {
        dims,
        world_from_voxel: *world_from_voxel,
        unit,
    };
    assert_eq!(
        values.len(),
        dims.iter().product::<usize>(),
        "one value per voxel"
    );
    let slice = dims[0] * dims[1];
    save_slices(path, &grid, store, |z, out: &mut [f32]| {
        out.copy_from_slice(&values[z * slice..][..slice]);
        Ok::<(), FormatError>(())
    })
}

/// Writes a volume atomically and holds one slice of it at a time.
///
/// | name | format | the map from voxels to the world |
/// | --- | --- | --- |
/// | `.nii`, `.nii.gz` | NIfTI-1 | sform, in single precision: all that NIfTI-1 has |
/// | `.nrrd` | NRRD, gzip | RAS, double precision |
/// | `.mha` | MetaImage, zlib | LPS, double precision |
/// | `.vti` | VTK ImageData, zlib | origin, spacing and direction, RAS, double precision; VTK names no unit |
///
/// `fill(z, out)` is called once for each slice, in order, and writes all of `out`, `nx·ny` densities, x fastest.
/// `.mha` and `.vti` need to know the compressed length first: for a while a nameless file beside the output
/// holds the compressed voxels.
///
/// # Errors
/// Those of `fill`; [`Fault::Output`] for dimensions or a `store` that the format cannot hold,
/// [`Fault::UnknownKind`] for another name, I/O. The target is whole or untouched.
pub fn save_slices<E: From<FormatError>>(
    path: &Path,
    grid: &Grid,
    store: StoreAs,
    mut fill: impl FnMut(usize, &mut [f32]) -> Result<(), E>,
) -> Result<(), E> {
    let mut failed = None;
    let mut next = |z: usize, out: &mut [f32]| {
        fill(z, out).map_err(|e| {
            failed = Some(e);
            io::Error::other("the slice cannot be had")
        })
    };
    let result = save_with(path, grid, store, &mut next);
    match failed {
        Some(e) => Err(e),
        None => result.map_err(E::from),
    }
}

fn save_with(path: &Path, grid: &Grid, store: StoreAs, next: &mut NextSlice) -> Result<(), FormatError> {
    let slices = Slices {
        grid,
        store,
        next,
        scratch: directory_of(path),
    };
    let is_gz = is_gz_name(path);
    match extension(path).as_str() {
        #[cfg(feature = "medical")]
        "nii" => nifti::write(path, slices, is_gz),
        #[cfg(feature = "medical")]
        "nrrd" if !is_gz => nrrd::write(path, slices),
        #[cfg(feature = "medical")]
        "mha" if !is_gz => metaimage::write(path, slices),
        "vti" if !is_gz => vti::write(path, slices),
        #[cfg(not(feature = "medical"))]
        "nii" | "nrrd" | "mha" => Err(Fault::left_out("a volume of this format", "medical").at(path)),
        other => Err(Fault::UnknownKind {
            found: format!(".{other}{}", if is_gz { ".gz" } else { "" }),
            purpose: "volume output",
            supported: ".nii, .nii.gz, .nrrd, .mha and .vti",
        }
        .at(path)),
    }
}
