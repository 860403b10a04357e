use std::num::NonZeroUsize;
use std::path::PathBuf;

use bspline::polygonize::{Mesh, MeshReport, PolygonizeOptions, polygonize_with};
use bspline::{Field, Frame};
use fitting::Cancel;
use formats::field::SourceKind;

use super::cost::Cost;
use super::failure::{Failure, Outcome};
use super::field::{FieldArgs, OpenField};
use super::fineness::{self, Fineness, failed, of_tolerance, watch};
use super::mesh_check::MeshQuality;
use super::mesh_output::{MESHES, MeshOutput};
use super::output::Output;
use super::progress::Bar;
use super::quantity::{Tolerance, between, finite, human_number, threads};
use super::summary::Summary;
use super::trim::{self, Sampled, drop_marked};
use super::{interrupt, set_threads};
use crate::pieces::of_narrow_parts;

/// Arguments of `isoclay mesh`.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    field: FieldArgs,
    /// Mesh to write: .ply, .stl, .obj, .glb, .gltf, .3mf or .wrl; - writes to standard output
    #[arg(short, long, value_name = "OUT")]
    pub output: PathBuf,
    /// Cells of one size, so many along the longest side of the box [default: cells as large as the surface allows]
    #[arg(long, value_name = "N", conflicts_with_all = ["tolerance", "triangles"], value_parser = between::<u32>(1, 65535))]
    resolution: Option<u32>,
    /// Distance from the surface that 95 % of the centres and sides of the triangles keep: in the field's unit, in mm, or
    /// in per cent of the solid's diagonal [default: half the tolerance of the fit, a sixteenth where that
    /// is the noise of the samples; of a mesh three eighths, or 0.45 of what 95 % of the
    /// surface keep, if that is more]
    #[arg(
        long,
        value_name = "T[mm|%]",
        conflicts_with = "triangles",
        allow_hyphen_values = true
    )]
    tolerance: Option<Tolerance>,
    /// Most triangles of the mesh
    #[arg(long, value_name = "N", value_parser = most_triangles)]
    triangles: Option<usize>,
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
    /// Tell what those mind who print the mesh or compute on it: pieces, open edges, triangles that pass through each
    /// other, smallest angles, area, volume
    #[arg(long)]
    check: bool,
    /// Threads to work with [default: all cores]
    #[arg(long, value_name = "N", value_parser = threads)]
    threads: Option<NonZeroUsize>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    written: MeshOutput,
}

fn most_triangles(s: &str) -> Result<usize, String> {
    s.parse()
        .ok()
        .filter(|n| *n >= 4)
        .ok_or_else(|| "write a whole number of triangles, 4 or more: 100000".into())
}

/// Triangles that make a user think of a smaller mesh.
const MANY: usize = 4_000_000;

/// Meshes a field file.
pub fn run(args: &Args) -> Outcome {
    let cost = Cost::start();
    let cancel = interrupt::cancel();
    let format = args.written.format.as_deref();
    let field = args.field.source(&cancel)?;
    let output = Output::check("-o", &args.output, &MESHES, format, &[&field])?;
    set_threads(args.threads)?;
    let open = args.field.load_placed(&field)?;
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
    let (mut mesh, cells) = match args.resolution {
        Some(n) => {
            let (mesh, report, frame) = mesher.on(open.frame_of_resolution(n))?;
            notes.extend(doubts(report.unconverged_vertices, report.nan_nodes));
            (mesh, Some(frame.cells))
        }
        None => {
            let fineness = match (args.tolerance, args.triangles) {
                (Some(tolerance), _) => of_tolerance(tolerance, &open)?,
                (_, Some(most)) => Fineness::Triangles(most),
                _ => Fineness::OfTheFit,
            };
            let (field, levels, iso) = (open.field(), open.level_count(), options.iso);
            let closed = !args.open;
            let made = fineness::mesh(
                &open, field, levels, iso, closed, fineness, &mut notes, &cancel, &bar,
            )?;
            notes.extend(doubts(0, made.report.nan_nodes));
            (made.mesh, None)
        }
    };
    if mesh.triangles.is_empty() {
        return Err(open.no_surface(&field, options.iso));
    }
    interrupt::check(&cancel)?;
    drop_specks(&mut mesh, &open, &mut notes);
    trim(&mut mesh, &open, args.trim, &mut notes)?;
    if args.open || args.trim.is_some() {
        crate::fans::split(&mut mesh);
    }
    // Pieces are those of what is written.
    let left_out = args.written.keep(&mut mesh, open.unit(), &mut notes)?;
    let quality = args.check.then(|| MeshQuality::of(&mesh));
    bar.show("writing", 0.99);
    let (vertices, triangles) = (mesh.positions.len(), mesh.triangles.len());
    let unit = args.written.write(mesh, open.unit(), &output, &mut notes)?;
    bar.clear();
    if args.tolerance.is_none() && triangles > MANY {
        notes.push("--triangles gives a smaller mesh".into());
    }
    Summary {
        vertices: Some(vertices),
        triangles: Some(triangles),
        quality,
        left_out,
        cells,
        unit: Some(unit.to_string()),
        field_sha256: Some(open.sha256()),
        notes,
        ..Default::default()
    }
    .with_cost(&cost)
    .print_after(&output, args.json)
}

/// Leaves out parts of the surface of a cloud that are narrower than a finest knot interval: where sheets all but touch, a mesh
/// splits off a few triangles that the field holds by a neck.
fn drop_specks(mesh: &mut Mesh, open: &OpenField, notes: &mut Vec<String>) {
    if open.source() != SourceKind::Cloud {
        return;
    }
    let width = open.lattice().spacing(open.level_count() - 1).max_element();
    let (count, narrow) = of_narrow_parts(mesh, width);
    if count > 0 {
        notes.push(format!(
            "{} left out: {} narrower than {}, the finest knot interval",
            if count == 1 {
                "1 speck".into()
            } else {
                format!("{count} specks")
            },
            if count == 1 {
                "a part of the surface"
            } else {
                "parts of the surface"
            },
            human_number(width)
        ));
        drop_marked(mesh, &narrow);
    }
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
        drop_marked(mesh, &invented);
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
fn doubts(unconverged_vertices: u64, nan_nodes: u64) -> Vec<String> {
    let mut notes = Vec::new();
    if unconverged_vertices > 0 {
        notes.push(format!(
            "{unconverged_vertices} vertices are less exact than the others"
        ));
    }
    if nan_nodes > 0 {
        notes.push(format!(
            "at {nan_nodes} nodes the field is not a number; they count as outside"
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
        let mut progress = watch(cancel, bar, 0.0, 1.0);
        let (mesh, report) =
            polygonize_with(self.field, &frame, &self.options, &mut progress).map_err(failed)?;
        Ok((mesh, report, frame))
    }
}
