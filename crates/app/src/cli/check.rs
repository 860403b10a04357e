use std::num::NonZeroUsize;
use std::path::PathBuf;

use fitting::mesh::{MeshDistance, measure_mesh};
use fitting::points::measure_points;
use fitting::volume::VolumeView;
use fitting::{LeafIndex, StopReason, UnsupportedComponent, unsupported_components};
use formats::field::{AnyField, SourceKind};
use formats::meshes::TriangleMesh;
use formats::volumes::Volume;
use glam::DVec3;
use serde_json::json;

use super::cost::Cost;
use super::failure::{Failure, Outcome};
use super::field::{FieldArgs, OpenField, either};
use super::input::{self, Input, Shape};
use super::quantity::{human_number, threads};
use super::sample::voxel_frame;
use super::source::{SAMPLES, Source, input_formats};
use super::staged::StagedFiles;
use super::summary::Summary;
use super::volume_choice::VolumeChoice;
use super::{belongs, interrupt, set_threads};
use crate::check::{
    AgainstMesh, ErrorStatistics, LeafAudit, against_mesh, audit_leaves, centers, corners, viridis,
    voxel_residuals, write_boxes,
};

/// Arguments of `isoclay check`.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    field: FieldArgs,
    /// What it was fitted to; - reads standard input
    input: PathBuf,
    /// What to take a file with faces for [default: cloud for PLY and OBJ, mesh for files that hold nothing else]
    #[arg(long = "as", value_enum, value_name = "KIND")]
    shape: Option<Shape>,
    /// Measure also what the field was not fitted to
    #[arg(long)]
    anyway: bool,
    /// Format of the input where neither its content nor its name tells it
    #[arg(long, value_name = "FORMAT", value_parser = input_formats())]
    format: Option<String>,
    /// Directory for error.ply, octree.ply and report.json; made if missing
    #[arg(short, long, value_name = "REPORT_DIR")]
    output: Option<PathBuf>,
    /// Threads to work with [default: all cores]
    #[arg(long, value_name = "N", value_parser = threads)]
    threads: Option<NonZeroUsize>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    volume: VolumeChoice,
}

/// Samples with their errors, and what their leaves make of them.
#[derive(Default)]
struct Measured {
    /// Where samples lie; of a volume, those of the worst voxels.
    positions: Vec<DVec3>,
    /// Absolute errors, one a position.
    errors: Vec<f64>,
    statistics: ErrorStatistics,
    audit: LeafAudit,
    /// Samples given, and those that count.
    count: usize,
    used: usize,
    /// Sound bound on all errors, where one was measured.
    bound: Option<f64>,
    unprojected: Option<usize>,
    /// Pieces of the solid or of its complement without a sample, larger than a cell.
    unsupported: Vec<UnsupportedComponent>,
    /// Against a mesh: the way back and the sign.
    against_mesh: Option<AgainstMesh>,
    unit: String,
}

