//! Fields of large volumes, put together from fits of blocks.

use std::collections::BTreeMap;
use std::sync::Arc;

use bspline::HierarchicalSpline;
use bspline::hierarchical::{BRICK, BrickKey, DenseCorrections, Lattice, LevelCorrections};
use fitting::{FitReport, Leaf, StopReason};
use formats::field::{AnyField, FieldMeta, SourceKind, Stored};
use glam::{DAffine3, DVec3};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::arrays::affine;
use crate::failure::Failure;
use crate::field::{CoreField, fitted, unit_of};
use crate::run::brief;

/// Levels of a volume's field: knots every 4, 2 and 1 voxels.
const LEVELS: usize = 3;
/// Voxels along a leaf.
const LEAF: u32 = 4;

/// A fit of a block with its halo, of which a part is taken.
#[derive(FromPyObject)]
pub struct Part<'py> {
    /// The fit.
    #[pyo3(item("field"))]
    core: PyRef<'py, CoreField>,
    /// Voxel of the whole volume at which the fit begins: a multiple of 32, or of 8 where the finest level alone has functions.
    #[pyo3(item("origin"))]
    origin: [u32; 3],
    /// Voxels of the whole volume of which the fit is taken: from `low` on, and to before `high`; such multiples too, but at the
    /// end of the volume.
    #[pyo3(item("low"))]
    low: [u32; 3],
    #[pyo3(item("high"))]
    high: [u32; 3],
    /// Which functions of the finest level are taken, by the voxels they lie on, from `origin` on; all if none.
    #[pyo3(item("mask"))]
    mask: Option<PyReadonlyArray3<'py, u8>>,
}

/// Joins parts into the field of a volume of `shape` voxels, and adds them to `base` where there is one.
#[pyfunction]
pub fn join_blocks(
    py: Python<'_>,
    base: Option<PyRef<'_, CoreField>>,
    parts: Vec<Part<'_>>,
    shape: [u32; 3],
    affine: [[f64; 4]; 3],
    tolerance: f64,
    iso: Option<f64>,
    unit: Option<&str>,
    provenance: &str,
) -> PyResult<CoreField> {
    let spacing = f64::from(LEAF);
    let lattice = Lattice {
        world_from_lattice: self::affine(affine) * DAffine3::from_scale(DVec3::splat(spacing)),
        cells: shape.map(|n| (n - 1).div_ceil(LEAF).max(1)),
    };
    let mut levels: Vec<BTreeMap<BrickKey, DenseCorrections<f32>>> = vec![BTreeMap::new(); LEVELS];
    if let Some(base) = &base {
        let field = single(base)?;
        for (level, all) in levels.iter_mut().enumerate().take(field.level_count()) {
            *all = (field.corrections(level).iter())
                .map(|(key, corrections)| (*key, DenseCorrections::from(&**corrections)))
                .collect();
        }
    }
    let mut leaves = base.as_ref().map_or(Vec::new(), |b| b.report.leaves.clone());
    let mut slopes = Vec::new();
    for part in &parts {
        let field = single(&part.core)?;
        slopes.push(field.slope());
        for (level, all) in levels.iter_mut().enumerate().take(field.level_count()) {
            part.add(level, &field.corrections(level), shape, all)?;
        }
        if base.is_none() {
            leaves.extend(part.leaves(shape));
        }
    }
    slopes.sort_unstable_by(f64::total_cmp);
    let slope = base
        .as_ref()
        .map(|b| b.grids.slope)
        .or(slopes.get(slopes.len() / 2).copied())
        .unwrap_or(1.0);
    leaves.sort_unstable_by_key(|l| [l.cell[2], l.cell[1], l.cell[0]]);
    let unit = unit_of(unit)?;
    brief(py, || {
        let mut packed: Vec<LevelCorrections<f32>> = levels
            .into_iter()
            .map(|all| {
                all.into_iter()
                    .map(|(key, c)| (key, Arc::new(c.pack())))
                    .collect()
            })
            .collect();
        let used = packed.iter().rposition(|l| !l.is_empty()).unwrap_or(0);
        packed.truncate(used + 1);
        let field = HierarchicalSpline::try_from_corrections(lattice, slope, packed)?;
        let report = report(leaves, tolerance, field.coefficient_count(), used);
        let meta = FieldMeta {
            source: SourceKind::Volume,
            unit,
            iso,
            provenance: provenance.into(),
            ..FieldMeta::default()
        };
        Ok(fitted(f32::any(field), report, meta))
    })
}

fn single(core: &CoreField) -> Result<HierarchicalSpline<f32>, Failure> {
    match core.stored()? {
        AnyField::F32(field) => Ok(field.clone()),
        AnyField::F64(_) => Err(Failure::value(
            "blocks are joined in single precision; fit them so",
        )),
    }
}

