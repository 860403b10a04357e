use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::ValueEnum;
use fitting::mesh::{MeshDefects, MeshOptions, fit_mesh};
use fitting::points::{NormalForm, OrientedPoints, PointOptions, fit_points};
use fitting::volume::{VolumeMethod, VolumeOptions, VolumeView, fit_volume, otsu_threshold};
use fitting::{Control, FitError, FitReport, StopReason};
use formats::Unit;
use formats::field::{AnyField, FieldMeta, SourceKind, Stored};
use formats::meshes::TriangleMesh;
use formats::points::PointCloud;
use formats::volumes::Volume;

use super::ceiling::explain;
use super::cost::Cost;
use super::failure::{Failure, Outcome};
use super::field::{self, either};
use super::input::{self, Input, Shape, bounding_box};
use super::output::Output;
use super::progress::Bar;
use super::quantity::{Memory, Tolerance, between, count, human_number, positive, threads};
use super::solves::Solve;
use super::source::{SAMPLES, Source, input_formats};
use super::summary::Summary;
use super::unoriented::{Oriented, Unoriented};
use super::volume_choice::VolumeChoice;
use super::{belongs, ceiling, flags, interrupt, set_threads};

/// Arguments of `isoclay fit`.
#[derive(clap::Args)]
pub struct Args {
    /// Point cloud (.ply .obj .pcd .las .laz .e57 .xyz), mesh (.stl .gltf .glb .3mf .wrl, see --as) or volume (.nii .nrrd
    /// .mha .tif), also gzipped; a directory of DICOM or TIFF slices; - reads standard input
    input: PathBuf,
    /// Field to write (.iclay); - writes to standard output
    #[arg(short, long, value_name = "FIELD")]
    pub output: PathBuf,
    /// What to fit of a file with faces. Meshes become the solid that their triangles bound [default: cloud for PLY
    /// and OBJ, mesh for files that hold nothing else]
    #[arg(long = "as", value_enum, value_name = "KIND")]
    shape: Option<Shape>,
    /// Format of the input where neither its content nor its name tells it
    #[arg(long, value_name = "FORMAT", value_parser = input_formats())]
    format: Option<String>,
    #[command(flatten)]
    choice: Choice,
    /// Memory that the process may hold, such as 2GiB
    #[arg(long, value_name = "SIZE")]
    memory: Option<Memory>,
    /// Threads to work with [default: all cores]
    #[arg(long, value_name = "N", value_parser = threads)]
    threads: Option<NonZeroUsize>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    volume: VolumeChoice,
}

/// What the user may choose of a fit; the rest is chosen from the data.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct Choice {
    /// Root mean square of the residuals that no leaf of the octree exceeds, unless its report says why. Clouds: a distance in the file's unit, in mm,
    /// or in per cent of the diagonal. Volumes: a density, or per cent of the range between the 1st and the 99th
    /// percentile [default: what the noise justifies; for clean data 0.01% of the diagonal, 0.5% of the range]
    #[arg(long, value_name = "T[mm|%]", allow_hyphen_values = true)]
    pub tolerance: Option<Tolerance>,
    /// Meshes: distance from the surface up to which the tolerance holds for the signed distance, written like it
    /// [default: none, it holds for the surface alone]
    #[arg(long, value_name = "L[mm|%]", allow_hyphen_values = true)]
    pub band: Option<Tolerance>,
    /// Coefficients to spend
    #[arg(long, value_name = "N", value_parser = count)]
    pub coefficients: Option<NonZeroUsize>,
    /// Finest level allowed. Clouds: 2^N cells along the box, 6 to 16. Volumes: 0 is a knot every four voxels, 2 one
    /// at every voxel
    #[arg(long, value_name = "N", value_parser = between::<u8>(0, 16))]
    pub max_depth: Option<u8>,
    /// How to fit: a volume adaptively or by interpolation, a cloud by gradients or by offset pairs [default:
    /// adaptive; gradient]
    #[arg(long, value_enum)]
    pub method: Option<Method>,
    /// Weight of the bending energy [default: chosen from the data]
    #[arg(long, value_name = "μ", value_parser = positive, allow_hyphen_values = true)]
    pub smoothing: Option<f64>,
    /// Estimate the normals of a cloud that has none (or not those of its file), and how to tell inside from outside
    #[arg(long, value_enum, value_name = "ROUTE", num_args = 0..=1, require_equals = true,
          default_missing_value = "winding")]
    pub unoriented: Option<Unoriented>,
    /// Take no notice of points that contradict the others: for clouds with outliers
    #[arg(long)]
    pub robust: bool,
    /// Unit of the coordinates, where the file does not tell: mm, cm or m
    #[arg(long, value_parser = unit)]
    pub unit: Option<Unit>,
    /// Precision of the coefficients
    #[arg(long, value_enum, default_value_t = Precision::F32)]
    pub precision: Precision,
}

