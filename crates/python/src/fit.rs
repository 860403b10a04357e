//! Fits.

use std::path::PathBuf;

use bspline::Aabb;
use document::Samples;
use fitting::mesh::MeshOptions;
use fitting::orient::{EstimatedCloud, OrientOptions, Route};
use fitting::points::{NormalForm, OrientedPoints, PointOptions};
use fitting::volume::{Order, VolumeMethod, VolumeOptions, VolumeView, Voxels, otsu_threshold};
use fitting::{Control, FitError, FitReport};
use formats::field::{AnyField, FieldMeta, SourceKind, Stored};
use formats::{Kind, ReadLimits, Unit};
use glam::DVec3;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use serde_json::Value;

use crate::arrays::{Lent, affine, corners, vectors};
use crate::failure::Failure;
use crate::field::{CoreField, either, fitted, unit_of};
use crate::run::{Wishes, run};

/// What may be chosen of any fit; the rest is chosen from the data.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Choice {
    /// In the unit of lengths, or of volumes of densities; see `tolerance_in`.
    tolerance: Option<f64>,
    /// `mm`, `%` of the diagonal (of volumes, of the range of densities), or nothing.
    tolerance_in: String,
    coefficients: Option<usize>,
    max_depth: Option<usize>,
    smoothing: Option<f64>,
    /// Single or double precision.
    is_double: bool,
    unit: Option<String>,
    provenance: String,
}

impl Choice {
    /// The tolerance on something of that size, in its unit.
    fn tolerance(
        &self,
        size: impl FnOnce() -> Result<f64, Failure>,
        unit: Unit,
    ) -> Result<Option<f64>, Failure> {
        let Some(t) = self.tolerance else {
            return Ok(None);
        };
        Ok(Some(match self.tolerance_in.as_str() {
            "%" => 0.01 * t * size()?,
            "mm" => match unit.in_mm() {
                Some(mm) => t / mm,
                None => {
                    return Err(Failure::value(format!(
                        "tolerance is '{t}mm', and the unit of the coordinates is not known; give unit='mm', 'cm' or 'm'"
                    )));
                }
            },
            _ => t,
        }))
    }

    /// The unit of samples that are known to be in `known`.
    fn unit(&self, known: Unit) -> Result<Unit, Failure> {
        let stated = unit_of(self.unit.as_deref())?;
        match (known, stated) {
            (known, Unit::Unknown) => Ok(known),
            (Unit::Unknown, stated) => Ok(stated),
            (known, stated) if known == stated => Ok(known),
            (known, stated) => Err(Failure::value(format!(
                "unit is '{stated}', and the lengths are in {known}; leave it out"
            ))),
        }
    }

    fn meta(&self, source: SourceKind, unit: Unit, samples: Samples) -> FieldMeta {
        let mut story: Value = serde_json::from_str(&self.provenance).unwrap_or_default();
        story["input_kind"] = samples.kind().into();
        story["input_digest"] = samples.digest().into();
        FieldMeta {
            source,
            unit,
            iso: (source == SourceKind::Cloud).then_some(0.0),
            provenance: story.to_string(),
            ..FieldMeta::default()
        }
    }
}

/// What may be chosen of clouds besides.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct OfClouds {
    /// How normals are estimated: `winding` or `tagging`.
    unoriented: Option<String>,
    robust: bool,
    offset_pairs: bool,
}

impl OfClouds {
    fn route(&self) -> Result<Option<Route>, Failure> {
        match self.unoriented.as_deref() {
            None => Ok(None),
            Some("winding") => Ok(Some(Route::WindingNumber)),
            Some("tagging") => Ok(Some(Route::Tagging)),
            Some(other) => Err(Failure::value(format!(
                "unoriented is {other:?}; write 'winding' or 'tagging'"
            ))),
        }
    }
}

/// Fits a cloud.
#[pyfunction]
pub fn fit_points(
    py: Python<'_>,
    points: &Bound<'_, PyArray2<f64>>,
    normals: Option<&Bound<'_, PyArray2<f64>>>,
    clouds: OfClouds,
    choice: Choice,
    wishes: Wishes,
) -> PyResult<CoreField> {
    let positions = vectors(points)?;
    let normals = normals.map(vectors).transpose()?;
    if let Some(normals) = &normals
        && normals.len() != positions.len()
    {
        return Err(Failure::value(format!(
            "{} points come with {} normals; give one each",
            positions.len(),
            normals.len()
        ))
        .into());
    }
    run(py, &wishes, move |control| {
        cloud(
            &positions,
            normals.as_deref(),
            Unit::Unknown,
            &clouds,
            &choice,
            control,
        )
    })
}