impl Part<'_> {
    /// Adds the functions of a level whose bricks begin in the part.
    fn add(
        &self,
        level: usize,
        own: &LevelCorrections<f32>,
        shape: [u32; 3],
        all: &mut BTreeMap<BrickKey, DenseCorrections<f32>>,
    ) -> Result<(), Failure> {
        if own.is_empty() {
            return Ok(());
        }
        // Voxels along a brick of this level.
        let along = (BRICK as u32) << (LEVELS - 1 - level);
        if self.origin.iter().chain(&self.low).any(|v| v % along != 0) {
            return Err(Failure::value(format!(
                "blocks begin at voxels {:?} and {:?}; multiples of {along} are needed",
                self.origin, self.low
            )));
        }
        let shift = self.origin.map(|v| v / along);
        // What lies beyond the last voxel belongs to the last block.
        let end: [u32; 3] = std::array::from_fn(|a| match self.high[a] >= shape[a] {
            true => u32::MAX,
            false => self.high[a] / along,
        });
        for (key, corrections) in own {
            let place: [u32; 3] = std::array::from_fn(|a| key.0[a] + shift[a]);
            if (0..3).any(|a| place[a] < self.low[a] / along || place[a] >= end[a]) {
                continue;
            }
            let taken: Vec<(usize, f32)> = corrections
                .iter()
                .filter(|(slot, _)| self.takes(level, *key, *slot))
                .collect();
            if taken.is_empty() {
                continue;
            }
            let brick = all.entry(BrickKey(place)).or_insert_with(DenseCorrections::empty);
            for (slot, value) in taken {
                // Slots without a function hold 0.
                let sum = brick.values[slot] + value;
                brick.set([slot / 64, slot / 8 % 8, slot % 8], sum);
            }
        }
        Ok(())
    }

    /// Whether the mask has a function of the finest level; those off the voxels go with the next one.
    fn takes(&self, level: usize, key: BrickKey, slot: usize) -> bool {
        let Some(mask) = &self.mask else {
            return true;
        };
        if level + 1 != LEVELS {
            return false;
        }
        let function = [slot / 64, slot / 8 % 8, slot % 8];
        let dims = mask.shape();
        let at: [usize; 3] = std::array::from_fn(|a| {
            let voxel = (key.0[a] as usize * BRICK + function[a]).saturating_sub(1);
            voxel.min(dims[a] - 1)
        });
        mask.as_array()[at] != 0
    }

    /// The leaves of the part, where they lie in the whole.
    fn leaves(&self, shape: [u32; 3]) -> impl Iterator<Item = Leaf> {
        self.core.report.leaves.iter().filter_map(move |leaf| {
            let cell: [u32; 3] = std::array::from_fn(|a| leaf.cell[a] + self.origin[a] / LEAF);
            let is_own = (0..3).all(|a| {
                let end = match self.high[a] >= shape[a] {
                    true => u32::MAX,
                    false => self.high[a] / LEAF,
                };
                (self.low[a] / LEAF..end).contains(&cell[a])
            });
            is_own.then_some(Leaf { cell, ..*leaf })
        })
    }
}

/// The same field with the errors of its leaves measured again: rms and largest of each, in the order of the leaves.
#[pyfunction]
pub fn with_leaf_errors(
    py: Python<'_>,
    core: PyRef<'_, CoreField>,
    rms: &Bound<'_, PyArray1<f32>>,
    largest: &Bound<'_, PyArray1<f32>>,
    notes: Vec<String>,
) -> PyResult<CoreField> {
    let (rms, largest) = (rms.readonly(), largest.readonly());
    let (rms, largest) = (rms.as_slice()?, largest.as_slice()?);
    let mut leaves = core.report.leaves.clone();
    if rms.len() != leaves.len() || largest.len() != leaves.len() {
        return Err(Failure::value(format!("{} leaves have {} errors", leaves.len(), rms.len())).into());
    }
    for (leaf, (rms, max)) in leaves.iter_mut().zip(rms.iter().zip(largest)) {
        (leaf.rms, leaf.max) = (*rms, *max);
    }
    let tolerance = core.report.tolerance;
    for leaf in &mut leaves {
        leaf.reason = match leaf.is_above(tolerance) && tolerance > 0.0 {
            true => StopReason::Depth,
            false => StopReason::Tolerance,
        };
    }
    let count = core.report.coefficients;
    let mut report = report(leaves, tolerance, count, core.report.depth);
    report.notes = notes;
    let levels = core.stored()?.clone();
    let meta = core.meta.clone();
    brief(py, || Ok(fitted(levels, report, meta)))
}

/// What the leaves say of the whole. The 95th percentile is that of their rms residuals.
fn report(leaves: Vec<Leaf>, tolerance: f64, coefficients: usize, depth: usize) -> FitReport {
    let count: f64 = leaves.iter().map(|l| f64::from(l.sample_count)).sum();
    let squares: f64 = leaves
        .iter()
        .map(|l| f64::from(l.sample_count) * f64::from(l.rms).powi(2))
        .sum();
    let mut sorted: Vec<f32> = leaves.iter().map(|l| l.rms).collect();
    sorted.sort_unstable_by(f32::total_cmp);
    let rank = (sorted.len() * 95 / 100).min(sorted.len().saturating_sub(1));
    let max = leaves.iter().map(|l| f64::from(l.max)).fold(0.0, f64::max);
    FitReport {
        input_count: count as usize,
        used_count: count as usize,
        coefficients,
        depth,
        rms: (squares / count.max(1.0)).sqrt(),
        p95: sorted.get(rank).map_or(0.0, |r| f64::from(*r)),
        max,
        bound: max,
        tolerance,
        leaves,
        ..FitReport::default()
    }
}
