//! What a caller may ask of a volume before it is read.

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
    /// Which of the volumes of a file or series, from 0: time steps, echoes, channels. Needed where there are several.
    pub volume: Option<usize>,
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
            volume: None,
            raw: None,
            dicom: DicomOptions::default(),
        }
    }
}

/// Choices for DICOM series.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DicomOptions {
    /// Which series, by its number or its unique identifier; needed where there are several volumes.
    pub series: Option<String>,
    /// What to do about slices at uneven distances, a missing one included.
    pub uneven: Uneven,
    /// What to do about slices that are tilted against their stack.
    pub tilt: Tilt,
}

/// What to do about slices at uneven distances.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Uneven {
    /// An error that says where.
    #[default]
    Refuse,
    /// Linear interpolation along the stack, at the smallest distance that occurs.
    Resample,
}

/// What to do about a tilted gantry.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tilt {
    /// The voxels stay where they were measured, on a grid with an oblique axis: nothing is lost.
    #[default]
    Keep,
    /// Linear interpolation onto a grid with right angles, for formats and programs that need them.
    Resample,
}
