//! Solids made of solids.

use std::sync::Arc;

use bspline::csg::Rounding;
use bspline::hierarchical::Lattice;
use bspline::{Aabb, Csg, Field};
use fitting::FitReport;
use formats::field::{FieldMeta, SourceKind};
use glam::{DAffine3, DVec3};
use pyo3::prelude::*;

use crate::arrays::affine;
use crate::failure::Failure;
use crate::field::{CoreField, Grids};

/// Cells of the coarsest level along the longest side of a box.
const COARSEST: f64 = 32.0;

/// What is inside of any.
#[pyfunction]
pub fn union(fields: Vec<PyRef<'_, CoreField>>, radius: f64) -> PyResult<CoreField> {
    let (iso, solids) = level(&fields)?;
    let made = match radius {
        0.0 => Arc::new(Csg::union(solids).map_err(Failure::from)?),
        radius => Csg::smooth_union(solids, rounding(radius)?, iso).map_err(Failure::from)?,
    };
    let all = fields
        .iter()
        .map(|f| f.grids.lattice.world_box())
        .reduce(Aabb::hull);
    Ok(made_of(&fields, made, all, iso))
}

/// What is inside of all.
#[pyfunction]
pub fn intersection(fields: Vec<PyRef<'_, CoreField>>, radius: f64) -> PyResult<CoreField> {
    let (iso, solids) = level(&fields)?;
    let made = match radius {
        0.0 => Arc::new(Csg::intersection(solids).map_err(Failure::from)?),
        radius => Csg::smooth_intersection(solids, rounding(radius)?, iso).map_err(Failure::from)?,
    };
    let all = fields
        .iter()
        .map(|f| f.grids.lattice.world_box())
        .reduce(Aabb::hull);
    Ok(made_of(&fields, made, all, iso))
}

/// What is inside of the first and of no other.
#[pyfunction]
pub fn difference(fields: Vec<PyRef<'_, CoreField>>, radius: f64) -> PyResult<CoreField> {
    let (iso, mut solids) = level(&fields)?;
    let first = solids.remove(0);
    let made = match radius {
        0.0 => Arc::new(Csg::difference(first, solids, iso).map_err(Failure::from)?),
        radius => Csg::smooth_difference(first, solids, rounding(radius)?, iso).map_err(Failure::from)?,
    };
    let own = fields.first().map(|f| f.grids.lattice.world_box());
    Ok(made_of(&fields, made, own, iso))
}

/// What is outside.
#[pyfunction]
pub fn complement(field: PyRef<'_, CoreField>) -> PyResult<CoreField> {
    let fields = [field];
    let (iso, solids) = level(&fields)?;
    let made = Csg::complement(solids[0].clone(), iso).map_err(Failure::from)?;
    Ok(made_of(&fields, Arc::new(made), None, iso))
}

/// Grown by a length.
#[pyfunction]
pub fn grown(field: PyRef<'_, CoreField>, by: f64) -> PyResult<CoreField> {
    let fields = [field];
    let (iso, solids) = level(&fields)?;
    let made = Csg::grown(solids[0].clone(), by).map_err(Failure::from)?;
    let around = fields[0].grids.lattice.world_box().widened(by.max(0.0));
    Ok(made_of(&fields, Arc::new(made), Some(around), iso))
}

/// Carried by a map of the world.
#[pyfunction]
#[pyo3(name = "moved")]
pub fn moved(field: PyRef<'_, CoreField>, map: [[f64; 4]; 3]) -> PyResult<CoreField> {
    let map = affine(map);
    let made = Csg::affine(field.solid.clone(), map).map_err(Failure::from)?;
    let lattice = Lattice {
        world_from_lattice: map * field.grids.lattice.world_from_lattice,
        ..field.grids.lattice
    };
    Ok(CoreField {
        solid: Arc::new(made),
        levels: None,
        grids: Grids {
            lattice,
            ..field.grids
        },
        meta: FieldMeta {
            source: SourceKind::Other,
            unit: field.meta.unit,
            iso: field.meta.iso,
            ..FieldMeta::default()
        },
        report: FitReport::default(),
    })
}

fn rounding(radius: f64) -> Result<Rounding, Failure> {
    match radius > 0.0 && radius.is_finite() {
        true => Ok(Rounding::Bounded { range: radius }),
        false => Err(Failure::value(format!(
            "radius is {radius}; it has to be 0 or a positive length"
        ))),
    }
}

/// The fields with their surfaces at one iso-value: their common one, or else 0.
fn level(fields: &[PyRef<'_, CoreField>]) -> Result<(f64, Vec<Arc<dyn Field>>), Failure> {
    let isos: Option<Vec<f64>> = fields.iter().map(|f| f.meta.iso).collect();
    let isos =
        isos.ok_or_else(|| Failure::value("a field names no surface; give it one by .with_iso(density)"))?;
    let Some(&first) = isos.first() else {
        return Err(Failure::value("no field is given; give at least one"));
    };
    if isos.iter().all(|iso| *iso == first) {
        return Ok((first, fields.iter().map(|f| f.solid.clone()).collect()));
    }
    let lowered = fields.iter().zip(&isos).map(|(field, iso)| {
        let lowered = Csg::offset(field.solid.clone(), -iso)?;
        Ok(Arc::new(lowered) as Arc<dyn Field>)
    });
    Ok((0.0, lowered.collect::<Result<_, Failure>>()?))
}

/// A field made of `fields`, described in `around`, or where the first of them is.
fn made_of(
    fields: &[PyRef<'_, CoreField>],
    solid: Arc<dyn Field>,
    around: Option<Aabb>,
    iso: f64,
) -> CoreField {
    let first = &fields[0];
    let grids = around.map_or(first.grids, |b| grids_over(&b, fields));
    let units = fields.iter().all(|f| f.meta.unit == first.meta.unit);
    CoreField {
        solid,
        levels: None,
        grids,
        meta: FieldMeta {
            source: SourceKind::Other,
            unit: if units {
                first.meta.unit
            } else {
                Default::default()
            },
            iso: Some(iso),
            ..FieldMeta::default()
        },
        report: FitReport::default(),
    }
}

/// Grids over a box, as fine as the finest of the fields'.
fn grids_over(around: &Aabb, fields: &[PyRef<'_, CoreField>]) -> Grids {
    let finest = fields
        .iter()
        .map(|f| f.grids.lattice.spacing(f.grids.levels - 1).min_element())
        .fold(f64::INFINITY, f64::min);
    let size = around.size();
    let step = size.max_element() / COARSEST;
    let cells = (size / step - 1e-9).ceil().max(DVec3::ONE);
    let lattice = Lattice {
        world_from_lattice: DAffine3::from_translation(around.min) * DAffine3::from_scale(DVec3::splat(step)),
        cells: cells.to_array().map(|n| n as u32),
    };
    let levels = 1 + (step / finest).log2().ceil().max(0.0) as usize;
    Grids {
        lattice,
        levels,
        slope: fields[0].grids.slope,
    }
}