/// Measures the errors again.
pub fn run(args: &Args) -> Outcome {
    let cost = Cost::start();
    set_threads(args.threads)?;
    let cancel = interrupt::cancel();
    let report = (args.output.as_ref())
        .map(|directory| StagedFiles::new("-o", directory))
        .transpose()?;
    let field = args.field.source(&cancel)?;
    let source = Source::open(&args.input, args.format.as_deref(), SAMPLES, &cancel)?;
    let open = args.field.load(&field)?;
    let leaves = &open.report().leaves;
    let input = input::read(&source, args.shape, &args.volume, None, None)?;
    let own = belongs::check(&open, field.name(), &input, source.name());
    let is_own = own.is_ok();
    if !args.anyway {
        own?;
    }
    let measured = match &input {
        Input::Cloud(cloud) => {
            let left_out = if is_own { &open.report().left_out[..] } else { &[] };
            measure_cloud(&open, &cloud.positions, left_out)?
        }
        Input::Mesh(mesh) => measure_triangles(&open, mesh)?,
        Input::Volume(volume) => measure_volume(&open, volume, args.output.is_some())?,
    };
    interrupt::check(&cancel)?;
    if measured.count == 0 {
        return Err(Failure::input(format!(
            "{}: there is no sample to measure at",
            source.name()
        )));
    }
    if let Some(staged) = report {
        write_report(staged, [field.name(), source.name()], &open, &measured)?;
    }
    let (s, audit) = (&measured.statistics, &measured.audit);
    // An interpolating fit aims at none.
    let has_tolerance = open.report().tolerance > 0.0;
    let mut notes = Vec::new();
    if has_tolerance && audit.claimed_below > 0 {
        notes.push(format!(
            "{} leaves are above the tolerance although the fit calls them below",
            audit.claimed_below
        ));
    }
    let invented = leaves.iter().filter(|l| l.sample_count == 0).count();
    if invented > 0 && open.source() == SourceKind::Cloud {
        notes.push(format!(
            "{invented} leaves hold surface, but no sample: it is invented there (isoclay mesh tells its area)"
        ));
    }
    notes.extend(measured.unsupported.iter().map(|c| {
        let what = if c.is_inside {
            "piece of the solid"
        } else {
            "cavity"
        };
        format!(
            "a {what} of {} cells (of {COMPONENT_CELLS} along the box) around ({}) holds no sample",
            c.cells.len(),
            c.at.to_array().map(human_number).join(", ")
        )
    }));
    Summary {
        input_count: Some(measured.count),
        unit: Some(measured.unit.clone()),
        coefficients: Some(open.coefficient_count()),
        depth: Some(open.report().depth),
        tolerance: has_tolerance.then_some(open.report().tolerance),
        rms: Some(s.rms),
        p95: Some(s.p95),
        max: Some(s.max),
        used_count: Some(measured.used),
        bound: measured.bound,
        unprojected: measured.unprojected,
        back_p95: measured.against_mesh.as_ref().map(|m| m.back.p95),
        back_max: measured.against_mesh.as_ref().map(|m| m.back.max),
        wrong_signs: measured.against_mesh.as_ref().map(|m| m.wrong_signs),
        unsupported_components: Some(measured.unsupported.len()).filter(|_| measured.unprojected.is_some()),
        leaves: Some(audit.leaves),
        leaves_over_tolerance: has_tolerance.then_some(audit.over_tolerance),
        leaves_without_data: has_tolerance.then_some(audit.without_data),
        field_sha256: Some(open.sha256()),
        output: args.output.as_ref().map(|d| d.display().to_string()),
        notes,
        ..Default::default()
    }
    .with_cost(&cost)
    .print(args.json)
}

/// Measures all points but those `left_out`, which no figure of the fit counts either.
fn measure_cloud(open: &OpenField, positions: &[DVec3], left_out: &[u32]) -> Outcome<Measured> {
    let leaves = &open.report().leaves;
    let index = LeafIndex::new(open.lattice(), leaves);
    let mut counts = vec![true; positions.len()];
    for &i in left_out {
        if let Some(slot) = counts.get_mut(i as usize) {
            *slot = false;
        }
    }
    let in_leaf = |i: usize| index.find(positions[i]);
    let errors =
        either!(open.levels()?, f => measure_points(f, positions, |i| counts[i], in_leaf, leaves.len()));
    let of_leaves = errors.leaves.iter().map(|l| (l.count, l.rms));
    let audit = audit_leaves(leaves, of_leaves, open.report().tolerance);
    let counted = (0..positions.len()).filter(|&i| counts[i]);
    let (positions, distances): (Vec<DVec3>, Vec<f64>) =
        counted.map(|i| (positions[i], errors.distances[i])).unzip();
    Ok(Measured {
        statistics: ErrorStatistics {
            rms: errors.rms,
            p95: errors.p95,
            max: errors.max,
            ..ErrorStatistics::of(&mut distances.clone())
        },
        audit,
        count: counts.len(),
        used: errors.count,
        bound: Some(errors.bound),
        unprojected: Some(errors.unprojected),
        unsupported: unsupported(open, &positions),
        against_mesh: None,
        unit: open.unit().to_string(),
        positions,
        errors: distances,
    })
}

