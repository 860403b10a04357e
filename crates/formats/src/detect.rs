//! What a file is: by its content where that tells, otherwise by its name.

use std::io::Read;
use std::path::Path;

use crate::file_name::extension;
use crate::input::{self, read_fault};
use crate::kind::{Kind, MeshFileFormat, PointFormat, SUPPORTED, VolumeFormat};
#[cfg(feature = "cad")]
use crate::meshes::{gltf::looks_like_gltf, threemf::looks_like_3mf, vrml::looks_like_vrml};
use crate::points::pcd::looks_like_pcd;
use crate::volumes::tiff::{is_stack_folder, looks_like_tiff};
#[cfg(feature = "medical")]
use crate::volumes::{
    dicom::{holds_dicom, looks_like_dicom},
    metaimage::looks_like_metaimage,
    nifti::nifti_format,
    nrrd::looks_like_nrrd,
};
use crate::{Fault, FormatError, field};

/// Bytes that are enough to know every content that can be known.
const LOOK: usize = 400;

/// Tells what `path` holds, inflating gzip as needed. Reads a few hundred bytes, of a
/// directory those of its files until one is DICOM.
///
/// # Errors
/// [`Fault::UnknownKind`] with what is supported; [`Fault::Empty`]; I/O.
pub fn detect(path: &Path) -> Result<Kind, FormatError> {
    let look = || {
        if path.is_dir() {
            return kind_of_directory(path);
        }
        let mut input = input::open(path)?;
        let mut head = Vec::with_capacity(LOOK);
        (&mut input.source)
            .take(LOOK as u64)
            .read_to_end(&mut head)
            .map_err(read_fault)?;
        kind_of(&head, path)
    };
    look().map_err(|fault| fault.at(path))
}

/// What a directory holds, seen by the files in it.
fn kind_of_directory(path: &Path) -> Result<Kind, Fault> {
    #[cfg(feature = "medical")]
    if holds_dicom(path)? {
        return Ok(Kind::Volume(VolumeFormat::Dicom));
    }
    if is_stack_folder(path)? {
        return Ok(Kind::Volume(VolumeFormat::TiffFolder));
    }
    Err(Fault::UnknownKind {
        found: "a directory without DICOM or TIFF files".into(),
        purpose: "input",
        supported: SUPPORTED,
    })
}

/// Kind of a content that starts with `head`, in a file called `path`.
pub(crate) fn kind_of(head: &[u8], path: &Path) -> Result<Kind, Fault> {
    if head.is_empty() {
        return Err(Fault::Empty);
    }
    if head.starts_with(b"ply\n") || head.starts_with(b"ply\r") || head.starts_with(b"ply ") {
        return Ok(Kind::Cloud(PointFormat::Ply));
    }
    if looks_like_pcd(head) {
        return Ok(Kind::Cloud(PointFormat::Pcd));
    }
    if head.starts_with(&field::MAGIC) {
        return Ok(Kind::Field);
    }
    if head.starts_with(b"LASF") {
        return Ok(Kind::Cloud(PointFormat::Las));
    }
    if head.starts_with(b"ASTM-E57") {
        return Ok(Kind::Cloud(PointFormat::E57));
    }
    #[cfg(feature = "medical")]
    if let Some(format) = nifti_format(head) {
        return Ok(Kind::Volume(format));
    }
    #[cfg(feature = "cad")]
    if let Some(format) = mesh_format(head) {
        return Ok(Kind::Mesh(format));
    }
    if head.starts_with(b"solid") && memchr::memmem::find(head, b"facet").is_some() {
        return Ok(Kind::Mesh(MeshFileFormat::Stl));
    }
    #[cfg(feature = "medical")]
    if let Some(format) = volume_format(head) {
        return Ok(Kind::Volume(format));
    }
    if looks_like_tiff(head) {
        return Ok(Kind::Volume(VolumeFormat::Tiff));
    }
    let extension = extension(path);
    match extension.as_str() {
        "ply" => Ok(Kind::Cloud(PointFormat::Ply)),
        "xyz" | "xyzn" | "txt" | "asc" | "csv" | "pts" => Ok(Kind::Cloud(PointFormat::Xyz)),
        "las" | "laz" => Ok(Kind::Cloud(PointFormat::Las)),
        "e57" => Ok(Kind::Cloud(PointFormat::E57)),
        "pcd" => Ok(Kind::Cloud(PointFormat::Pcd)),
        "obj" => Ok(Kind::Cloud(PointFormat::Obj)),
        "nii" => Ok(Kind::Volume(VolumeFormat::Nifti)),
        "nrrd" | "nhdr" => Ok(Kind::Volume(VolumeFormat::Nrrd)),
        "mha" | "mhd" => Ok(Kind::Volume(VolumeFormat::MetaImage)),
        "tif" | "tiff" => Ok(Kind::Volume(VolumeFormat::Tiff)),
        "hdr" | "img" => Ok(Kind::Volume(VolumeFormat::NiftiPair)),
        "gltf" | "glb" => Ok(Kind::Mesh(MeshFileFormat::Gltf)),
        "3mf" => Ok(Kind::Mesh(MeshFileFormat::ThreeMf)),
        "wrl" | "wrz" => Ok(Kind::Mesh(MeshFileFormat::Vrml)),
        "stl" => Ok(Kind::Mesh(MeshFileFormat::Stl)),
        "iclay" => Ok(Kind::Field),
        "" => Err(Fault::UnknownKind {
            found: "a name without an extension".into(),
            purpose: "input",
            supported: SUPPORTED,
        }),
        other => Err(Fault::UnknownKind {
            found: format!(".{other}"),
            purpose: "input",
            supported: SUPPORTED,
        }),
    }
}

#[cfg(feature = "cad")]
fn mesh_format(head: &[u8]) -> Option<MeshFileFormat> {
    if looks_like_gltf(head) {
        Some(MeshFileFormat::Gltf)
    } else if looks_like_3mf(head) {
        Some(MeshFileFormat::ThreeMf)
    } else {
        looks_like_vrml(head).then_some(MeshFileFormat::Vrml)
    }
}

#[cfg(feature = "medical")]
fn volume_format(head: &[u8]) -> Option<VolumeFormat> {
    if looks_like_dicom(head) {
        Some(VolumeFormat::Dicom)
    } else if looks_like_nrrd(head) {
        Some(VolumeFormat::Nrrd)
    } else {
        looks_like_metaimage(head).then_some(VolumeFormat::MetaImage)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_wins_over_the_name_and_the_name_over_nothing() {
        let kind = |head: &[u8], name: &str| kind_of(head, Path::new(name));
        assert_eq!(
            kind(b"ply\nformat", "scan.obj").unwrap(),
            Kind::Cloud(PointFormat::Ply)
        );
        assert_eq!(kind(&field::MAGIC, "x").unwrap(), Kind::Field);
        assert_eq!(
            kind(b"v 1 2 3", "a.OBJ.gz").unwrap(),
            Kind::Cloud(PointFormat::Obj)
        );
        assert_eq!(kind(b"1 2 3", "a.b.csv").unwrap(), Kind::Cloud(PointFormat::Xyz));
        assert!(matches!(kind(b"", "a.ply"), Err(Fault::Empty)));
        for name in ["scan.step", "scan", "scan.gz"] {
            let e = kind(b"ISO-10303", name).unwrap_err().to_string();
            assert!(
                e.contains(".ply") && e.contains(".nii") && e.contains(".iclay"),
                "{e}"
            );
        }
    }
}
