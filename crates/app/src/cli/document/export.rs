use std::path::{Path, PathBuf};

use fitting::Control;
use formats::volumes::VolumeFormat;
use formats::{Kind, PointFormat};

use super::like::Like;
use super::{chosen, edited_meta, open};
use crate::cli::cost::Cost;
use crate::cli::failure::{Failure, Outcome};
use crate::cli::output::Output;
use crate::cli::quantity::finite;
use crate::cli::source::{SAMPLES, Source};
use crate::cli::summary::Summary;
use crate::cli::volume_choice::{VolumeChoice, whole};
use crate::cli::{field, interrupt};

/// Arguments of `isoclay export`.
#[derive(clap::Args)]
pub struct Args {
    /// Document (.isoclay)
    document: PathBuf,
    /// Field to write (.iclay), for mesh, picture, sample and the others; - writes to standard output. With --like a volume
    /// (.nii, .nii.gz), a cloud in the format of the scan, or a new directory for a DICOM series
    #[arg(short, long, value_name = "OUT")]
    pub output: PathBuf,
    /// Object to write, where there are several
    #[arg(long, value_name = "NAME")]
    object: Option<String>,
    /// Scan that the object was fitted to: write it with the edits, untouched voxels as they are
    #[arg(long, value_name = "SCAN")]
    like: Option<PathBuf>,
    /// Density of what was carved [default: air, what 1 % of the voxels are below that a scanner measured]
    #[arg(long, value_name = "DENSITY", value_parser = finite, allow_negative_numbers = true, requires = "like")]
    fill: Option<f64>,
    /// DICOM: the series to write, by its number or its identifier, where there are several
    #[arg(long, value_name = "NUMBER|UID", requires = "like")]
    series: Option<String>,
    /// Which volume of a time series, of echoes or channels was fitted, counted from 0
    #[arg(long, value_name = "N", value_parser = whole::<usize>, allow_negative_numbers = true, requires = "like")]
    volume: Option<usize>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    pub json: bool,
}

/// Writes an object as it is now, in its own place: its field, in levels, or the scan that it was fitted to with its edits.
pub fn run(args: &Args) -> Outcome {
    let cost = Cost::start();
    let mut notes = Vec::new();
    if let Some(scan) = &args.like {
        return scan_with_edits(args, scan, &cost);
    }
    let output = Output::check("-o", &args.output, &["iclay"], None, &[])?;
    let document = open(&args.document, &mut notes)?;
    let state = document.state();
    let name = chosen(state, args.object.as_deref())?;
    let object = &state.objects()[name];
    let (levels, told) = object.in_levels(name, &mut Control::default())?;
    notes.extend(told);
    let sha256 = field::save_as(&output, &levels, &edited_meta(object))?;
    let summary = Summary {
        coefficients: Some(levels.coefficient_count()),
        field_sha256: Some(sha256),
        notes,
        ..Summary::default()
    };
    summary.with_cost(&cost).print_after(&output, args.json)
}

/// Writes the scan that an object was fitted to, with the object's edits.
fn scan_with_edits(args: &Args, scan: &Path, cost: &Cost) -> Outcome {
    let mut notes = Vec::new();
    let source = Source::open(scan, None, SAMPLES, &interrupt::cancel())?.under("--like");
    let mut document = open(&args.document, &mut notes)?;
    let name = chosen(document.state(), args.object.as_deref())?.to_string();
    let choice = VolumeChoice::whole(args.series.clone(), args.volume);
    // A series is written into a directory, anything else into a file.
    let kind = formats::detect(source.path()).map_err(|e| source.reading(e))?;
    let formats: &[&str] = match kind {
        Kind::Volume(VolumeFormat::Dicom) => &[],
        Kind::Volume(_) => &["nii", "nii.gz"],
        Kind::Cloud(PointFormat::Ply) => &["ply"],
        Kind::Cloud(PointFormat::Pcd) => &["pcd"],
        Kind::Cloud(PointFormat::Las) => &["las", "laz"],
        Kind::Cloud(PointFormat::Obj) => &["obj"],
        Kind::Cloud(PointFormat::E57) => &["e57"],
        Kind::Mesh(_) => {
            return Err(Failure::usage(format!(
                "{}: volumes and clouds are written back, and this is a mesh; mesh the object, or export its field",
                source.name()
            )));
        }
        _ => &["xyz", "xyzn", "txt", "csv", "asc", "pts"],
    };
    let output = match formats {
        [] => {
            refuse_file_name(&args.output)?;
            None
        }
        formats => Some(Output::check("-o", &args.output, formats, None, &[&source])?),
    };
    let like = Like {
        source: &source,
        choice: &choice,
        fill: args.fill,
    };
    let path = output.as_ref().map_or(&*args.output, |o| o.path());
    notes.extend(like.export(&mut document, &name, path)?);
    let summary = Summary {
        notes,
        ..Summary::default()
    }
    .with_cost(cost);
    match output {
        Some(output) => summary.print_after(&output, args.json),
        None => Summary {
            output: Some(args.output.display().to_string()),
            ..summary
        }
        .print(args.json),
    }
}

/// Refuses names of files for what becomes a directory.
fn refuse_file_name(output: &Path) -> Outcome {
    const FILES: [&str; 9] = ["nii", "gz", "nrrd", "nhdr", "mha", "mhd", "tif", "tiff", "dcm"];
    let ending = output.extension().unwrap_or_default().to_string_lossy();
    if !FILES.iter().any(|file| ending.eq_ignore_ascii_case(file)) {
        return Ok(());
    }
    Err(Failure::usage(format!(
        "-o {}: a DICOM series is written into a directory; leave .{ending} out of its name, and make a file of it by isoclay convert",
        output.display()
    )))
}
