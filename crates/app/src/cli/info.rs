use std::io::{self, Write};
use std::path::PathBuf;

use fitting::Cancel;
use formats::Kind;
use formats::field::AnyField;
use formats::points::{NormalSource, PointCloud};
use formats::volumes::{VolumeHeader, VolumeOptions};
use serde_json::{Map, Value, json};

use super::failure::{OrFail, Outcome};
use super::field::{OpenField, either};
use super::input::{self, bounding_box, limits};
use super::quantity::{Memory, human_bytes, human_count, human_number};
use super::source::{ANYTHING, Source, input_formats};
use super::summary::table;
use super::volume_choice::VolumeChoice;

/// Arguments of `isoclay info`.
#[derive(clap::Args)]
pub struct Args {
    /// Cloud, mesh, volume or field; - reads standard input
    file: PathBuf,
    /// Format of the file where neither its content nor its name tells it
    #[arg(long, value_name = "FORMAT", value_parser = input_formats())]
    format: Option<String>,
    /// Of a volume only what its header tells, without a look at the voxels
    #[arg(long)]
    header: bool,
    /// Memory that the process may hold, such as 2GiB
    #[arg(long, value_name = "SIZE")]
    memory: Option<Memory>,
    /// Object of a document: tell what its field is like
    #[arg(long, value_name = "NAME")]
    object: Option<String>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    volume: VolumeChoice,
}

/// One line of the table and one entry of the object.
struct Entry {
    key: &'static str,
    label: &'static str,
    text: String,
    value: Value,
}

fn entry(key: &'static str, label: &'static str, text: impl Into<String>, value: impl Into<Value>) -> Entry {
    Entry {
        key,
        label,
        text: text.into(),
        value: value.into(),
    }
}

fn count(key: &'static str, label: &'static str, n: usize) -> Entry {
    entry(key, label, human_count(n), n)
}

/// Describes a file.
pub fn run(args: &Args) -> Outcome {
    let part = args.volume.options(None)?;
    let source = Source::open(&args.file, args.format.as_deref(), ANYTHING, &Cancel::new())?;
    let is_document = document::is_document(source.path());
    if is_document && args.object.is_none() {
        return super::document::info::run(&source, args.json);
    }
    if is_document || args.object.is_some() {
        let open = OpenField::load_object(&source, args.object.as_deref())?;
        return print(
            args,
            &source,
            "object",
            of_field(&open),
            open.report().notes.clone(),
        );
    }
    let kind = input::kind(&source, &args.volume, &part)?;
    let (entries, notes) = match kind {
        Kind::Cloud(_) | Kind::Mesh(_) => {
            let cloud =
                formats::points::read(source.path(), &limits(args.memory)).map_err(|e| source.reading(e))?;
            (of_cloud(&cloud), cloud.notes)
        }
        Kind::Volume(_) => of_volume(&source, args, &part)?,
        Kind::Field => {
            let open = OpenField::load(&source)?;
            (of_field(&open), open.report().notes.clone())
        }
    };
    print(args, &source, &kind.to_string(), entries, notes)
}

fn print(args: &Args, source: &Source, kind: &str, entries: Vec<Entry>, notes: Vec<String>) -> Outcome {
    let mut out = io::stdout().lock();
    if args.json {
        let mut object = Map::new();
        object.insert("file".into(), source.name().into());
        object.insert("kind".into(), kind.into());
        object.extend(entries.into_iter().map(|e| (e.key.to_string(), e.value)));
        object.insert("notes".into(), notes.into());
        writeln!(out, "{}", Value::Object(object)).or_limit()
    } else {
        let first = [("kind", kind.to_string())];
        let rows = first
            .into_iter()
            .chain(entries.into_iter().map(|e| (e.label, e.text)));
        writeln!(out, "{}", table(rows, &notes)).or_limit()
    }
}

fn corners(b: &bspline::Aabb) -> Entry {
    let text = |p: glam::DVec3| p.to_array().map(human_number).join(", ");
    entry(
        "box",
        "box",
        format!("({}) to ({})", text(b.min), text(b.max)),
        json!([b.min.to_array(), b.max.to_array()]),
    )
}

fn of_cloud(cloud: &PointCloud) -> Vec<Entry> {
    let normals = match cloud.normal_source {
        NormalSource::None => "none",
        NormalSource::Stored => "stored",
        NormalSource::Faces => "from faces",
    };
    let mut entries = vec![
        count("points", "points", cloud.positions.len()),
        count("points_in_file", "points in the file", cloud.file_count),
        count("faces", "faces", cloud.face_count),
        count(
            "unused_vertices",
            "vertices without a face",
            cloud.unused_vertices,
        ),
        entry("normals", "normals", normals, normals),
        count("zero_normals", "unusable normals", cloud.zero_normals),
        entry("unit", "unit", cloud.unit.symbol(), cloud.unit.symbol()),
    ];
    if !cloud.positions.is_empty() {
        let b = bounding_box(&cloud.positions);
        entries.push(corners(&b));
        let diagonal = b.size().length();
        entries.push(entry("diagonal", "diagonal", human_number(diagonal), diagonal));
    }
    entries
}

