//! Slices of a volume in order: the one thing that every volume reader gives. What stands above it (a region, a
//! stride, the check of the densities, the memory) is written once, here and in [`super::part`].

use super::volume::{ValueRange, Volume, VolumeHeader};
use super::voxel::VoxelType;
use crate::Fault;
use crate::limits::Budget;

/// Slices of a volume along its third axis, in order.
///
/// Each slice is taken once, by [`next_slice`](Self::next_slice) or [`skip_slice`](Self::skip_slice); then
/// [`finish`](Self::finish). Memory that opening the source has booked stays booked.
pub(crate) trait SliceSource {
    /// Header of the whole volume.
    fn header(&self) -> &VolumeHeader;

    /// Repairs and doubts met so far, each given once.
    fn notes(&mut self) -> Vec<String>;

    /// Decodes the next slice into `out`: `nx·ny` densities, x fastest, rescaled, maybe not finite.
    fn next_slice(&mut self, out: &mut [f32]) -> Result<(), Fault>;

    /// Passes over the next slice as cheaply as the format can.
    fn skip_slice(&mut self) -> Result<(), Fault>;

    /// Bytes that the source holds while it reads, besides `out` and what was booked when it was opened.
    fn working_bytes(&self) -> u64;

    /// Whether densities may be NaN though the stored numbers cannot: where there is no data to resample.
    fn may_have_gaps(&self) -> bool {
        false
    }

    /// Called after the last slice: checks what follows it, such as a checksum.
    fn finish(&mut self) -> Result<(), Fault>;
}

/// Bytes that [`read`] will book.
pub(super) fn needed_bytes(source: &dyn SliceSource) -> u64 {
    let values = (source.header().voxel_count() as u64).saturating_mul(size_of::<f32>() as u64);
    values.saturating_add(source.working_bytes())
}

/// Reads all slices; densities that are not finite are repaired and counted.
pub(super) fn read(source: &mut dyn SliceSource, budget: &mut Budget) -> Result<Volume, Fault> {
    let header = source.header().clone();
    let count = header.voxel_count();
    budget.reserve("the volume", count as u64, size_of::<f32>())?;
    budget.reserve("the reading buffers", source.working_bytes(), 1)?;
    let mut values = zeros(count, budget.limit())?;
    let mut seen = Finite::of(source);
    for slice in values.chunks_exact_mut(header.dims[0] * header.dims[1]) {
        source.next_slice(slice)?;
        seen.look_at(slice);
    }
    source.finish()?;
    let mut notes = source.notes();
    if header.stored.exceeds_f32() {
        notes.push(format!("voxels of {} were rounded to float32", header.stored));
    }
    notes.extend(seen.repair(&mut values)?);
    Ok(Volume {
        header,
        values,
        replaced_count: seen.replaced_count,
        notes,
    })
}

/// Runs through all slices and holds one at a time.
pub(super) fn range(source: &mut dyn SliceSource, budget: &mut Budget) -> Result<ValueRange, Fault> {
    let [nx, ny, nz] = source.header().dims;
    budget.reserve("a slice", (nx * ny) as u64, size_of::<f32>())?;
    budget.reserve("the reading buffers", source.working_bytes(), 1)?;
    let mut slice = zeros(nx * ny, budget.limit())?;
    let (mut min, mut max, mut replaced_count) = (f32::INFINITY, f32::NEG_INFINITY, 0);
    for _ in 0..nz {
        source.next_slice(&mut slice)?;
        for v in slice.iter().filter(|v| v.is_finite()) {
            min = min.min(*v);
            max = max.max(*v);
        }
        replaced_count += not_finite(&slice);
    }
    source.finish()?;
    if min > max {
        return Err(no_finite_voxel(replaced_count));
    }
    Ok(ValueRange {
        min,
        max,
        replaced_count,
    })
}

/// Memory as the system gives it, zeroed without a pass over it; the attempt before tells a lack of it apart.
pub(super) fn zeros(count: usize, limit: u64) -> Result<Vec<f32>, Fault> {
    Vec::<f32>::new()
        .try_reserve_exact(count)
        .map_err(|_| Fault::Limit {
            what: "the volume",
            needed: count as u64 * 4,
            limit,
        })?;
    Ok(vec![0.0; count])
}

/// Densities that are not finite: counted slice by slice while these are in the cache.
struct Finite {
    can_be_infinite: bool,
    replaced_count: usize,
}

impl Finite {
    fn of(source: &dyn SliceSource) -> Self {
        let header = source.header();
        Self {
            can_be_infinite: source.may_have_gaps()
                || header.rescale.is_some()
                || matches!(header.stored, VoxelType::F32 | VoxelType::F64),
            replaced_count: 0,
        }
    }

    fn look_at(&mut self, slice: &[f32]) {
        if self.can_be_infinite {
            self.replaced_count += not_finite(slice);
        }
    }

    /// Sets them to the smallest density, which is outside of any solid.
    fn repair(&self, values: &mut [f32]) -> Result<Option<String>, Fault> {
        if self.replaced_count == 0 {
            return Ok(None);
        }
        if self.replaced_count == values.len() {
            return Err(no_finite_voxel(self.replaced_count));
        }
        let finite = values.iter().copied().filter(|v| v.is_finite());
        let least = finite.fold(f32::INFINITY, f32::min);
        for v in values.iter_mut().filter(|v| !v.is_finite()) {
            *v = least;
        }
        Ok(Some(format!(
            "{} of {} voxels are NaN or infinite; set to the smallest density, {least}",
            self.replaced_count,
            values.len()
        )))
    }
}

fn not_finite(values: &[f32]) -> usize {
    values.iter().filter(|v| !v.is_finite()).count()
}

fn no_finite_voxel(count: usize) -> Fault {
    Fault::Value {
        what: "the number of finite voxels",
        value: format!("0 of {count}"),
        remedy: "check how the volume was exported",
    }
}