/// How to fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Method {
    /// Clouds: the field is 0 at each point and its gradient the normal.
    Gradient,
    /// Clouds: the field is 0 at each point and ∓d at two points at ±d along the normal.
    OffsetPairs,
    /// Volumes: least squares with as few coefficients as the tolerance needs.
    Adaptive,
    /// Volumes: exactly through all voxels, with a coefficient for each.
    Interpolate,
}

/// Precision of the coefficients.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Precision {
    /// 32-bit floats.
    F32,
    /// 64-bit floats.
    F64,
}

fn unit(s: &str) -> Result<Unit, String> {
    match s {
        "mm" | "cm" | "m" => s.parse(),
        _ => Err("write mm, cm or m".into()),
    }
}

/// A fitted field with what the fit says of it.
pub struct Fitted {
    /// The field.
    pub field: AnyField,
    /// Errors, leaves, notes.
    pub report: FitReport,
    /// Unit of lengths.
    pub unit: Unit,
    /// What it was fitted to.
    pub source: SourceKind,
    /// Iso-value that meshing takes if the user names none; a constant volume has none.
    pub iso: Option<f64>,
    /// What was wrong with a mesh.
    pub defects: Option<MeshDefects>,
}

/// Fits a file and writes the field.
pub fn run(args: &Args) -> Outcome {
    let cost = Cost::start();
    let cancel = interrupt::cancel();
    let source = Source::open(&args.input, args.format.as_deref(), SAMPLES, &cancel)?;
    let output = Output::check("-o", &args.output, &["iclay"], None, &[&source])?;
    set_threads(args.threads)?;
    let bar = Bar::new();
    bar.show("reading", 0.0);
    let input = input::read(&source, args.shape, &args.volume, args.choice.unit, args.memory)?;
    interrupt::check(&cancel)?;
    let mut control = Control {
        memory_limit: args
            .memory
            .or_else(ceiling::limit)
            .map(|m| m.0.saturating_sub(ceiling::PROGRAM + input.bytes())),
        ..bar.control(&cancel)
    };
    let fitted = fit(&input, &args.choice, &mut control)
        .map_err(|f| if f.code() == 3 { f.about(source.name()) } else { f })?;
    interrupt::check(&control.cancel)?;
    bar.show("writing", 0.99);
    let meta = FieldMeta {
        source: fitted.source,
        unit: fitted.unit,
        iso: fitted.iso,
        provenance: belongs::provenance(
            &input,
            args.input.file_name().map(|n| n.to_string_lossy().into_owned()),
        ),
        ..Default::default()
    };
    let sha256 = field::save(&output, &fitted.field, &fitted.report, meta)?;
    bar.clear();
    Summary {
        field_sha256: Some(sha256),
        ..fitted.summary(&input)
    }
    .with_cost(&cost)
    .print_after(&output, args.json)
}

/// Fits an input as chosen.
pub fn fit(input: &Input, choice: &Choice, control: &mut Control) -> Outcome<Fitted> {
    let mut fitted = fit_as(input, choice, control)?;
    // Of meshes the fit itself tells it, with the share of the surface.
    if !matches!(input, Input::Mesh(_)) {
        let notes = limits_met(&fitted.report);
        fitted.report.notes.extend(notes);
    }
    Ok(fitted)
}

