use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::path::PathBuf;

use bspline::polygonize::{Mesh, MeshReport, PolygonizeError, PolygonizeOptions, polygonize_with};
use bspline::{Field, Frame};
use fitting::Cancel;
use formats::field::SourceKind;
use glam::DVec3;
use rayon::prelude::*;

use super::cost::Cost;
use super::failure::{Failure, Outcome};
use super::field::OpenField;
use super::mesh_output::{MESHES, MeshOutput};
use super::output::Output;
use super::progress::Bar;
use super::quantity::{Tolerance, between, finite, human_number, threads};
use super::source::{FIELDS, Source};
use super::summary::Summary;
use super::trim::{self, Sampled};
use super::{ceiling, interrupt, set_threads};

/// Arguments of `isoclay mesh`.
#[derive(clap::Args)]
pub struct Args {
    /// Field (.iclay); - reads standard input
    field: PathBuf,
    /// Mesh to write: .ply, .stl, .obj, .glb, .gltf, .3mf or .wrl; - writes to standard output
    #[arg(short, long, value_name = "OUT")]
    pub output: PathBuf,
    /// Cells along the longest side of the box [default: two cells per knot interval of the finest level that a
    /// tenth of the surface lies on]
    #[arg(long, value_name = "N", conflicts_with = "tolerance", value_parser = between::<u32>(1, 65535))]
    resolution: Option<u32>,
    /// Distance from the surface that 99 % of the triangles keep at their centres: in the field's unit, in mm,
    /// or in per cent of the solid's diagonal
    #[arg(long, value_name = "T[mm|%]", allow_hyphen_values = true)]
    tolerance: Option<Tolerance>,
    /// Density of the surface [default: 0 for clouds, for volumes what the file suggests]
    #[arg(long, value_name = "V", value_parser = finite, allow_negative_numbers = true)]
    iso: Option<f64>,
    /// Leave the surface open where it meets the box, instead of closing it
    #[arg(long)]
    open: bool,
    /// Leave out what is invented: triangles farther than this from every cell with points, in the field's unit, in mm,
    /// or in per cent of the solid's diagonal [default of the distance: 4 times the mean spacing of the points]
    #[arg(long, value_name = "DISTANCE[mm|%]", num_args = 0..=1, allow_negative_numbers = true)]
    trim: Option<Option<Tolerance>>,
    /// Threads to work with [default: all cores]
    #[arg(long, value_name = "N", value_parser = threads)]
    threads: Option<NonZeroUsize>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    written: MeshOutput,
}

/// Triangles that make a user think of a smaller mesh.
const MANY: usize = 4_000_000;

/// Meshes a field file.
pub fn run(args: &Args) -> Outcome {
    let cost = Cost::start();
    let cancel = interrupt::cancel();
    let format = args.written.format.as_deref();
    let field = Source::open(&args.field, None, FIELDS, &cancel)?;
    let output = Output::check("-o", &args.output, &MESHES, format, &[&field])?;
    set_threads(args.threads)?;
    let open = OpenField::load(&field)?;
    let options = PolygonizeOptions {
        iso: open.iso_or(args.iso, &field)?,
        open: args.open,
        ..Default::default()
    };
    let bar = Bar::new();
    let mut mesher = Mesher {
        field: open.field(),
        options,
        cancel: &cancel,
        bar: &bar,
    };
    let mut notes = Vec::new();
    let (mut mesh, report, frame) = match args.tolerance {
        Some(tolerance) => mesher.within_tolerance(&open, tolerance, &mut notes)?,
        None => mesher.on(match args.resolution {
            Some(n) => open.frame_of_resolution(n),
            None => {
                let (frame, finer) = open.frame_of_surface(options.iso);
                if finer > 0 {
                    let all = frame.cells.into_iter().max().unwrap_or(1) << finer;
                    notes.push(format!(
                        "less than a tenth of the surface has finer knots than the mesh; --resolution {all} meshes them all"
                    ));
                }
                frame
            }
        })?,
    };
    if mesh.triangles.is_empty() {
        return Err(open.no_surface(&field, options.iso));
    }
    interrupt::check(&cancel)?;
    let left_out = args.written.keep(&mut mesh, open.unit(), &mut notes)?;
    trim(&mut mesh, &open, args.trim, &mut notes)?;
    bar.show("writing", 0.99);
    let (vertices, triangles) = (mesh.positions.len(), mesh.triangles.len());
    let unit = args.written.write(mesh, open.unit(), &output, &mut notes)?;
    bar.clear();
    notes.extend(doubts(&report));
    if args.resolution.is_none() && args.tolerance.is_none() && triangles > MANY {
        notes.push("--resolution or --tolerance give a smaller mesh".into());
    }
    Summary {
        vertices: Some(vertices),
        triangles: Some(triangles),
        left_out,
        cells: Some(frame.cells),
        unit: Some(unit.to_string()),
        field_sha256: Some(open.sha256()),
        notes,
        ..Default::default()
    }
    .with_cost(&cost)
    .print_after(&output, args.json)
}

