use std::path::PathBuf;
use std::sync::Arc;

use bspline::hierarchical::Lattice;
use bspline::{Field, Frame, HierarchicalSpline, Real, TensorSpline};
use fitting::{Cancel, FitReport};
use formats::field::{AnyField, FieldMeta, SourceKind};
use formats::{Fault, FormatError, Kind, Unit};
use glam::DAffine3;
use tools::body::Body;
use tools::malleable::Malleable;

use super::failure::{Failure, Outcome};
use super::input::limits;
use super::output::Output;
use super::source::{FIELDS, Source};
use super::summary::hex;

/// Cells along the longest side at whose corners a field is looked at for its values.
const LOOKED_AT: u32 = 64;

/// Differences of values, over the values, that are roundings of single precision.
const FLAT: f64 = 16.0 * f32::EPSILON as f64;

/// Where a field is read from.
#[derive(clap::Args)]
pub struct FieldArgs {
    /// Field (.iclay) or document (.isoclay); - reads standard input
    field: PathBuf,
    /// Object of the document, if it has several
    #[arg(long, value_name = "NAME")]
    object: Option<String>,
}

impl FieldArgs {
    /// The file.
    pub fn source(&self, cancel: &Cancel) -> Outcome<Source> {
        Source::open(&self.field, None, FIELDS, cancel)
    }

    /// Reads the field from the file; an object of a document in its own world.
    pub fn load(&self, source: &Source) -> Outcome<OpenField> {
        OpenField::load_object(source, self.object.as_deref())
    }

    /// Reads the field from the file; an object of a document where the document places it.
    pub fn load_placed(&self, source: &Source) -> Outcome<OpenField> {
        self.load(source).map(OpenField::in_place)
    }
}

/// Asks whatever the field is made of.
macro_rules! ask {
    ($solid:expr, $f:ident => $ask:expr) => {
        match $solid {
            Solid::Levels(AnyField::F32($f)) => $ask,
            Solid::Levels(AnyField::F64($f)) => $ask,
            Solid::Knots($f) => $ask,
        }
    };
}

/// A field that was read.
pub struct OpenField {
    field: Solid,
    meta: FieldMeta,
    report: FitReport,
    /// Where its document places it.
    placement: DAffine3,
    /// The field as it is asked, its grids, and the lengths there over its own.
    asked: Solid,
    lattice: Lattice,
    stretch: f64,
}

/// A field of a file, or of an object of a document.
#[derive(Clone)]
enum Solid {
    /// In levels, of either precision.
    Levels(AnyField),
    /// On knots of its own.
    Knots(TensorSpline<f32>),
}

impl Solid {
    fn of(body: &Body) -> Self {
        match body {
            Body::Levels(field) => Self::Levels(AnyField::F32(field.clone())),
            Body::Knots(field) => Self::Knots(field.clone()),
        }
    }

    fn placed(&self, map: DAffine3) -> Self {
        match self {
            Self::Levels(AnyField::F32(f)) => {
                Self::Levels(AnyField::F32(f.placed(map * f.lattice().world_from_lattice)))
            }
            Self::Levels(AnyField::F64(f)) => {
                Self::Levels(AnyField::F64(f.placed(map * f.lattice().world_from_lattice)))
            }
            Self::Knots(f) => Self::Knots(f.placed(map * *f.world_from_parameter())),
        }
    }

    fn lattice(&self) -> Lattice {
        ask!(self, f => f.grids())
    }
}

/// Asks the spline of either precision.
macro_rules! either {
    ($any:expr, $f:ident => $ask:expr) => {
        match $any {
            AnyField::F32($f) => $ask,
            AnyField::F64($f) => $ask,
        }
    };
}
pub(super) use either;

impl OpenField {
    /// Reads a field file, or the only object of a document.
    pub fn load(source: &Source) -> Outcome<Self> {
        Self::load_object(source, None)
    }

    /// Reads a field file, or an object of a document: the only one, or that of a name.
    pub fn load_object(source: &Source, named: Option<&str>) -> Outcome<Self> {
        let (field, meta, placement) = match (document::is_document(source.path()), named) {
            (true, named) => of_document(source, named)?,
            (false, None) => {
                let loaded = formats::field::load(source.path(), &limits(None));
                let loaded = loaded.map_err(|e| not_loaded(source, e))?;
                (Solid::Levels(loaded.field), loaded.meta, DAffine3::IDENTITY)
            }
            (false, Some(name)) => {
                return Err(Failure::usage(format!(
                    "--object {name}: {} is no document, and has no objects; leave it out",
                    source.name()
                )));
            }
        };
        let coefficients = match &field {
            Solid::Levels(field) => either!(field, f => f.coefficient_count()),
            Solid::Knots(field) => field.coefficients().len(),
        };
        let report = document::read_report(&meta, coefficients)
            .map_err(|why| Failure::input(format!("{}: {why}", source.name())))?;
        Ok(Self {
            placement,
            asked: field.clone(),
            lattice: field.lattice(),
            stretch: 1.0,
            field,
            meta,
            report,
        })
    }