/// What the user's limits left undone.
fn limits_met(report: &FitReport) -> impl Iterator<Item = String> + use<> {
    let limits = [
        ("--memory", StopReason::Memory),
        ("--coefficients", StopReason::Budget),
    ];
    let total = report.leaves.len();
    let counts = limits.map(|(option, reason)| {
        let stopped = report.leaves.iter().filter(|l| l.reason == reason).count();
        (option, stopped)
    });
    counts.into_iter().filter(|c| c.1 > 0).map(move |(option, stopped)| {
        format!("{stopped} of {total} leaves are coarser than the tolerance asks for: {option} leaves no room for more")
    })
}

/// A doubt about a tolerance that the user gave, on `what` of this `size` whose numbers are as large as `magnitude`.
fn tolerance_doubt(choice: &Choice, tolerance: f64, what: &str, size: f64, magnitude: f64) -> Option<String> {
    choice.tolerance?;
    let finest = magnitude * f64::from(f32::EPSILON) / 2.0;
    if tolerance >= size && size > 0.0 {
        let (t, s) = (human_number(tolerance), human_number(size));
        Some(format!(
            "--tolerance {t} is larger than {what} ({s}): the field may miss it altogether"
        ))
    } else if tolerance < finest && choice.precision == Precision::F32 {
        Some(format!(
            "--tolerance {} is finer than 32-bit coefficients can be ({}): use --precision f64",
            human_number(tolerance),
            human_number(finest)
        ))
    } else {
        None
    }
}

/// The same of a length, on an object of that diagonal.
fn length_doubt(choice: &Choice, tolerance: f64, diagonal: f64) -> Option<String> {
    tolerance_doubt(choice, tolerance, "the object itself", diagonal, diagonal)
}

fn fit_as(input: &Input, choice: &Choice, control: &mut Control) -> Outcome<Fitted> {
    match (input, choice.precision) {
        (Input::Cloud(cloud), Precision::F32) => fit_cloud::<f32>(cloud, choice, control),
        (Input::Cloud(cloud), Precision::F64) => fit_cloud::<f64>(cloud, choice, control),
        (Input::Mesh(mesh), Precision::F32) => fit_triangles::<f32>(mesh, choice, control),
        (Input::Mesh(mesh), Precision::F64) => fit_triangles::<f64>(mesh, choice, control),
        (Input::Volume(volume), Precision::F32) => fit_voxels::<f32>(volume, choice, control),
        (Input::Volume(volume), Precision::F64) => fit_voxels::<f64>(volume, choice, control),
    }
}

fn fit_cloud<T: Stored>(cloud: &PointCloud, choice: &Choice, control: &mut Control) -> Outcome<Fitted> {
    let form = match choice.method {
        None | Some(Method::Gradient) => NormalForm::Gradient,
        Some(Method::OffsetPairs) => NormalForm::OffsetPairs,
        Some(Method::Adaptive | Method::Interpolate) => {
            return Err(Failure::usage(
                "--method adaptive and --method interpolate are for volumes; a point cloud takes gradient or offset-pairs",
            ));
        }
    };
    refuse_band(choice)?;
    if cloud.positions.is_empty() {
        return Err(FitError::NotEnoughSamples { found: 0, needed: 10 }.into());
    }
    let oriented = Oriented::new(cloud, choice.unoriented, control)?;
    if let Some(limit) = &mut control.memory_limit {
        *limit = limit.saturating_sub(oriented.bytes());
    }
    let unit = stated_unit(cloud.unit, choice.unit)?;
    let points = OrientedPoints {
        positions: oriented.positions(),
        normals: oriented.normals(),
        certainty: oriented.certainty(),
    };
    let diagonal = points.diagonal();
    let options = PointOptions {
        tolerance: choice
            .tolerance
            .map(|t| t.length(diagonal, unit))
            .transpose()
            .map_err(Failure::usage)?,
        coefficients: choice.coefficients.map(NonZeroUsize::get),
        max_depth: choice.max_depth.map(usize::from),
        smoothing: choice.smoothing,
        robust: choice.robust,
        form,
    };
    let (field, mut report) = fit_points::<T>(&points, &options, control).map_err(|e| explain(e, control))?;
    oriented.complete(&mut report, field.lattice());
    report.notes.splice(0..0, cloud.notes.iter().cloned());
    report
        .notes
        .extend(length_doubt(choice, report.tolerance, diagonal));
    Ok(Fitted {
        field: T::any(field),
        report,
        unit,
        source: SourceKind::Cloud,
        iso: Some(0.0),
        defects: None,
    })
}