fn of_header(h: &VolumeHeader) -> Vec<Entry> {
    let rows: Vec<[f64; 4]> = (0..3)
        .map(|r| {
            let m = h.world_from_voxel;
            [
                m.matrix3.x_axis[r],
                m.matrix3.y_axis[r],
                m.matrix3.z_axis[r],
                m.translation[r],
            ]
        })
        .collect();
    vec![
        entry(
            "dims",
            "voxels",
            h.dims.map(|n| n.to_string()).join(" × "),
            json!(h.dims),
        ),
        entry(
            "spacing",
            "spacing",
            format!(
                "{} {}",
                h.spacing().to_array().map(human_number).join(" × "),
                h.unit
            ),
            json!(h.spacing().to_array()),
        ),
        entry("unit", "unit", h.unit.symbol(), h.unit.symbol()),
        entry("stored", "stored as", h.stored.to_string(), h.stored.to_string()),
        entry(
            "world_from_voxel",
            "world from voxel",
            rows.iter()
                .map(|r| format!("[{}]", r.map(human_number).join(", ")))
                .collect::<Vec<_>>()
                .join(" "),
            json!(rows),
        ),
    ]
}

/// The header, then the values in one pass that holds a slice at a time.
fn of_volume(source: &Source, args: &Args, part: &VolumeOptions) -> Outcome<(Vec<Entry>, Vec<String>)> {
    let preview = formats::volumes::peek(source.path(), part).map_err(|e| source.reading(e))?;
    let mut entries = of_header(&preview.header);
    if preview.file_dims != preview.header.dims {
        entries.insert(
            0,
            entry(
                "file_dims",
                "voxels in the file",
                preview.file_dims.map(|n| n.to_string()).join(" × "),
                json!(preview.file_dims),
            ),
        );
    }
    entries.push(entry(
        "read_bytes",
        "memory to read it",
        human_bytes(preview.read_bytes),
        preview.read_bytes,
    ));
    if !args.header {
        let range = formats::volumes::range(source.path(), part, &limits(args.memory))
            .map_err(|e| source.reading(e))?;
        let ends = [range.min, range.max].map(f64::from);
        entries.push(entry(
            "range",
            "smallest, largest value",
            ends.map(human_number).join(", "),
            json!(ends),
        ));
        entries.push(count(
            "not_finite",
            "voxels NaN or infinite",
            range.replaced_count,
        ));
    }
    Ok((entries, preview.notes))
}

/// What a field is made of.
fn made_of(open: &OpenField) -> Vec<Entry> {
    let coefficients = count("coefficients", "coefficients", open.coefficient_count());
    let Ok(field) = open.levels() else {
        let shape = open.knots().map(|spline| spline.shape()).unwrap_or_default();
        let each = shape.map(|n| n.to_string()).join(" × ");
        return vec![
            entry("knots", "on knots of its own", each, json!(shape)),
            coefficients,
        ];
    };
    let lattice = open.lattice();
    let spacing = lattice.spacing(open.level_count() - 1);
    let per_level = either!(field, f => f.coefficient_counts());
    let totals = either!(field, f => f.totals_bytes());
    vec![
        count("levels", "levels", open.level_count()),
        entry(
            "cells",
            "cells of the coarsest",
            lattice.cells.map(|n| n.to_string()).join(" × "),
            json!(lattice.cells),
        ),
        entry(
            "finest_spacing",
            "finest knot spacing",
            format!(
                "{} {}",
                spacing.to_array().map(human_number).join(" × "),
                open.unit()
            ),
            json!(spacing.to_array()),
        ),
        coefficients,
        entry(
            "coefficients_per_level",
            "  on each level",
            per_level
                .iter()
                .map(|n| human_count(*n))
                .collect::<Vec<_>>()
                .join(", "),
            json!(per_level),
        ),
        count("bricks", "bricks", either!(field, f => f.brick_count())),
        entry("totals_bytes", "totals", human_bytes(totals as u64), totals),
    ]
}

fn of_field(open: &OpenField) -> Vec<Entry> {
    let (lattice, report) = (open.lattice(), open.report());
    let mut entries = vec![entry(
        "precision",
        "precision",
        open.precision(),
        open.precision(),
    )];
    entries.extend(made_of(open));
    entries.extend([
        corners(&lattice.world_box()),
        entry("unit", "unit", open.unit().symbol(), open.unit().symbol()),
        entry(
            "iso",
            "iso-value",
            open.iso().map_or("none".into(), human_number),
            open.iso(),
        ),
        count("input_count", "samples given", report.input_count),
        count("used_count", "samples used", report.used_count),
        entry(
            "tolerance",
            "tolerance",
            human_number(report.tolerance),
            report.tolerance,
        ),
        entry("rms", "error rms", human_number(report.rms), report.rms),
        entry("p95", "error p95", human_number(report.p95), report.p95),
        entry("max", "error max", human_number(report.max), report.max),
        entry(
            "bound",
            "bound on |residual|",
            human_number(report.bound),
            report.bound,
        ),
        count("leaves", "leaves", report.leaves.len()),
    ]);
    // An interpolating fit aims at none.
    if report.tolerance > 0.0 {
        let above = report.leaves.iter().filter(|l| l.is_above(report.tolerance));
        entries.push(count("leaves_over_tolerance", "  over tolerance", above.count()));
    }
    entries.push(entry(
        "field_sha256",
        "field sha256",
        open.sha256(),
        open.sha256(),
    ));
    entries
}