/// Mean spacings of the points from the next cell with points at which the surface counts as invented.
const TRIM_SPACINGS: f64 = 4.0;

/// Tells which share of the surface of a cloud is invented, and leaves that part out if `asked`.
fn trim(
    mesh: &mut Mesh,
    open: &OpenField,
    asked: Option<Option<Tolerance>>,
    notes: &mut Vec<String>,
) -> Outcome {
    let report = open.report();
    if open.source() != SourceKind::Cloud || report.used_count == 0 {
        return match asked {
            Some(_) => Err(Failure::usage(
                "--trim needs a field that was fitted to points; leave it out",
            )),
            None => Ok(()),
        };
    }
    let distance = match asked.flatten() {
        Some(distance) => {
            let diagonal = mesh.bounding_box().map_or(0.0, |b| b.size().length());
            distance.length(diagonal, open.unit()).map_err(Failure::usage)?
        }
        None => TRIM_SPACINGS * (trim::total_area(mesh) / report.used_count as f64).sqrt(),
    };
    if distance.is_nan() || distance <= 0.0 {
        return Ok(());
    }
    let invented = Sampled::new(open.lattice(), &report.leaves, distance).invented(mesh);
    let share = trim::share(mesh, &invented);
    if share == 0.0 {
        return Ok(());
    }
    if asked.is_some() {
        trim::drop_marked(mesh, &invented);
    }
    if mesh.triangles.is_empty() {
        return Err(Failure::input(format!(
            "--trim: no part of the surface lies within {} of a cell with points; give a larger distance",
            human_number(distance)
        )));
    }
    notes.push(format!(
        "{:.1} % of the area is invented: it lies farther than {} from every cell with points{}",
        100.0 * share,
        human_number(distance),
        if asked.is_some() {
            ", and was left out"
        } else {
            " (--trim leaves it out)"
        }
    ));
    Ok(())
}

/// What the mesher met that a careful user wants to know.
fn doubts(report: &MeshReport) -> Vec<String> {
    let mut notes = Vec::new();
    if report.unconverged_vertices > 0 {
        notes.push(format!(
            "{} vertices are less exact than the others",
            report.unconverged_vertices
        ));
    }
    if report.nan_nodes > 0 {
        notes.push(format!(
            "at {} nodes the field is not a number; they count as outside",
            report.nan_nodes
        ));
    }
    notes
}

/// A field being meshed on one frame after the other.
pub struct Mesher<'a> {
    /// The field.
    pub field: &'a dyn Field,
    /// Iso-value, caps, placement.
    pub options: PolygonizeOptions,
    /// Looked at between blocks of work.
    pub cancel: &'a Cancel,
    /// Shows how far it has come.
    pub bar: &'a Bar,
}