fn cloud(
    positions: &[DVec3],
    normals: Option<&[DVec3]>,
    unit: Unit,
    clouds: &OfClouds,
    choice: &Choice,
    control: &mut Control,
) -> Result<CoreField, Failure> {
    let unit = choice.unit(unit)?;
    if positions.is_empty() {
        return Err(FitError::NotEnoughSamples { found: 0, needed: 10 }.into());
    }
    let estimated = match (clouds.route()?, normals) {
        (Some(route), _) => Some(EstimatedCloud::new(positions, &OrientOptions { route }, control)?),
        (None, Some(_)) => None,
        (None, None) => {
            return Err(Failure::value(
                "the points have no normals, which tell inside from outside; give normals=, or estimate them with \
                 unoriented='winding'",
            ));
        }
    };
    if let (Some(limit), Some(estimated)) = (&mut control.memory_limit, &estimated) {
        *limit = limit.saturating_sub(estimated.bytes());
    }
    let given = OrientedPoints {
        positions,
        normals: normals.unwrap_or_default(),
        certainty: None,
    };
    let points = estimated.as_ref().map_or(given, EstimatedCloud::points);
    let options = PointOptions {
        tolerance: choice.tolerance(|| Ok(points.diagonal()), unit)?,
        coefficients: choice.coefficients,
        max_depth: choice.max_depth,
        smoothing: choice.smoothing,
        robust: clouds.robust,
        form: match clouds.offset_pairs {
            true => NormalForm::OffsetPairs,
            false => NormalForm::Gradient,
        },
    };
    let (field, mut report) = match choice.is_double {
        true => cloud_as::<f64>(&points, &options, control)?,
        false => cloud_as::<f32>(&points, &options, control)?,
    };
    if let Some(estimated) = estimated {
        either!(&field, f => estimated.complete(&mut report, f.lattice()));
    }
    Ok(fitted(
        field,
        report,
        choice.meta(SourceKind::Cloud, unit, Samples::Cloud(positions)),
    ))
}

fn cloud_as<T: Stored>(
    points: &OrientedPoints,
    options: &PointOptions,
    control: &mut Control,
) -> Result<(AnyField, FitReport), Failure> {
    let (field, report) = fitting::points::fit_points::<T>(points, options, control)?;
    Ok((T::any(field), report))
}

/// Fits the solid that triangles bound.
#[pyfunction]
pub fn fit_mesh(
    py: Python<'_>,
    vertices: &Bound<'_, PyArray2<f64>>,
    faces: &Bound<'_, PyArray2<u32>>,
    band: Option<f64>,
    choice: Choice,
    wishes: Wishes,
) -> PyResult<CoreField> {
    let vertices = vectors(vertices)?;
    let triangles = corners(faces, vertices.len())?;
    run(py, &wishes, move |control| {
        mesh(&vertices, &triangles, Unit::Unknown, band, &choice, control)
    })
}

fn mesh(
    vertices: &[DVec3],
    triangles: &[[u32; 3]],
    unit: Unit,
    band: Option<f64>,
    choice: &Choice,
    control: &mut Control,
) -> Result<CoreField, Failure> {
    let unit = choice.unit(unit)?;
    let around = Aabb::about(vertices.iter().copied());
    let options = MeshOptions {
        tolerance: choice.tolerance(|| Ok(around.map_or(0.0, |b| b.size().length())), unit)?,
        coefficients: choice.coefficients,
        max_depth: choice.max_depth,
        band,
    };
    let (field, report) = match choice.is_double {
        true => mesh_as::<f64>(vertices, triangles, &options, control)?,
        false => mesh_as::<f32>(vertices, triangles, &options, control)?,
    };
    Ok(fitted(
        field,
        report,
        choice.meta(SourceKind::Cloud, unit, Samples::Mesh(vertices, triangles)),
    ))
}

fn mesh_as<T: Stored>(
    vertices: &[DVec3],
    triangles: &[[u32; 3]],
    options: &MeshOptions,
    control: &mut Control,
) -> Result<(AnyField, FitReport), Failure> {
    let (field, report, _) = fitting::mesh::fit_mesh::<T>(vertices, triangles, options, control)?;
    Ok((T::any(field), report))
}