fn fit_triangles<T: Stored>(mesh: &TriangleMesh, choice: &Choice, control: &mut Control) -> Outcome<Fitted> {
    for (option, is_given) in [
        ("--method", choice.method.is_some()),
        ("--unoriented", choice.unoriented.is_some()),
        ("--robust", choice.robust),
    ] {
        if is_given {
            return Err(Failure::usage(format!(
                "{option}: is for other inputs than meshes; leave it out"
            )));
        }
    }
    if choice.smoothing.is_some() {
        return Err(Failure::usage(
            "--smoothing is for clouds and volumes: the distance to a mesh has no noise; leave it out",
        ));
    }
    let unit = stated_unit(mesh.unit, choice.unit)?;
    let diagonal = bounding_box(&mesh.vertices).size().length();
    let length = |t: Option<Tolerance>| {
        t.map(|t| t.length(diagonal, unit))
            .transpose()
            .map_err(Failure::usage)
    };
    let options = MeshOptions {
        tolerance: length(choice.tolerance)?,
        coefficients: choice.coefficients.map(NonZeroUsize::get),
        max_depth: choice.max_depth.map(usize::from),
        band: length(choice.band)?,
    };
    let (field, mut report, defects) =
        fit_mesh::<T>(&mesh.vertices, &mesh.triangles, &options, control).map_err(|e| explain(e, control))?;
    report.notes.splice(0..0, mesh.notes.iter().cloned());
    report
        .notes
        .extend(length_doubt(choice, report.tolerance, diagonal));
    Ok(Fitted {
        field: T::any(field),
        report,
        unit,
        source: SourceKind::Cloud,
        iso: Some(0.0),
        defects: Some(defects),
    })
}

fn fit_voxels<T: Stored>(volume: &Volume, choice: &Choice, control: &mut Control) -> Outcome<Fitted> {
    if choice.unoriented.is_some() {
        return Err(Failure::usage(
            "--unoriented is for point clouds; leave it out for a volume",
        ));
    }
    let method = match choice.method {
        None | Some(Method::Adaptive) => VolumeMethod::Adaptive,
        Some(Method::Interpolate) => VolumeMethod::Interpolate,
        Some(Method::Gradient | Method::OffsetPairs) => {
            return Err(Failure::usage(
                "--method gradient and --method offset-pairs are for point clouds; a volume takes adaptive or interpolate",
            ));
        }
    };
    if choice.robust {
        return Err(Failure::usage(
            "--robust is for point clouds; leave it out for a volume",
        ));
    }
    refuse_band(choice)?;
    let header = &volume.header;
    let unit = stated_unit(header.unit, choice.unit)?;
    let view = VolumeView {
        dims: header.dims,
        values: &volume.values,
        world_from_voxel: header.world_from_voxel,
    };
    // Only a share of the range has to look at every voxel for it.
    let range = match choice.tolerance {
        Some(Tolerance::Percent(_)) => view.density_range()?,
        _ => 1.0,
    };
    let options = VolumeOptions {
        method,
        tolerance: choice
            .tolerance
            .map(|t| t.density(range))
            .transpose()
            .map_err(Failure::usage)?,
        coefficients: choice.coefficients.map(NonZeroUsize::get),
        max_depth: choice.max_depth.map(usize::from),
        smoothing: choice.smoothing,
    };
    let (field, mut report) = fit_volume::<T>(&view, &options, control).map_err(|e| explain(e, control))?;
    report.notes.splice(0..0, volume.notes.iter().cloned());
    if choice.tolerance.is_some() {
        let [low, high] = volume
            .values
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| {
                [low.min(f64::from(*v)), high.max(f64::from(*v))]
            });
        let magnitude = low.abs().max(high.abs());
        report.notes.extend(tolerance_doubt(
            choice,
            report.tolerance,
            "the range of the densities",
            high - low,
            magnitude,
        ));
    }
    let iso = otsu_threshold(&volume.values);
    Ok(Fitted {
        field: T::any(field),
        report,
        unit,
        source: SourceKind::Volume,
        iso,
        defects: None,
    })
}

