//! A series as slices of a volume.

use glam::{DAffine3, DMat3};

use super::DicomOptions;
use super::check::{frame_count, goes_with, is_scalar, layout_of, voxel_type};
use super::decode::Decoder;
use super::pixels::Rescale;
use super::plane::{self, Plane};
use super::resample::Blend;
use super::scan::{File, Found};
use super::stack::{self, Grid, Slice};
use crate::limits::Budget;
use crate::volumes::geometry::{RAS_FROM_LPS, checked_dims, in_world, usable};
use crate::volumes::slices::SliceSource;
use crate::volumes::volume::{Orientation, VolumeHeader};
use crate::{Fault, Unit};

/// The slices of a series, each decoded when it is asked for.
pub(super) struct Series {
    header: VolumeHeader,
    slices: Vec<Slice>,
    next: usize,
    planes: Planes,
    blend: Option<Blend>,
    working_bytes: u64,
    notes: Vec<String>,
}

/// The pictures of a series in order.
struct Planes {
    files: Vec<File>,
    all: Vec<Plane>,
    /// Pictures that have to equal the one with that index, in the order of the indices.
    copies: Vec<(usize, Plane)>,
    decoder: Decoder,
    /// A copy, to compare.
    copy: Vec<f32>,
}

impl Series {
    /// Arranges the files of a series; `volume` is which of several at the same positions is meant.
    ///
    /// # Errors
    /// [`Fault::Value`] for what a volume cannot be made of, [`Fault::Truncated`] for pixels that are not all there.
    pub fn new(
        found: Found,
        options: &DicomOptions,
        volume: Option<usize>,
        budget: &mut Budget,
    ) -> Result<Self, Fault> {
        let Found { files, mut notes } = found;
        let mut planes = Vec::new();
        for (i, file) in files.iter().enumerate() {
            let inside = |fault: Fault| fault.inside(&file.name);
            is_scalar(&file.data).map_err(inside)?;
            goes_with(&files[0], file)?;
            let count = frame_count(&file.data).map_err(inside)?;
            // Twice while the vector grows, parted from copies, and the slices that are made of them.
            budget.reserve(
                "the positions of the pictures",
                count.into(),
                5 * size_of::<Plane>(),
            )?;
            planes.extend(plane::of_file(&file.data, i as u32, count).map_err(inside)?);
        }
        let first = &files[0].data;
        let plane_dims = [first.columns as usize, first.rows as usize];
        let name = |p: &Plane| {
            let file = &files[p.file as usize];
            if file.data.frame_count.is_some_and(|n| n > 1) {
                format!("{} frame {}", file.name, p.frame + 1)
            } else {
                file.name.clone()
            }
        };
        let common = first.frames.first().unwrap_or(&first.common).or(&first.common);
        let step = common.between_slices.map(f64::abs).or(common.thickness);
        let step = step.filter(|s| (1e-6..1e6).contains(s));
        let stack = stack::arrange(planes, plane_dims, step, options, volume, &name)?;
        notes.extend(stack.notes);
        let bare = files.iter().filter(|f| !f.data.has_preamble).count();
        if bare > 0 {
            notes.push(format!(
                "{bare} files have no DICOM preamble; they were read as elements from their first byte"
            ));
        }
        if first.format.photometric == "MONOCHROME1" {
            notes.push(
                "small values are meant to look bright (MONOCHROME1); they are kept as they are".into(),
            );
        }
        let grid = stack.grid;
        let header = VolumeHeader {
            dims: checked_dims(grid.dims.map(|n| n as i64))?,
            world_from_voxel: usable(ras(&grid))?,
            unit: Unit::Millimetre,
            orientation: Orientation::Directions,
            stored: voxel_type(&layout_of(first)),
            rescale: rescaling(&stack.planes, &mut notes),
        };
        let is_whole = |s: &Slice| s.above == 0.0 && s.shift == [0.0; 2];
        let is_resampled = grid.dims[..2] != plane_dims || !grid.slices.iter().all(is_whole);
        let volume_bytes = header.voxel_count() as u64 * 4;
        let decoder = Decoder::new(&files, volume_bytes, budget)?;
        let copy_pixels = if stack.copies.is_empty() {
            0
        } else {
            plane_dims[0] * plane_dims[1]
        };
        let blending = if is_resampled { Blend::bytes(plane_dims) } else { 0 };
        Ok(Self {
            header,
            slices: grid.slices,
            next: 0,
            blend: is_resampled.then(|| Blend::new(plane_dims)),
            working_bytes: decoder.working_bytes() + blending + 4 * copy_pixels as u64,
            planes: Planes {
                files,
                all: stack.planes,
                copies: stack.copies,
                decoder,
                copy: Vec::new(),
            },
            notes,
        })
    }
}

