use std::num::NonZeroUsize;
use std::path::PathBuf;

use fitting::mesh::MeshDistance;
use fitting::{Cancel, StopReason, UnsupportedComponent, unsupported_components};
use formats::field::SourceKind;
use formats::meshes::TriangleMesh;
use formats::points::PointCloud;
use formats::volumes::Volume;
use glam::DVec3;
use serde_json::json;

use super::cost::Cost;
use super::failure::{Failure, Outcome};
use super::field::OpenField;
use super::input::{self, Input, Shape};
use super::quantity::threads;
use super::sample::voxel_frame;
use super::source::{FIELDS, SAMPLES, Source, input_formats};
use super::staged::StagedFiles;
use super::summary::Summary;
use super::volume_choice::VolumeChoice;
use super::{interrupt, set_threads};
use crate::check::{
    AgainstMesh, ErrorStatistics, LeafAudit, LeafIndex, against_mesh, audit_leaves, project_points, viridis,
    voxel_residuals, write_boxes,
};

/// Arguments of `isoclay check`.
#[derive(clap::Args)]
pub struct Args {
    /// Field (.iclay); - reads standard input
    field: PathBuf,
    /// What it was fitted to; - reads standard input
    input: PathBuf,
    /// What to take a file with faces for [default: cloud for PLY and OBJ, mesh for files that hold nothing else]
    #[arg(long = "as", value_enum, value_name = "KIND")]
    shape: Option<Shape>,
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
struct Measured {
    /// Where samples lie; of a volume, those of the worst voxels.
    positions: Vec<DVec3>,
    /// Absolute errors, one a position.
    errors: Vec<f64>,
    statistics: ErrorStatistics,
    audit: LeafAudit,
    count: usize,
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
    let cancel = Cancel::new();
    interrupt::cancel_on_interrupt(&cancel)?;
    let report = (args.output.as_ref())
        .map(|directory| StagedFiles::new("-o", directory))
        .transpose()?;
    let field = Source::open(&args.field, None, FIELDS, &cancel)?;
    let source = Source::open(&args.input, args.format.as_deref(), SAMPLES, &cancel)?;
    let open = OpenField::load(&field)?;
    let leaves = &open.report().leaves;
    let index = LeafIndex::new(open.lattice(), leaves);
    let measured = match input::read(&source, args.shape, &args.volume, None, None)? {
        Input::Cloud(cloud) => measure_cloud(&open, &index, &cloud),
        Input::Mesh(mesh) => measure_mesh(&open, &index, &mesh)?,
        Input::Volume(volume) => measure_volume(&open, &index, &volume),
    };
    interrupt::check(&cancel)?;
    if measured.count == 0 {
        return Err(Failure::input(format!(
            "{}: there is no sample to measure at",
            source.name()
        )));
    }
    if let Some(staged) = report {
        write_report(staged, [field.name(), source.name()], &open, &index, &measured)?;
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
            "a {what} of {} cells of 1/{COMPONENT_CELLS} round {} holds no sample",
            c.cells.len(),
            c.at
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

fn measure_cloud(open: &OpenField, index: &LeafIndex, cloud: &PointCloud) -> Measured {
    // A point without a usable normal took no part in the fit; it is measured all the same.
    let spacing = open.lattice().spacing(open.level_count() - 1).min_element();
    let projected = project_points(open.field(), &cloud.positions, spacing);
    let errors: Vec<f64> = projected.iter().map(|p| p.distance).collect();
    let lattice_from_world = open.lattice().world_from_lattice.inverse();
    let samples = cloud
        .positions
        .iter()
        .map(|&p| lattice_from_world.transform_point3(p))
        .zip(errors.iter().copied());
    let audit = audit_leaves(index, samples, open.report().tolerance);
    Measured {
        statistics: ErrorStatistics::of(&mut errors.clone()),
        audit,
        count: errors.len(),
        unprojected: Some(projected.iter().filter(|p| !p.converged).count()),
        unsupported: unsupported(open, &cloud.positions),
        against_mesh: None,
        unit: open.unit().to_string(),
        positions: cloud.positions.clone(),
        errors,
    }
}

/// Points of the mesh that are measured.
const MESH_SAMPLES: usize = 100_000;

fn measure_mesh(open: &OpenField, index: &LeafIndex, mesh: &TriangleMesh) -> Outcome<Measured> {
    let (solid, _) = MeshDistance::new(&mesh.vertices, &mesh.triangles)?;
    let positions = solid.surface_samples(MESH_SAMPLES);
    let cloud = PointCloud {
        positions,
        unit: mesh.unit,
        ..Default::default()
    };
    let spacing = open.lattice().spacing(open.level_count() - 1).min_element();
    Ok(Measured {
        against_mesh: Some(against_mesh(
            open.field(),
            &solid,
            index.centers(),
            spacing,
            open.report().tolerance,
        )),
        ..measure_cloud(open, index, &cloud)
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

fn measure_volume(open: &OpenField, index: &LeafIndex, volume: &Volume) -> Measured {
    let header = &volume.header;
    let errors = voxel_residuals(open.field(), &voxel_frame(header), header.dims, &volume.values);
    let [nx, ny, _] = header.dims;
    let lattice_from_voxel = open.lattice().world_from_lattice.inverse() * header.world_from_voxel;
    let voxel = |i: usize| DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / nx / ny) as f64);
    let samples = errors
        .iter()
        .enumerate()
        .map(|(i, &e)| (lattice_from_voxel.transform_point3(voxel(i)), e));
    let audit = audit_leaves(index, samples, open.report().tolerance);
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
        unprojected: None,
        unsupported: Vec::new(),
        against_mesh: None,
        unit: "density".into(),
        audit,
        errors: worst.iter().map(|&i| errors[i].abs()).collect(),
        statistics: ErrorStatistics::of(&mut errors.clone()),
    }
}

/// Writes the two pictures and the figures.
fn write_report(
    mut staged: StagedFiles,
    [field, input]: [&str; 2],
    open: &OpenField,
    index: &LeafIndex,
    measured: &Measured,
) -> Outcome {
    let full_scale = measured.statistics.p99.max(f64::MIN_POSITIVE);
    let colors: Vec<[u8; 3]> = measured.errors.iter().map(|e| viridis(e / full_scale)).collect();
    staged.write("error.ply", |path| {
        formats::meshes::save_points(path, &measured.positions, None, Some(&colors))
    })?;

    let (report, audit) = (open.report(), &measured.audit);
    let finest = report.leaves.iter().map(|l| l.level).max().unwrap_or(0).max(1);
    let boxes = report
        .leaves
        .iter()
        .zip(&audit.rms)
        .enumerate()
        .filter_map(|(i, (leaf, &rms))| {
            let refused = rms > report.tolerance && leaf.reason == StopReason::NoData;
            let color = if refused {
                [230, 0, 0]
            } else {
                viridis(f64::from(leaf.level) / f64::from(finest))
            };
            (leaf.sample_count > 0 || refused).then(|| (index.corners(i), color))
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