    /// The same field where its document places it.
    fn in_place(mut self) -> Self {
        if self.placement == DAffine3::IDENTITY {
            return self;
        }
        self.asked = self.field.placed(self.placement);
        self.lattice = self.asked.lattice();
        let stretch = self.placement.matrix3.determinant().abs().cbrt();
        self.stretch = stretch;
        // Errors of volumes are densities.
        if self.source() != SourceKind::Volume {
            let report = &mut self.report;
            let leaves = report
                .leaves
                .iter_mut()
                .flat_map(|leaf| [&mut leaf.rms, &mut leaf.max]);
            leaves.for_each(|length| *length *= stretch as f32);
            let FitReport {
                rms,
                p95,
                max,
                bound,
                tolerance,
                ..
            } = report;
            [rms, p95, max, bound, tolerance]
                .into_iter()
                .chain(&mut report.noise)
                .for_each(|l| *l *= stretch);
        }
        self
    }

    /// What stands beside the field.
    pub fn meta(&self) -> &FieldMeta {
        &self.meta
    }

    /// The field as it was read, in levels.
    ///
    /// # Errors
    /// If it is on knots of its own.
    pub fn levels(&self) -> Outcome<&AnyField> {
        match &self.field {
            Solid::Levels(field) => Ok(field),
            Solid::Knots(_) => Err(Failure::input(
                "this works on the levels of a field, and the object is on knots of its own; write it in levels first: isoclay \
                 export DOC -o FIELD.iclay",
            )),
        }
    }

    /// The field as it is asked, in levels.
    ///
    /// # Errors
    /// If it is on knots of its own.
    #[cfg(feature = "window")]
    pub fn placed_levels(&self) -> Outcome<&AnyField> {
        match &self.asked {
            Solid::Levels(field) => Ok(field),
            Solid::Knots(_) => self.levels(),
        }
    }

    /// The field as it was read, if it is on knots of its own.
    pub fn knots(&self) -> Option<&TensorSpline<f32>> {
        match &self.field {
            Solid::Levels(_) => None,
            Solid::Knots(field) => Some(field),
        }
    }

    /// The field, to be asked.
    pub fn field(&self) -> &dyn Field {
        ask!(&self.asked, f => f)
    }

    /// The field, to be part of others; what it is made of is shared.
    pub fn shared_field(&self) -> Arc<dyn Field> {
        ask!(&self.asked, f => Arc::new(f.clone()))
    }

    /// What the fit said of itself.
    pub fn report(&self) -> &FitReport {
        &self.report
    }

    /// Grids the field stands on; of one on knots of its own those that stand for them.
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// Median slope of the field, density per world length.
    pub fn slope(&self) -> f64 {
        ask!(&self.asked, f => f.slope()) / self.stretch
    }

    /// Number of levels.
    pub fn level_count(&self) -> usize {
        ask!(&self.field, f => f.depth())
    }

    /// Active functions.
    pub fn coefficient_count(&self) -> usize {
        self.report.coefficients
    }

    /// SHA-256 of the field as it was read, hexadecimal.
    pub fn sha256(&self) -> String {
        hex(&ask!(&self.field, f => f.sha256()))
    }