/// The files of a series, and for each slice of the volume the pictures that show it.
pub(super) struct Pictures {
    pub files: Vec<File>,
    pub slices: Vec<Vec<Plane>>,
    pub pixels_per_slice: usize,
}

impl Series {
    /// Where each slice comes from; `None` if slices are made of several pictures.
    pub fn into_pictures(self) -> Option<Pictures> {
        if self.blend.is_some() {
            return None;
        }
        let Planes {
            files, all, copies, ..
        } = self.planes;
        let slices = self.slices.iter().map(|slice| {
            let of_slice = copies.iter().filter(|(i, _)| *i == slice.below);
            let copies = of_slice.map(|(_, copy)| copy.clone());
            std::iter::once(all[slice.below].clone()).chain(copies).collect()
        });
        Some(Pictures {
            slices: slices.collect(),
            pixels_per_slice: self.header.dims[0] * self.header.dims[1],
            files,
        })
    }
}

/// Voxel to RAS: x and y of DICOM's patient space point the other way.
fn ras(grid: &Grid) -> DAffine3 {
    let [x, y, z] = grid.steps;
    let lps = DAffine3 {
        matrix3: DMat3::from_cols(x, y, z),
        translation: grid.origin,
    };
    in_world(&lps, RAS_FROM_LPS)
}

/// The rescaling that all pictures share, if there is one.
fn rescaling(planes: &[Plane], notes: &mut Vec<String>) -> Option<[f64; 2]> {
    let first = planes[0].rescale;
    if planes.iter().any(|p| p.rescale != first) {
        let slopes = || planes.iter().map(|p| p.rescale.slope);
        notes.push(format!(
            "each picture has a rescaling of its own (slopes {} to {}), which was used",
            slopes().fold(f64::INFINITY, f64::min),
            slopes().fold(f64::NEG_INFINITY, f64::max)
        ));
        return None;
    }
    (first != Rescale::NONE).then_some([first.slope, first.intercept])
}

impl Planes {
    /// Reads a picture, and those at the same position, which have to show the same.
    fn read(&mut self, index: usize, out: &mut [f32]) -> Result<(), Fault> {
        self.decoder.read_in_order(&self.files, &self.all, index, out)?;
        let from = self.copies.partition_point(|(i, _)| *i < index);
        for (_, copy) in self.copies[from..].iter().take_while(|(i, _)| *i == index) {
            self.copy.resize(out.len(), 0.0);
            self.decoder.read(&self.files, copy, &mut self.copy)?;
            let is_same = |(a, b): (&f32, &f32)| a.to_bits() == b.to_bits();
            if !out.iter().zip(&self.copy).all(is_same) {
                let name = |p: &Plane| self.files[p.file as usize].name.clone();
                return Err(Fault::Value {
                    what: "the picture at one position",
                    value: format!("different in {} and {}", name(&self.all[index]), name(copy)),
                    remedy: "move the one that does not belong to the volume to another directory",
                });
            }
        }
        Ok(())
    }
}

impl SliceSource for Series {
    fn header(&self) -> &VolumeHeader {
        &self.header
    }

    fn notes(&mut self) -> Vec<String> {
        let mut notes = std::mem::take(&mut self.notes);
        let padded = self.planes.decoder.take_padded();
        if padded > 0 {
            notes.push(format!(
                "{padded} pixels hold the padding value, which marks what was not measured; they are kept as they are"
            ));
        }
        notes
    }

    fn next_slice(&mut self, out: &mut [f32]) -> Result<(), Fault> {
        let slice = self.slices[self.next];
        self.next += 1;
        let [columns, rows, _] = self.header.dims;
        match &mut self.blend {
            None => self.planes.read(slice.below, out),
            Some(blend) => blend.slice(&slice, [columns, rows], out, |i, plane| {
                self.planes.read(i, plane)
            }),
        }
    }

    fn skip_slice(&mut self) -> Result<(), Fault> {
        self.next += 1;
        Ok(())
    }

    fn working_bytes(&self) -> u64 {
        self.working_bytes
    }

    fn may_have_gaps(&self) -> bool {
        self.blend.is_some()
    }

    fn finish(&mut self) -> Result<(), Fault> {
        Ok(())
    }
}
