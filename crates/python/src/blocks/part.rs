//! What a worker does with the parts of blocks.

use std::sync::Arc;

use bspline::HierarchicalSpline;
use bspline::hierarchical::{BRICK, BrickKey, Corrections, DenseCorrections, LevelCorrections, digest_below};
use fitting::FitReport;
use formats::field::{AnyField, FieldMeta, Stored, encode_part};
use numpy::{PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use super::ticket::{Ticket, summed};
use super::{LEAF, LEVELS, Levels, along, lattice};
use crate::arrays::affine;
use crate::failure::Failure;
use crate::field::{CoreField, fitted};
use crate::run::brief;

/// Of a fit of a block with its halo the part that is the block's own.
///
/// `origin` is the voxel of the whole volume of `shape` voxels at which the fit begins: a multiple of 32, or of 8 where the finest
/// level alone has functions. The part is what lies from voxel `low` on, and to before `high`; such multiples too, but at the
/// end of the volume. `mask` says which functions of the finest level are taken, by the voxels they lie on, from `origin` on; all
/// functions if it is not given.
#[pyfunction]
pub fn block_part<'py>(
    py: Python<'py>,
    core: PyRef<'py, CoreField>,
    origin: [u32; 3],
    low: [u32; 3],
    high: [u32; 3],
    shape: [u32; 3],
    mask: Option<PyReadonlyArray3<'py, u8>>,
) -> PyResult<Bound<'py, PyBytes>> {
    let AnyField::F32(field) = core.stored()? else {
        return Err(Failure::value("blocks are put together in single precision; fit them so").into());
    };
    let taking = Taking {
        origin,
        low,
        high,
        shape,
        mask,
    };
    let mut levels = Levels::default();
    for (level, all) in levels.iter_mut().enumerate().take(field.level_count()) {
        *all = taking.of_level(level, &field.corrections(level))?;
    }
    Ok(PyBytes::new(py, &encode_part(&levels, field.slope())))
}

/// What is taken of a fit: see [`block_part`].
struct Taking<'py> {
    origin: [u32; 3],
    low: [u32; 3],
    high: [u32; 3],
    shape: [u32; 3],
    mask: Option<PyReadonlyArray3<'py, u8>>,
}

impl Taking<'_> {
    fn of_level(&self, level: usize, own: &LevelCorrections<f32>) -> Result<LevelCorrections<f32>, Failure> {
        let mut taken = LevelCorrections::new();
        let along = along(level);
        if !own.is_empty() && self.origin.iter().chain(&self.low).any(|v| v % along != 0) {
            return Err(Failure::value(format!(
                "blocks begin at voxels {:?} and {:?}; multiples of {along} are needed",
                self.origin, self.low
            )));
        }
        for (key, functions) in own {
            let place: [u32; 3] = std::array::from_fn(|a| key.0[a] + self.origin[a] / along);
            let is_own = (0..3).all(|a| {
                // What lies beyond the last voxel belongs to the last block.
                let is_last = self.high[a] >= self.shape[a];
                place[a] >= self.low[a] / along && (is_last || place[a] < self.high[a] / along)
            });
            if is_own && let Some(functions) = self.unmasked(level, *key, functions) {
                taken.insert(BrickKey(place), functions);
            }
        }
        Ok(taken)
    }

    /// The functions of a brick that the mask has, if there are any; those off the voxels go with the next one.
    fn unmasked(
        &self,
        level: usize,
        key: BrickKey,
        functions: &Arc<Corrections<f32>>,
    ) -> Option<Arc<Corrections<f32>>> {
        let Some(mask) = &self.mask else {
            return Some(functions.clone());
        };
        let (dims, mask) = (mask.shape(), mask.as_array());
        let mut left = DenseCorrections::empty();
        for (slot, value) in functions.iter().filter(|_| level + 1 == LEVELS) {
            let function = [slot / 64, slot / 8 % 8, slot % 8];
            let at: [usize; 3] = std::array::from_fn(|a| {
                let voxel = (key.0[a] as usize * BRICK + function[a]).saturating_sub(1);
                voxel.min(dims[a] - 1)
            });
            if mask[at] != 0 {
                left.set(function, value);
            }
        }
        (left.mask != [0; BRICK]).then(|| Arc::new(left.pack()))
    }
}

