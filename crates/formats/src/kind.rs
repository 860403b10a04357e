//! Kinds of files.

use std::fmt;

/// What a file holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Points, for [`crate::points::read`]; PLY and OBJ may hold faces too, for [`crate::meshes::read`].
    Cloud(PointFormat),
    /// A mesh, for [`crate::meshes::read`]; [`crate::points::read`] takes its vertices.
    Mesh(MeshFileFormat),
    /// A volume, for [`crate::volumes::read`].
    Volume(VolumeFormat),
    /// A fitted field, for [`crate::field::load`].
    Field,
}

/// Formats of point clouds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointFormat {
    /// Polygon file format.
    Ply,
    /// A point a line.
    Xyz,
    /// Wavefront OBJ.
    Obj,
    /// Point Cloud Library.
    Pcd,
    /// LAS, compressed (LAZ) or not.
    Las,
    /// ASTM E57.
    E57,
}

/// Formats that hold meshes and nothing else.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshFileFormat {
    /// Stereolithography, ascii or binary.
    Stl,
    /// glTF 2.0, text or binary.
    Gltf,
    /// 3D Manufacturing Format.
    ThreeMf,
    /// VRML97.
    Vrml,
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Volume(format) => return write!(f, "volume ({format})"),
            Self::Cloud(PointFormat::Ply) => "point cloud (PLY)",
            Self::Cloud(PointFormat::Xyz) => "point cloud (XYZ)",
            Self::Cloud(PointFormat::Obj) => "point cloud (OBJ)",
            Self::Cloud(PointFormat::Pcd) => "point cloud (PCD)",
            Self::Cloud(PointFormat::Las) => "point cloud (LAS)",
            Self::Cloud(PointFormat::E57) => "point cloud (E57)",
            Self::Mesh(MeshFileFormat::Stl) => "mesh (STL)",
            Self::Mesh(MeshFileFormat::ThreeMf) => "mesh (3MF)",
            Self::Mesh(MeshFileFormat::Vrml) => "mesh (VRML)",
            Self::Mesh(MeshFileFormat::Gltf) => "mesh (glTF)",
            Self::Field => "field",
        })
    }
}

/// Formats of volumes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VolumeFormat {
    /// One NIfTI file.
    Nifti,
    /// A NIfTI header with its image beside it.
    NiftiPair,
    /// A DICOM series: a directory, one of its files, or one file of several frames.
    Dicom,
    /// NRRD, its voxels in the same file or in others.
    Nrrd,
    /// MetaImage, its voxels in the same file or in others.
    MetaImage,
    /// The pages of a TIFF file.
    Tiff,
    /// The TIFF files of a directory, a slice each.
    TiffFolder,
    /// Voxels without a header, told by [`crate::volumes::VolumeOptions::raw`] alone.
    Raw,
}

impl fmt::Display for VolumeFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Nifti => "NIfTI",
            Self::NiftiPair => "NIfTI header and image",
            Self::Dicom => "DICOM",
            Self::Nrrd => "NRRD",
            Self::MetaImage => "MetaImage",
            Self::Tiff => "TIFF stack",
            Self::TiffFolder => "directory of TIFF slices",
            Self::Raw => "raw",
        })
    }
}

pub(crate) const CLOUDS: &str =
    "point clouds .ply .obj .pcd .las .laz .e57 .xyz .xyzn .txt .asc .csv .pts, each also .gz";
pub(crate) const MESHES: &str = "meshes .ply .obj .stl .gltf .glb .3mf .wrl, each also .gz";
pub(crate) const SUPPORTED: &str = "point clouds .ply .obj .pcd .las .laz .e57 .xyz .xyzn .txt .asc .csv .pts, meshes .ply .obj .stl .gltf .glb \
                         .3mf .wrl, volumes .nii .hdr .nrrd .nhdr .mha .mhd .tif, each also .gz, directories of DICOM \
                         or .tif slices, and fields .iclay; voxels without a header need their layout stated";