impl Mesher<'_> {
    /// Meshes the cells of `frame`.
    pub fn on(&mut self, frame: Frame) -> Outcome<(Mesh, MeshReport, Frame)> {
        let (cancel, bar) = (self.cancel, self.bar);
        let mut is_over = false;
        let mut progress = |fraction| {
            bar.show("meshing", fraction);
            is_over = ceiling::is_exceeded();
            if cancel.is_cancelled() || is_over {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        };
        let (mesh, report) =
            polygonize_with(self.field, &frame, &self.options, &mut progress).map_err(|e| match e {
                PolygonizeError::Cancelled if is_over => Failure::limit(
                    "the mesh takes more than --memory allows; raise it, or lower --resolution",
                ),
                PolygonizeError::Cancelled => fitting::FitError::Cancelled.into(),
                PolygonizeError::TooManyBlocks { .. } | PolygonizeError::TooManyVertices { .. } => {
                    Failure::limit(format!("{e}: lower --resolution or raise --tolerance"))
                }
                PolygonizeError::Cells { .. } => Failure::usage(format!("{e}: lower --resolution")),
                _ => Failure::input(e),
            })?;
        Ok((mesh, report, frame))
    }

    /// Meshes as coarsely as the tolerance allows. The chord error of a triangle falls with the square of its
    /// size, so a trial at the default resolution tells the next one; each result is measured.
    fn within_tolerance(
        &mut self,
        open: &OpenField,
        tolerance: Tolerance,
        notes: &mut Vec<String>,
    ) -> Outcome<(Mesh, MeshReport, Frame)> {
        let mut frame = open.frame_of_subdivision(1);
        let mut best: Option<((Mesh, MeshReport, Frame), f64)> = None;
        for _ in 0..6 {
            let trial = self.on(frame)?;
            let Some(around) = trial.0.bounding_box() else {
                return Ok(trial);
            };
            let wanted = tolerance
                .length(around.size().length(), open.unit())
                .map_err(Failure::usage)?;
            let error = self.chord_error(&trial.0, &trial.2);
            let met = error <= wanted;
            let cells = trial.2.cells.into_iter().max().unwrap_or(1);
            let best_cells = best
                .as_ref()
                .map(|((_, _, f), _)| f.cells.into_iter().max().unwrap_or(1));
            // Good enough within 15 % of the coarsest that will do, or no finer than one that did.
            let settled = met && error > 0.7 * wanted;
            if met && best_cells.is_none_or(|b| cells < b) {
                best = Some((trial, error));
            }
            if settled || (!met && best.is_some()) {
                break;
            }
            // Aims at 0.85 of the tolerance; the first error is measured, the law behind the step only assumed.
            let factor = (error / (0.85 * wanted)).sqrt().clamp(0.125, 4.0);
            let next = (cells as f64 * factor).ceil().max(4.0);
            if next > 65535.0 {
                break;
            }
            frame = open.frame_of_resolution(next as u32);
        }
        let (found, error) = best.ok_or_else(|| {
            Failure::limit("the tolerance asked for needs more cells than can be meshed; raise --tolerance")
        })?;
        notes.push(format!(
            "99 % of the triangle centres lie within {} of the surface",
            human_number(error)
        ));
        Ok(found)
    }

    /// 99th percentile of the distance from triangle centres to the surface, to first order and at most half a
    /// cell. Centres on the frame's box belong to the cut and do not count.
    fn chord_error(&self, mesh: &Mesh, frame: &Frame) -> f64 {
        let cell = frame.world_from_grid.matrix3.x_axis.length();
        let grid = frame.world_from_grid.inverse();
        let end = DVec3::from_array(frame.cells.map(f64::from));
        let mut errors: Vec<f64> = (0..mesh.triangles.len())
            .into_par_iter()
            .filter_map(|t| {
                let [a, b, c] = mesh.corners(t);
                let p = (a + b + c) / 3.0;
                let q = grid.transform_point3(p);
                if q.min((end - q).abs()).min_element() < 1.0 {
                    return None;
                }
                let (f, g) = self.field.value_gradient(p);
                Some(((f - self.options.iso).abs() / g.length()).min(0.5 * cell))
            })
            .collect();
        if errors.is_empty() {
            return 0.0;
        }
        let rank = (errors.len() * 99 / 100).min(errors.len() - 1);
        *errors.select_nth_unstable_by(rank, f64::total_cmp).1
    }
}