/// Measures as the fit did, and also the way back and the sign.
fn measure_triangles(open: &OpenField, mesh: &TriangleMesh) -> Outcome<Measured> {
    let (solid, _) = MeshDistance::new(&mesh.vertices, &mesh.triangles)?;
    let spacing = open.lattice().spacing(open.level_count() - 1).min_element();
    let report = open.report();
    let found = either!(open.levels()?, f => measure_mesh(f, &solid, &report.leaves));
    let errors = found.errors;
    let of_leaves = errors.leaves.iter().map(|l| (l.count, l.rms));
    Ok(Measured {
        statistics: ErrorStatistics {
            rms: errors.rms,
            p95: errors.p95,
            max: errors.max,
            ..ErrorStatistics::of(&mut errors.distances.clone())
        },
        audit: audit_leaves(&report.leaves, of_leaves, report.tolerance),
        count: mesh.triangles.len(),
        used: mesh.triangles.len(),
        bound: Some(errors.bound),
        unprojected: Some(errors.unprojected),
        unsupported: unsupported(open, &found.samples),
        against_mesh: Some(against_mesh(
            open.field(),
            &solid,
            centers(open.lattice(), &report.leaves),
            spacing,
            report.tolerance,
        )),
        unit: open.unit().to_string(),
        positions: found.samples,
        errors: errors.distances,
    })
}

/// Cells along the longest side of the grid on which components are told apart.
const COMPONENT_CELLS: u32 = 128;

/// Components that no sample speaks for. A single cell may be a corner of the surface between two nodes.
fn unsupported(open: &OpenField, samples: &[DVec3]) -> Vec<UnsupportedComponent> {
    let frame = open.frame_of_resolution(COMPONENT_CELLS);
    // A sample on the surface speaks for both sides of it, whichever of them the centre of its cell is on.
    let half = frame.world_from_grid.matrix3.x_axis.length() * 0.5;
    let sides = samples.iter().flat_map(|&p| {
        let step = open.field().value_gradient(p).1.normalize_or_zero() * half;
        [p, p - step, p + step]
    });
    let mut components = unsupported_components(open.field(), 0.0, &frame, sides);
    components.retain(|c| c.cells.len() > 1);
    components
}

/// Voxels shown in the error map of a volume: the worst ones.
const SHOWN_VOXELS: usize = 200_000;

/// Measures as the fit did, where the field stands on the grid of the volume; otherwise, and for `pictures`, the
/// difference at each voxel.
fn measure_volume(open: &OpenField, volume: &Volume, pictures: bool) -> Outcome<Measured> {
    let header = &volume.header;
    let view = VolumeView {
        dims: header.dims,
        values: (&volume.values).into(),
        world_from_voxel: header.world_from_voxel,
    };
    let own = either!(open.levels()?, f => fitting::volume::measure_volume(f, &view))?;
    let mut measured = if own.is_none() || pictures {
        measure_voxels(open, volume)
    } else {
        Measured {
            count: volume.values.len(),
            used: volume.values.len(),
            unit: "density".into(),
            ..Default::default()
        }
    };
    if let Some(own) = own {
        measured.statistics = ErrorStatistics {
            rms: own.rms,
            p95: own.p95,
            max: own.max,
            ..measured.statistics
        };
        measured.bound = Some(own.bound);
        let leaves = &open.report().leaves;
        let of_leaves = leaves
            .iter()
            .zip(own.leaf_rms)
            .map(|(l, rms)| (l.sample_count, rms));
        measured.audit = audit_leaves(leaves, of_leaves, open.report().tolerance);
    }
    Ok(measured)
}