/// Densities as NumPy holds them.
#[derive(FromPyObject)]
pub enum Numbers<'py> {
    /// Single precision.
    F32(Bound<'py, PyArray1<f32>>),
    /// 16 bits.
    I16(Bound<'py, PyArray1<i16>>),
}

/// The same, lent.
enum LentNumbers {
    F32(Lent<f32>),
    I16(Lent<i16>),
}

/// Fits a volume of `shape` voxels, whose numbers lie in memory with the last axis fastest, or the first if not `last_fastest`.
#[pyfunction]
pub fn fit_volume(
    py: Python<'_>,
    numbers: Numbers<'_>,
    shape: [usize; 3],
    last_fastest: bool,
    affine: [[f64; 4]; 3],
    interpolate: bool,
    choice: Choice,
    wishes: Wishes,
) -> PyResult<CoreField> {
    let order = match last_fastest {
        true => Order::ZFastest,
        false => Order::XFastest,
    };
    let numbers = match numbers {
        Numbers::F32(array) => LentNumbers::F32(Lent::new(&array)?),
        Numbers::I16(array) => LentNumbers::I16(Lent::new(&array)?),
    };
    run(py, &wishes, move |control| {
        let view = VolumeView {
            dims: shape,
            values: match &numbers {
                LentNumbers::F32(numbers) => Voxels::F32(numbers, order),
                LentNumbers::I16(numbers) => Voxels::I16(numbers, order),
            },
            world_from_voxel: self::affine(affine),
        };
        volume(&view, Unit::Unknown, interpolate, &choice, control)
    })
}

fn volume(
    view: &VolumeView,
    unit: Unit,
    interpolate: bool,
    choice: &Choice,
    control: &mut Control,
) -> Result<CoreField, Failure> {
    let unit = choice.unit(unit)?;
    let options = VolumeOptions {
        method: match interpolate {
            true => VolumeMethod::Interpolate,
            false => VolumeMethod::Adaptive,
        },
        tolerance: choice.tolerance(|| Ok(view.density_range()?), unit)?,
        coefficients: choice.coefficients,
        max_depth: choice.max_depth,
        smoothing: choice.smoothing,
    };
    let (field, report) = match choice.is_double {
        true => volume_as::<f64>(view, &options, control)?,
        false => volume_as::<f32>(view, &options, control)?,
    };
    let meta = FieldMeta {
        iso: otsu_threshold(view.values),
        ..choice.meta(SourceKind::Volume, unit, Samples::Volume(view))
    };
    Ok(fitted(field, report, meta))
}

fn volume_as<T: Stored>(
    view: &VolumeView,
    options: &VolumeOptions,
    control: &mut Control,
) -> Result<(AnyField, FitReport), Failure> {
    let (field, report) = fitting::volume::fit_volume::<T>(view, options, control)?;
    Ok((T::any(field), report))
}

/// Fits a file of any kind, as the command line does by default.
#[pyfunction]
pub fn fit_file(
    py: Python<'_>,
    path: PathBuf,
    as_mesh: bool,
    clouds: OfClouds,
    choice: Choice,
    wishes: Wishes,
) -> PyResult<CoreField> {
    run(py, &wishes, move |control| {
        let limits = ReadLimits {
            max_bytes: control.memory_limit.unwrap_or(u64::MAX),
        };
        let hold = |control: &mut Control, bytes: usize| {
            if let Some(limit) = &mut control.memory_limit {
                *limit = limit.saturating_sub(bytes as u64);
            }
        };
        let read_notes;
        let made = match (formats::detect(&path)?, as_mesh) {
            (Kind::Volume(_), _) => {
                let read = formats::volumes::read(&path, &Default::default(), &limits)?;
                hold(control, size_of_val(&read.values[..]));
                let view = VolumeView {
                    dims: read.header.dims,
                    values: (&read.values).into(),
                    world_from_voxel: read.header.world_from_voxel,
                };
                read_notes = read.notes.clone();
                volume(&view, read.header.unit, false, &choice, control)?
            }
            (Kind::Mesh(_), _) | (Kind::Cloud(_), true) => {
                let read = formats::meshes::read(&path, &limits)?;
                hold(
                    control,
                    size_of_val(&read.vertices[..]) + size_of_val(&read.triangles[..]),
                );
                read_notes = read.notes.clone();
                mesh(&read.vertices, &read.triangles, read.unit, None, &choice, control)?
            }
            (Kind::Cloud(_), false) => {
                let read = formats::points::read(&path, &limits)?;
                hold(control, 2 * size_of_val(&read.positions[..]));
                read_notes = read.notes.clone();
                cloud(
                    &read.positions,
                    read.normals.as_deref(),
                    read.unit,
                    &clouds,
                    &choice,
                    control,
                )?
            }
            (Kind::Field, _) => {
                return Err(Failure::value(format!(
                    "{} is a fitted field already; read it by Field.load",
                    path.display()
                )));
            }
        };
        Ok(made.with_notes_before(read_notes))
    })
}