    /// Name of the coefficients' precision.
    pub fn precision(&self) -> &'static str {
        match &self.field {
            Solid::Levels(AnyField::F32(_)) | Solid::Knots(_) => <f32 as Real>::NAME,
            Solid::Levels(AnyField::F64(_)) => <f64 as Real>::NAME,
        }
    }

    /// What it was fitted to.
    pub fn source(&self) -> SourceKind {
        self.meta.source
    }

    /// Unit of lengths.
    pub fn unit(&self) -> Unit {
        self.meta.unit
    }

    /// Iso-value at which the surface is meant to lie, if there is one.
    pub fn iso(&self) -> Option<f64> {
        self.meta.iso
    }

    /// The iso-value that the user `asked` for, or the field's own.
    ///
    /// # Errors
    /// If there is neither.
    pub fn iso_or(&self, asked: Option<f64>, source: &Source) -> Outcome<f64> {
        asked.or(self.iso()).ok_or_else(|| {
            let [low, high] = self.values_met();
            let name = source.name();
            Failure::input(match high - low > FLAT * low.abs().max(high.abs()) {
                true => format!(
                    "{name}: the field names no surface of its own; choose one with --iso, between {low:.6} and {high:.6}"
                ),
                false => format!("{name}: the field is {low:.6} all over and has no surface"),
            })
        })
    }

    /// The grid with `n` cells in every finest knot interval, along each axis.
    pub fn frame_of_subdivision(&self, n: u32) -> Frame {
        let finest = self.level_count() - 1;
        self.frame(self.lattice().cells_at(finest).map(|c| c.saturating_mul(n)))
    }

    /// Cells of the finest level along the longest side of the box.
    pub fn finest_cells(&self) -> u32 {
        let cells = self.lattice().cells_at(self.level_count() - 1);
        cells.into_iter().max().expect("three axes")
    }

    /// The grid with `n` cells along the longest side of the box and as many on the others as their lengths ask.
    pub fn frame_of_resolution(&self, n: u32) -> Frame {
        let sides = self.lattice().spacing(0) * self.lattice().extent();
        let cell = sides.max_element() / f64::from(n);
        self.frame((sides / cell).to_array().map(|c| (c.round() as u32).max(1)))
    }

    /// The grid of so many cells over the lattice's box.
    pub fn frame(&self, cells: [u32; 3]) -> Frame {
        let lattice = self.lattice();
        let step = lattice.extent() / glam::DVec3::from_array(cells.map(f64::from));
        Frame {
            world_from_grid: lattice.world_from_lattice * DAffine3::from_scale(step),
            cells,
        }
    }

    /// The failure of a surface that is not there.
    pub fn no_surface(&self, source: &Source, iso: f64) -> Failure {
        let [low, high] = self.values_met();
        Failure::input(format!(
            "{}: the surface f = {iso} does not meet the box, in which f runs from {low:.6} to {high:.6}; choose \
             another --iso",
            source.name(),
        ))
    }

    /// The least and the largest value at the corners of some cells.
    pub fn values_met(&self) -> [f64; 2] {
        let frame = self.frame_of_resolution(LOOKED_AT);
        let nodes = frame.cells.map(|n| n as usize + 1);
        let mut values = vec![0.0; nodes.iter().product()];
        self.field().frame_values(&frame, [0; 3], nodes, &mut values);
        let range = [f64::INFINITY, f64::NEG_INFINITY];
        values
            .iter()
            .fold(range, |[low, high], v| [low.min(*v), high.max(*v)])
    }
}

/// The field of an object of a document, in the object's own world, and where the document places that.
fn of_document(source: &Source, named: Option<&str>) -> Outcome<(Solid, FieldMeta, DAffine3)> {
    let document = super::document::open(source.path(), &mut Vec::new())?;
    let state = document.state();
    let names: Vec<_> = state.objects().keys().map(String::as_str).collect();
    let name = match (named, &names[..]) {
        (Some(name), _) => name,
        (None, [only]) => only,
        _ => {
            return Err(Failure::usage(format!(
                "{0}: has {1} objects ({2}); name one by --object where the command knows it, or write it as a field: \
                 isoclay export {0} --object NAME -o FIELD.iclay",
                source.name(),
                names.len(),
                names.join(", ")
            )));
        }
    };
    let object = state
        .object(name)
        .map_err(|e| Failure::usage(format!("--object: {e}")))?;
    let placement = state.placement(name);
    let placement = placement.map_err(|e| Failure::usage(format!("--object: {e}")))?;
    let meta = super::document::edited_meta(object);
    Ok((Solid::of(&object.field), meta, placement))
}

/// What is wrong with a file that is no field: one of another kind has to be fitted first.
fn not_loaded(source: &Source, e: FormatError) -> Failure {
    match formats::detect(source.path()) {
        Ok(kind @ (Kind::Cloud(_) | Kind::Mesh(_) | Kind::Volume(_))) => Failure::input(format!(
            "{0}: is a {kind}, where a fitted field is needed; fit it first: isoclay fit {0} -o FIELD.iclay",
            source.name()
        )),
        Err(FormatError {
            fault: Fault::UnknownKind { .. },
            ..
        }) => Failure::input(format!(
            "{}: is no fitted field; give a file .iclay, as isoclay fit writes it",
            source.name()
        )),
        _ => source.reading(e),
    }
}

/// Writes a fitted field; returns its SHA-256.
pub fn save(output: &Output, field: &AnyField, report: &FitReport, meta: FieldMeta) -> Outcome<String> {
    let meta = document::with_report(meta, report);
    either!(field, f => save_as(output, f, &meta))
}

/// Writes a spline; returns its SHA-256.
pub fn save_as<T: formats::field::Stored>(
    output: &Output,
    field: &HierarchicalSpline<T>,
    meta: &FieldMeta,
) -> Outcome<String> {
    formats::field::save(output.path(), field, meta).map_err(|e| output.writing(e))?;
    Ok(hex(&field.sha256()))
}