fn measure_voxels(open: &OpenField, volume: &Volume) -> Measured {
    let header = &volume.header;
    let errors = voxel_residuals(open.field(), &voxel_frame(header), header.dims, &volume.values);
    let [nx, ny, _] = header.dims;
    let lattice_from_voxel = open.lattice().world_from_lattice.inverse() * header.world_from_voxel;
    let voxel = |i: usize| DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / nx / ny) as f64);
    let leaves = &open.report().leaves;
    let index = LeafIndex::new(open.lattice(), leaves);
    let mut sums = vec![(0u32, 0.0f64); leaves.len()];
    for (i, error) in errors.iter().enumerate() {
        if let Some(leaf) = index.find_on_lattice(lattice_from_voxel.transform_point3(voxel(i))) {
            sums[leaf].0 += 1;
            sums[leaf].1 += error * error;
        }
    }
    let of_leaves = sums
        .iter()
        .map(|&(n, sum)| (n, (sum / f64::from(n.max(1))).sqrt()));
    let audit = audit_leaves(leaves, of_leaves, open.report().tolerance);
    let mut worst: Vec<usize> = (0..errors.len()).collect();
    let kept = SHOWN_VOXELS.min(worst.len());
    if kept < worst.len() {
        worst.select_nth_unstable_by(kept, |&a, &b| {
            errors[b].abs().total_cmp(&errors[a].abs()).then(a.cmp(&b))
        });
        worst.truncate(kept);
    }
    Measured {
        positions: worst
            .iter()
            .map(|&i| header.world_from_voxel.transform_point3(voxel(i)))
            .collect(),
        count: errors.len(),
        used: errors.len(),
        unit: "density".into(),
        audit,
        errors: worst.iter().map(|&i| errors[i].abs()).collect(),
        statistics: ErrorStatistics::of(&mut errors.clone()),
        ..Default::default()
    }
}

/// Writes the two pictures and the figures.
fn write_report(
    mut staged: StagedFiles,
    [field, input]: [&str; 2],
    open: &OpenField,
    measured: &Measured,
) -> Outcome {
    let full_scale = measured.statistics.p99.max(f64::MIN_POSITIVE);
    let colors: Vec<[u8; 3]> = measured.errors.iter().map(|e| viridis(e / full_scale)).collect();
    staged.write("error.ply", |path| {
        formats::meshes::save_points(path, &measured.positions, None, Some(&colors))
    })?;

    let (report, audit) = (open.report(), &measured.audit);
    let finest = report.leaves.iter().map(|l| l.level).max().unwrap_or(0).max(1);
    let boxes = report.leaves.iter().zip(&audit.rms).filter_map(|(leaf, &rms)| {
        let refused = rms > report.tolerance && leaf.reason == StopReason::NoData;
        let color = if refused {
            [230, 0, 0]
        } else {
            viridis(f64::from(leaf.level) / f64::from(finest))
        };
        (leaf.sample_count > 0 || refused).then(|| (corners(open.lattice(), leaf), color))
    });
    staged.write("octree.ply", |path| write_boxes(path, boxes))?;

    let text = json!({
        "field": field,
        "field_sha256": open.sha256(),
        "input": input,
        "samples": measured.count,
        "unit": measured.unit,
        "tolerance": report.tolerance,
        "errors": measured.statistics,
        "unprojected": measured.unprojected,
        "against_mesh": measured.against_mesh,
        "stated_by_the_fit": { "rms": report.rms, "p95": report.p95, "max": report.max, "bound": report.bound },
        "leaves": audit,
        "components_without_samples": measured.unsupported.iter().map(|c| json!({
            "inside": c.is_inside, "cells": c.cells.len(), "at": c.at.to_array(),
        })).collect::<Vec<_>>(),
        "error_ply": { "points": measured.positions.len(), "violet": 0.0, "yellow": full_scale },
        "octree_ply": { "boxes": "edges of the leaves with samples, violet coarse to yellow fine; red: above the \
                                  tolerance and not split for lack of data" },
    });
    staged.write_text("report.json", &format!("{text:#}\n"))?;
    staged.publish()?;
    Ok(())
}
