//! Inputs of every kind, fitted as chosen.

use std::num::NonZeroUsize;

use document::Solve;
use fitting::mesh::{MeshDefects, MeshOptions, fit_mesh};
use fitting::points::{NormalForm, PointOptions, fit_points};
use fitting::volume::{VolumeMethod, VolumeOptions, VolumeView, fit_volume, otsu_threshold, padding};
use fitting::{Control, FitError, FitReport, StopReason};
use formats::Unit;
use formats::field::{AnyField, SourceKind, Stored};
use formats::meshes::TriangleMesh;
use formats::points::PointCloud;
use formats::volumes::Volume;

use super::ceiling::explain;
use super::failure::{Failure, Outcome};
use super::field::either;
use super::fit_choice::{Choice, Method, Precision};
use super::flags;
use super::input::{Input, bounding_box};
use super::quantity::{Tolerance, human_number};
use super::summary::Summary;
use super::unoriented::Oriented;

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

/// Fits an input as chosen.
pub fn fit(input: &Input, choice: &Choice, control: &mut Control) -> Outcome<Fitted> {
    let mut fitted = fit_as(input, choice, control)?;
    // Of meshes the fit itself tells it, with the share of the surface.
    if !matches!(input, Input::Mesh(_)) {
        let notes = limits_met(&fitted.report, choice);
        fitted.report.notes.extend(notes);
    }
    Ok(fitted)
}

/// What the user's limits left undone.
fn limits_met(report: &FitReport, choice: &Choice) -> impl Iterator<Item = String> + use<> {
    // The fit itself tells of a budget that nobody asked for.
    let budget = choice
        .coefficients
        .map(|_| ("--coefficients", StopReason::Budget));
    let limits = [Some(("--memory", StopReason::Memory)), budget];
    let total = report.leaves.len();
    let counts = limits.map(|limit| {
        let (option, reason) = limit?;
        let stopped = report.stopped_by(reason);
        (stopped > 0).then_some((option, stopped))
    });
    counts.into_iter().flatten().map(move |(option, stopped)| {
        format!("{stopped} of {total} leaves are coarser than the tolerance asks for: {option} leaves no room for more")
    })
}

/// Roundings of a coefficient within the tolerance from which the errors told are those of the field too.
const ROUNDINGS: f64 = 4.0;

/// A doubt about a tolerance, on `what` of this `size` whose numbers are as large as `magnitude`.
fn tolerance_doubt(choice: &Choice, tolerance: f64, what: &str, size: f64, magnitude: f64) -> Option<String> {
    let rounding = magnitude * f64::from(f32::EPSILON) / 2.0;
    let is_rough = tolerance > 0.0 && tolerance < ROUNDINGS * rounding;
    if choice.tolerance.is_some() && tolerance >= size && size > 0.0 {
        let (t, s) = (human_number(tolerance), human_number(size));
        Some(format!(
            "--tolerance {t} is larger than {what} ({s}): the field may miss it altogether"
        ))
    } else if is_rough && choice.precision == Precision::F32 {
        Some(format!(
            "32-bit coefficients as large as {} are rounded by up to {}, and the tolerance is {}: the field is farther off \
             than told; use --precision f64",
            human_number(magnitude),
            human_number(rounding),
            human_number(tolerance),
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
    let points = oriented.points();
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
        values: (&volume.values).into(),
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
    let range = [f64::INFINITY, f64::NEG_INFINITY];
    let densities = volume.values.iter().map(|v| f64::from(*v));
    let [low, high] = densities.fold(range, |[low, high], v| [low.min(v), high.max(v)]);
    let (size, magnitude) = (high - low, low.abs().max(high.abs()));
    let doubt = tolerance_doubt(
        choice,
        report.tolerance,
        "the range of the densities",
        size,
        magnitude,
    );
    report.notes.extend(doubt);
    let iso = otsu_threshold(&volume.values);
    if iso.is_none() {
        report
            .notes
            .push("all voxels measured have one density: the field has no surface of its own".into());
    }
    if let Some(value) = padding(&volume.values) {
        report.notes.push(format!(
            "the voxels of density {} were not measured, and do not count where the surface is looked for",
            human_number(value)
        ));
    }
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