/// Refuses a band where it would do nothing.
fn refuse_band(choice: &Choice) -> Outcome {
    match choice.band {
        Some(_) => Err(Failure::usage(
            "--band: is for meshes, whose distance is fitted round the surface; leave it out, or take the faces by --as \
             mesh",
        )),
        None => Ok(()),
    }
}

/// The unit of a file whose header says `known`, of which the user says `stated`.
fn stated_unit(known: Unit, stated: Option<Unit>) -> Outcome<Unit> {
    match (known, stated) {
        (known, None) => Ok(known),
        (Unit::Unknown, Some(stated)) => Ok(stated),
        (known, Some(stated)) if known == stated => Ok(known),
        (known, Some(stated)) => Err(Failure::usage(format!(
            "--unit {stated}: the file says that its lengths are in {known}; leave the option out"
        ))),
    }
}

impl Fitted {
    /// The fit's part of a summary.
    pub fn summary(&self, input: &Input) -> Summary {
        let r = &self.report;
        let over = |l: &&fitting::Leaf| l.is_above(r.tolerance);
        // An interpolating fit aims at none.
        let has_tolerance = r.tolerance > 0.0;
        Summary {
            input_count: Some(r.input_count),
            used_count: Some(r.used_count),
            unit: Some(match input {
                Input::Cloud(_) | Input::Mesh(_) => self.unit.to_string(),
                Input::Volume(_) => "density".into(),
            }),
            coefficients: Some(either!(&self.field, f => f.coefficient_count())),
            totals_bytes: Some(either!(&self.field, f => f.totals_bytes())),
            bricks: Some(either!(&self.field, f => f.brick_count())),
            depth: Some(r.depth),
            tolerance: has_tolerance.then_some(r.tolerance),
            smoothing: Some(r.smoothing),
            noise: r.noise,
            rms: Some(r.rms),
            p95: Some(r.p95),
            max: Some(r.max),
            bound: Some(r.bound),
            leaves: Some(r.leaves.len()),
            leaves_over_tolerance: has_tolerance.then(|| r.leaves.iter().filter(over).count()),
            leaves_at_edges: self.defects.is_some().then(|| {
                r.leaves
                    .iter()
                    .filter(over)
                    .filter(|l| l.reason == StopReason::Crease)
                    .count()
            }),
            leaves_without_data: has_tolerance.then(|| {
                r.leaves
                    .iter()
                    .filter(over)
                    .filter(|l| l.reason == StopReason::NoData)
                    .count()
            }),
            oriented_by: r.signs.as_ref().map(|s| s.route.name().into()),
            outliers: r.signs.as_ref().map(|s| s.outlier_count),
            unsure_signs: r.signs.as_ref().map(|s| s.unsure_count),
            leaves_of_unsure_sign: r.signs.as_ref().map(|s| s.unsure_leaves()),
            solves: r.solves.iter().map(Solve::from).collect(),
            defects: self.defects.as_ref().map(defects),
            notes: r.notes.iter().map(|n| flags::named(n)).collect(),
            ..Default::default()
        }
    }
}

/// The counts as an object.
fn defects(d: &MeshDefects) -> serde_json::Value {
    serde_json::json!({
        "components": d.components,
        "merged_vertices": d.merged_vertices,
        "boundary_edges": d.boundary_edges,
        "non_manifold_edges": d.non_manifold_edges,
        "non_orientable_edges": d.non_orientable_edges,
        "flipped_faces": d.flipped_faces,
        "inside_out": d.inside_out,
        "degenerate_faces": d.degenerate_faces,
        "duplicate_faces": d.duplicate_faces,
        "unbounding_faces": d.unbounding_faces,
        "interior_faces": d.interior_faces,
        "self_intersections": d.self_intersections,
        "intersections_sampled": d.intersections_sampled,
    })
}
