use std::num::NonZeroUsize;
use std::path::PathBuf;

use fitting::Control;
use formats::field::FieldMeta;

use super::cost::Cost;
use super::failure::Outcome;
use super::field;
use super::fit_choice::Choice;
use super::fitted::fit;
use super::input::{self, Shape};
use super::output::Output;
use super::progress::Bar;
use super::quantity::{Memory, threads};
use super::source::{SAMPLES, Source, input_formats};
use super::summary::Summary;
use super::volume_choice::VolumeChoice;
use super::{belongs, ceiling, coarse, interrupt, set_threads};

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
    /// A solid for a first look, as soon as it can be had: of volumes every so many voxels are read, of which 128 or more are left along
    /// each axis; of clouds no more than 30 000 points are fitted; cells are no finer than 1/64 of the box
    #[arg(long)]
    coarse: bool,
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

/// Fits a file and writes the field.
pub fn run(args: &Args) -> Outcome {
    let cost = Cost::start();
    let cancel = interrupt::cancel();
    let source = Source::open(&args.input, args.format.as_deref(), SAMPLES, &cancel)?;
    let output = Output::check("-o", &args.output, &["iclay"], None, &[&source])?;
    set_threads(args.threads)?;
    let bar = Bar::new();
    bar.show("reading", 0.0);
    let (mut volume, mut choice) = (args.volume.clone(), args.choice);
    if args.coarse {
        coarse::volume(&source, &mut volume, choice.unit)?;
    }
    let mut input = input::read(&source, args.shape, &volume, choice.unit, args.memory)?;
    if args.coarse {
        coarse::input(&mut input, &mut choice);
    }
    interrupt::check(&cancel)?;
    let mut control = Control {
        memory_limit: args
            .memory
            .or_else(ceiling::limit)
            .map(|m| m.0.saturating_sub(ceiling::PROGRAM + input.bytes())),
        ..bar.control(&cancel)
    };
    let fitted = fit(&input, &choice, &mut control)
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
