//! Fields, as Python holds them.

use std::path::PathBuf;
use std::sync::Arc;

use bspline::hierarchical::{Lattice, MAX_LEVELS};
use bspline::{Aabb, Field, Frame, HierarchicalSpline, Jet};
use document::{is_of_mesh, read_report, with_report};
use fitting::FitReport;
use fitting::field::{Aim, FieldFitOptions, fit_field};
use formats::field::{AnyField, FieldMeta, SourceKind, decode, encode};
use formats::{ReadLimits, Unit};
use glam::DVec3;
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use rayon::prelude::*;
use tools::malleable::Malleable;

use crate::arrays::{affine, matrix_rows, points, rows, vectors};
use crate::failure::Failure;
use crate::run::{Wishes, brief, run};

/// Points that one task asks for.
const CHUNK: usize = 2048;
/// Points below which starting threads takes longer than asking.
const FEW: usize = 256;

/// The field that :class:`isoclay.Field` is laid over.
#[pyclass(frozen, module = "isoclay._isoclay")]
pub struct CoreField {
    /// The field, to be asked.
    pub solid: Arc<dyn Field>,
    /// The same if it is one spline in levels, which alone can be stored.
    pub levels: Option<AnyField>,
    /// The grids that it stands on, or that stand for them.
    pub grids: Grids,
    /// What stands beside it.
    pub meta: FieldMeta,
    /// What the fit said.
    pub report: FitReport,
}

/// How large and how fine a field is.
#[derive(Clone, Copy)]
pub struct Grids {
    /// Its box and coarsest cells.
    pub lattice: Lattice,
    /// Levels of its cells.
    pub levels: usize,
    /// How steep it is, per world length.
    pub slope: f64,
}

/// Asks the spline of either precision.
macro_rules! either {
    ($any:expr, $f:ident => $ask:expr) => {
        match $any {
            ::formats::field::AnyField::F32($f) => $ask,
            ::formats::field::AnyField::F64($f) => $ask,
        }
    };
}
pub(crate) use either;

impl CoreField {
    /// A spline in levels, with what is known of it.
    pub fn of_levels(levels: AnyField, meta: FieldMeta, report: FitReport) -> Self {
        let grids = either!(&levels, f => Grids {
            lattice: f.grids(),
            levels: f.depth(),
            slope: f.steepness(),
        });
        Self {
            solid: either!(&levels, f => Arc::new(f.clone())),
            levels: Some(levels),
            grids,
            meta,
            report,
        }
    }

    fn loaded(field: AnyField, meta: FieldMeta) -> Result<Self, Failure> {
        let coefficients = either!(&field, f => f.coefficient_count());
        // Fields that other tools made have no report of a fit, and need none.
        let report = match meta.report.is_empty() {
            true => FitReport::default(),
            false => read_report(&meta, coefficients).map_err(Failure::Value)?,
        };
        Ok(Self::of_levels(field, meta, report))
    }

    /// The same with notes before its own.
    pub fn with_notes_before(mut self, notes: Vec<String>) -> Self {
        self.meta.notes.splice(0..0, notes);
        self
    }

    /// The spline in levels.
    ///
    /// # Errors
    /// If it is made of others.
    pub fn stored(&self) -> Result<&AnyField, Failure> {
        self.levels.as_ref().ok_or_else(|| {
            Failure::value("this field is a formula of others, and only a spline can do this; make one of it by .baked()")
        })
    }
}

