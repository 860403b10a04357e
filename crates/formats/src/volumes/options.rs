//! What a caller may ask of a volume before it is read.

use super::dicom::DicomOptions;
use super::raw::RawLayout;

/// Which part of a volume is read, and what its file does not say.
#[derive(Clone, Debug, PartialEq)]
pub struct VolumeOptions {
    /// Box of voxels, for each axis `[from, to)` counted in the file; `None`: all.
    pub region: Option<[[usize; 2]; 3]>,
    /// Every so many voxels along each axis, from the first of the region on; each at least 1. Voxels between are
    /// left out, not averaged: what is finer than the stride can appear as coarse waves.
    pub stride: [usize; 3],
    /// Distances between neighbouring voxels of the file in millimetres, stated by the user: they replace those of
    /// the file, the directions of the axes stay.
    pub spacing_mm: Option<[f64; 3]>,
    /// The file has voxels and no header: this is where they are, whatever the content looks like.
    pub raw: Option<RawLayout>,
    /// Choices for DICOM series.
    pub dicom: DicomOptions,
}

impl Default for VolumeOptions {
    /// The whole volume as it is.
    fn default() -> Self {
        Self {
            region: None,
            stride: [1; 3],
            spacing_mm: None,
            raw: None,
            dicom: DicomOptions::default(),
        }
    }
}