/// The sum of parts round a block, as a field of the box from voxel `origin`, a multiple of 32, to before `end`, one too but at the
/// end of the volume. It is right from voxel `low` to before `high`: functions that do not reach there are left out.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "Python names them")]
pub fn near_field(
    py: Python<'_>,
    parts: Vec<Ticket>,
    shape: [u32; 3],
    affine: [[f64; 4]; 3],
    origin: [u32; 3],
    end: [u32; 3],
    low: [u32; 3],
    high: [u32; 3],
) -> PyResult<CoreField> {
    let whole = lattice(shape, self::affine(affine));
    if (0..3).any(|a| {
        !origin[a].is_multiple_of(along(0)) || (!end[a].is_multiple_of(along(0)) && end[a] < shape[a])
    }) {
        return Err(Failure::value(format!(
            "a box begins at voxels {origin:?} and ends at {end:?}; multiples of 32 are needed"
        ))
        .into());
    }
    let mut near = whole;
    near.cells = std::array::from_fn(|a| match end[a] < shape[a] {
        true => (end[a] - origin[a]) / LEAF,
        false => whole.cells[a] - origin[a] / LEAF,
    });
    near.world_from_lattice.translation = whole
        .world_from_lattice
        .transform_point3(glam::UVec3::from_array(origin.map(|v| v / LEAF)).as_dvec3());
    brief(py, || {
        // Functions of brick b are centred on knots 8b - 1 to 8b + 6, and reach two knots farther.
        let reaches = |level: usize, key: [u32; 3]| {
            let step = i64::from(along(level)) / BRICK as i64;
            (0..3).all(|a| {
                let first = i64::from(key[a]) * BRICK as i64 - 3;
                key[a] >= origin[a] / along(level)
                    && first * step < i64::from(high[a])
                    && (first + 11) * step > i64::from(low[a]) - 1
            })
        };
        let (sums, slope) = summed(&parts, &whole, reaches)?;
        let mut levels = Vec::with_capacity(LEVELS);
        for (level, bricks) in sums.into_iter().enumerate() {
            let last = near.cells_at(level).map(|n| n + 2);
            let shifted = bricks.into_iter().filter_map(|(key, functions)| {
                let key: [u32; 3] = std::array::from_fn(|a| key.0[a] - origin[a] / along(level));
                let functions = within(key, functions, last)?;
                Some((BrickKey(key), functions))
            });
            levels.push(shifted.collect());
        }
        let field = HierarchicalSpline::try_from_corrections(near, slope, levels)?;
        Ok(fitted(
            f32::any(field),
            FitReport::default(),
            FieldMeta::default(),
        ))
    })
}

/// The functions of a brick up to slot `last` of the grid, if there are any.
fn within(key: [u32; 3], functions: Arc<Corrections<f32>>, last: [u32; 3]) -> Option<Arc<Corrections<f32>>> {
    if (0..3).any(|a| key[a] * BRICK as u32 > last[a]) {
        return None;
    }
    if (0..3).all(|a| key[a] * BRICK as u32 + 7 <= last[a]) {
        return Some(functions);
    }
    let mut left = DenseCorrections::empty();
    for (slot, value) in functions.iter() {
        let place = [slot / 64, slot / 8 % 8, slot % 8];
        if (0..3).all(|a| key[a] * BRICK as u32 + place[a] as u32 <= last[a]) {
            left.set(place, value);
        }
    }
    (left.mask != [0; BRICK]).then(|| Arc::new(left.pack()))
}

/// What a block gives in the end: its parts added up, if they are several; its functions on each level; its bricks of level 0
/// with the digests of what is in their places, for each three keys (u32) and 32 bytes; the slope of its fit.
#[pyfunction]
pub fn finished_block<'py>(py: Python<'py>, parts: Vec<Ticket>, shape: [u32; 3]) -> PyResult<Finished<'py>> {
    let whole = lattice(shape, glam::DAffine3::IDENTITY);
    let (bytes, counts, digests, slope) = brief(py, || {
        let (sums, slope) = summed(&parts, &whole, |_, _| true)?;
        let bytes = (parts.len() > 1).then(|| encode_part(&sums, slope));
        let counts = sums.each_ref().map(|l| l.values().map(|c| c.count()).sum());
        let mut keys: Vec<BrickKey> = (sums.iter().enumerate())
            .flat_map(|(level, bricks)| bricks.keys().map(move |key| BrickKey(key.0.map(|k| k >> level))))
            .collect();
        keys.sort_unstable();
        keys.dedup();
        let mut digests = Vec::new();
        for key in keys {
            if let Some(digest) = digest_below(&sums, key) {
                key.0.iter().for_each(|k| digests.extend(k.to_le_bytes()));
                digests.extend(digest);
            }
        }
        Ok((bytes, counts, digests, slope))
    })?;
    let bytes = bytes.map(|bytes| PyBytes::new(py, &bytes));
    Ok((bytes, counts, PyBytes::new(py, &digests), slope))
}

/// See [`finished_block`].
type Finished<'py> = (
    Option<Bound<'py, PyBytes>>,
    [usize; LEVELS],
    Bound<'py, PyBytes>,
    f64,
);