#[pymethods]
impl CoreField {
    /// Reads a field file.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        brief(py, || {
            let loaded = formats::field::load(&path, &ReadLimits { max_bytes: u64::MAX })?;
            Self::loaded(loaded.field, loaded.meta)
        })
    }

    /// Writes a field file, all or nothing.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let levels = self.stored()?;
        brief(py, || {
            either!(levels, f => formats::field::save(&path, f, &self.meta))?;
            Ok(())
        })
    }

    /// The bytes of a field file.
    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let levels = self.stored()?;
        let bytes = brief(py, || {
            either!(levels, f => encode(f, &self.meta)).map_err(Failure::value)
        })?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// Reads the bytes of a field file.
    #[staticmethod]
    fn from_bytes(py: Python<'_>, bytes: &[u8]) -> PyResult<Self> {
        brief(py, || {
            let loaded = decode(bytes, &ReadLimits { max_bytes: u64::MAX }).map_err(Failure::value)?;
            Self::loaded(loaded.field, loaded.meta)
        })
    }

    /// Value, gradient, Hessian of each point, as far as `order` asks.
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyArray2<f64>>,
        order: u8,
        wishes: Wishes,
    ) -> PyResult<Evaluated<'py>> {
        let asked = vectors(points)?;
        if let Some(p) = asked.iter().find(|p| !p.is_finite()) {
            return Err(Failure::value(format!("a point is {p}; coordinates have to be finite")).into());
        }
        let field = self.solid.clone();
        let work = move |asked: &[DVec3]| match order {
            0 | 1 => {
                let mut out = vec![(0.0, DVec3::ZERO); asked.len()];
                field.values_gradients(asked, &mut out);
                out.into_iter()
                    .map(|(value, gradient)| Jet {
                        value,
                        gradient,
                        hessian: Default::default(),
                    })
                    .collect()
            }
            _ => {
                let zero = Jet {
                    value: 0.0,
                    gradient: DVec3::ZERO,
                    hessian: Default::default(),
                };
                let mut out = vec![zero; asked.len()];
                field.jets(asked, &mut out);
                out
            }
        };
        let jets: Vec<Jet> = if asked.len() <= FEW {
            py.detach(|| work(&asked))
        } else {
            run(py, &wishes, move |control| {
                let cancel = control.cancel.clone();
                let parts: Result<Vec<Vec<Jet>>, Failure> = asked
                    .par_chunks(CHUNK)
                    .map(|chunk| match cancel.is_cancelled() {
                        true => Err(Failure::Cancelled),
                        false => Ok(work(chunk)),
                    })
                    .collect();
                Ok(parts?.concat())
            })?
        };
        let values = PyArray1::from_iter(py, jets.iter().map(|j| j.value));
        let gradients = (order >= 1)
            .then(|| rows(py, jets.iter().flat_map(|j| j.gradient.to_array()).collect(), 3))
            .transpose()?;
        let hessians = (order >= 2)
            .then(|| {
                let flat: Vec<f64> = jets.iter().flat_map(|j| j.hessian.to_cols_array()).collect();
                PyArray1::from_vec(py, flat).reshape([jets.len(), 3, 3])
            })
            .transpose()?;
        Ok((values, gradients, hessians))
    }

    /// Values at the voxels `(i, j, k)` of a grid, `k` fastest; `affine` maps voxels to the world.
    fn sample<'py>(
        &self,
        py: Python<'py>,
        affine: [[f64; 4]; 3],
        shape: [usize; 3],
        wishes: Wishes,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let frame = Frame {
            world_from_grid: self::affine(affine),
            cells: shape.map(|n| n.saturating_sub(1).max(1) as u32),
        };
        let field = self.solid.clone();
        let values = run(py, &wishes, move |control| {
            let [_, ny, nz] = shape;
            let plane = ny * nz;
            let mut values = vec![0.0_f32; shape[0] * plane];
            let cancel = control.cancel.clone();
            values
                .par_chunks_mut(plane.max(1))
                .enumerate()
                .try_for_each_init(
                    || vec![0.0; plane],
                    |scratch, (i, out)| {
                        if cancel.is_cancelled() {
                            return Err(Failure::Cancelled);
                        }
                        field.frame_values(&frame, [i as i64, 0, 0], [1, ny, nz], scratch);
                        out.iter_mut().zip(scratch).for_each(|(o, v)| *o = *v as f32);
                        Ok(())
                    },
                )?;
            Ok(values)
        })?;
        PyArray1::from_vec(py, values).reshape(shape)
    }

    /// One spline that stays by the field: within `tolerance`, a world length, of its surface, with the right sign elsewhere; or
    /// if `everywhere`, within `tolerance`, a value, of it.
    fn baked(
        &self,
        py: Python<'_>,
        iso: f64,
        tolerance: Option<f64>,
        everywhere: bool,
        wishes: Wishes,
    ) -> PyResult<Self> {
        let (field, grids) = (self.solid.clone(), self.grids);
        let finest = grids.levels.min(MAX_LEVELS - 1);
        let length = 0.02 * grids.lattice.spacing(grids.levels - 1).min_element();
        let aim = match everywhere {
            true => Aim::Density {
                tolerance: tolerance.unwrap_or(length * grids.slope),
            },
            false => Aim::Surface {
                iso,
                tolerance: tolerance.unwrap_or(length),
            },
        };
        let (levels, tolerance) = run(py, &wishes, move |control| {
            let start =
                HierarchicalSpline::<f32>::schoenberg(grids.lattice, grids.slope, |p| field.value(p))?;
            let options = FieldFitOptions {
                aim,
                finest,
                look: false,
            };
            let around = grids.lattice.world_box();
            let (made, ..) = fit_field(&*field, &start, &around, &options, control)?;
            let tolerance = match aim {
                Aim::Density { tolerance }
                | Aim::Surface { tolerance, .. }
                | Aim::SurfaceAndDensity { tolerance, .. } => tolerance,
            };
            Ok((made, tolerance))
        })?;
        let report = FitReport {
            tolerance,
            coefficients: levels.coefficient_count(),
            ..FitReport::default()
        };
        let meta = FieldMeta {
            source: SourceKind::Other,
            iso: Some(iso),
            unit: self.meta.unit,
            ..FieldMeta::default()
        };
        Ok(fitted(AnyField::F32(levels), report, meta))
    }

    /// Numbers that the field stays between everywhere in a box.
    fn bounds(&self, low: [f64; 3], high: [f64; 3]) -> PyResult<(f64, f64)> {
        let (min, max) = (DVec3::from_array(low), DVec3::from_array(high));
        if !min.cmple(max).all() {
            return Err(Failure::value(format!(
                "the box from {min} to {max} has no inside; give its least corner first"
            ))
            .into());
        }
        let range = self.solid.bounds(&Aabb { min, max });
        Ok((range.lo, range.hi))
    }

    /// Corners of the box that the field describes.
    #[getter(world_box)]
    fn world_box<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let b = self.grids.lattice.world_box();
        points(py, &[b.min, b.max])
    }

    /// The map from cells of the coarsest level to the world, three rows.
    #[getter]
    fn affine(&self) -> [[f64; 4]; 3] {
        matrix_rows(&self.grids.lattice.world_from_lattice)
    }

    #[getter]
    fn cells(&self) -> [u32; 3] {
        self.grids.lattice.cells
    }

    #[getter]
    fn level_count(&self) -> usize {
        self.grids.levels
    }

    #[getter]
    fn is_stored(&self) -> bool {
        self.levels.is_some()
    }

    #[getter]
    fn sha256(&self, py: Python<'_>) -> PyResult<String> {
        let levels = self.stored()?;
        let digest = brief(py, || Ok(either!(levels, f => f.sha256())))?;
        Ok(digest.iter().map(|byte| format!("{byte:02x}")).collect())
    }

    #[getter]
    fn coefficient_count(&self) -> PyResult<usize> {
        Ok(either!(self.stored()?, f => f.coefficient_count()))
    }

    #[getter]
    fn precision(&self) -> &'static str {
        match &self.levels {
            Some(AnyField::F32(_)) => "f32",
            _ => "f64",
        }
    }

    #[getter]
    fn iso(&self) -> Option<f64> {
        self.meta.iso
    }

    #[getter]
    fn unit(&self) -> Option<String> {
        (self.meta.unit != Unit::Unknown).then(|| self.meta.unit.to_string())
    }

    #[getter]
    fn source(&self) -> &'static str {
        match self.meta.source {
            SourceKind::Cloud if is_of_mesh(&self.meta) => "mesh",
            SourceKind::Cloud => "cloud",
            SourceKind::Volume => "volume",
            SourceKind::Other => "other",
        }
    }

    /// What the fit said of itself, JSON; the notes and leaves have places of their own.
    #[getter]
    fn report(&self) -> &str {
        &self.meta.report
    }

    #[getter]
    fn notes(&self) -> Vec<String> {
        self.meta.notes.clone()
    }

    #[getter]
    fn provenance(&self) -> &str {
        &self.meta.provenance
    }

    /// The same with other marks: iso-value, unit, provenance.
    fn marked(&self, iso: Option<f64>, unit: Option<&str>, provenance: &str) -> PyResult<Self> {
        let meta = FieldMeta {
            iso,
            unit: unit_of(unit)?,
            provenance: provenance.into(),
            ..self.meta.clone()
        };
        Ok(Self {
            solid: self.solid.clone(),
            levels: self.levels.clone(),
            grids: self.grids,
            meta,
            report: self.report.clone(),
        })
    }

    /// Level, cell, count of samples, rms, largest residual and reason of each leaf.
    fn leaves<'py>(&self, py: Python<'py>) -> PyResult<Leaves<'py>> {
        let leaves = &self.report.leaves;
        Ok((
            PyArray1::from_iter(py, leaves.iter().map(|l| l.level)),
            rows(py, leaves.iter().flat_map(|l| l.cell).collect(), 3)?,
            PyArray1::from_iter(py, leaves.iter().map(|l| l.sample_count)),
            PyArray1::from_iter(py, leaves.iter().map(|l| l.rms)),
            PyArray1::from_iter(py, leaves.iter().map(|l| l.max)),
            PyArray1::from_iter(py, leaves.iter().map(|l| l.reason as u8)),
        ))
    }
}

/// Values, gradients, Hessians.
type Evaluated<'py> = (
    Bound<'py, PyArray1<f64>>,
    Option<Bound<'py, PyArray2<f64>>>,
    Option<Bound<'py, PyArray3<f64>>>,
);

/// See [`CoreField::leaves`].
type Leaves<'py> = (
    Bound<'py, PyArray1<u8>>,
    Bound<'py, PyArray2<u32>>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray1<f32>>,
    Bound<'py, PyArray1<f32>>,
    Bound<'py, PyArray1<u8>>,
);

/// The unit of a name.
pub fn unit_of(name: Option<&str>) -> Result<Unit, Failure> {
    name.map_or(Ok(Unit::Unknown), |name| name.parse().map_err(Failure::value))
}

/// What a fit gives, with the report put where files have it.
pub fn fitted(field: AnyField, report: FitReport, meta: FieldMeta) -> CoreField {
    CoreField::of_levels(field, with_report(meta, &report), report)
}
