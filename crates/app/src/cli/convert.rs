use std::path::{Path, PathBuf};

use clap::ValueEnum;
use clap::builder::PossibleValuesParser;
use fitting::Cancel;
use formats::meshes::MeshFormat;
use formats::points::PointCloud;
use formats::volumes::{StoreAs, Volume, VolumeOptions, VoxelType};
use formats::{Kind, Unit, meshes, points, volumes};

use super::cost::Cost;
use super::failure::{Failure, Outcome};
use super::input::{self, limits};
use super::mesh_output::MESHES;
use super::output::Output;
use super::progress::Bar;
use super::quantity::Memory;
use super::source::{SAMPLES, Source, input_formats};
use super::store::{asked, whole};
use super::summary::Summary;
use super::volume_choice::VolumeChoice;

/// Arguments of `isoclay convert`.
#[derive(clap::Args)]
pub struct Args {
    /// Cloud, mesh or volume; a directory for DICOM series and stacks of TIFF; - reads standard input
    input: PathBuf,
    /// File to write; its name tells the format. Clouds: .ply .xyz .xyzn .txt .pcd .las .laz .e57; meshes: .ply .stl .obj
    /// .glb .gltf .3mf .wrl; volumes: .nii .nii.gz .nrrd .mha .vti; - writes to standard output
    pub output: PathBuf,
    /// Format of the input where neither its content nor its name tells it
    #[arg(long, value_name = "FORMAT", value_parser = input_formats())]
    input_format: Option<String>,
    /// Format of the output where its name does not tell it, such as stl [default for -: ply or nii]
    #[arg(long, value_name = "FORMAT", value_parser = output_formats())]
    format: Option<String>,
    /// What to take from a file of points and faces [default: a mesh, if there are faces and the output can hold
    /// them]
    #[arg(long = "as", value_enum, value_name = "WHAT")]
    shape: Option<Shape>,
    /// Unit of the coordinates, where the file does not tell; the output is in mm
    #[arg(long)]
    unit: Option<Unit>,
    /// Type of the voxels to write [default: that of the input where it holds every density, else float32]
    #[arg(long, value_name = "TYPE")]
    store: Option<VoxelType>,
    /// Memory that the process may hold, such as 2GiB
    #[arg(long, value_name = "SIZE")]
    memory: Option<Memory>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    volume: VolumeChoice,
}

/// What a file of points and faces is taken for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Shape {
    /// Points with normals.
    Cloud,
    /// Triangles.
    Mesh,
}

/// Names that a volume can be written under.
pub const VOLUMES: [&str; 5] = ["nii", "nii.gz", "nrrd", "mha", "vti"];
/// Names that a cloud can be written under.
pub const CLOUDS: [&str; 8] = ["ply", "xyz", "xyzn", "txt", "pcd", "las", "laz", "e57"];

/// All of these, each once.
fn output_formats() -> PossibleValuesParser {
    let clouds = CLOUDS.into_iter().filter(|c| !MESHES.contains(c));
    PossibleValuesParser::new(MESHES.into_iter().chain(clouds).chain(VOLUMES))
}

/// Writes a cloud, a mesh or a volume in another format.
pub fn run(args: &Args) -> Outcome {
    let cost = Cost::start();
    let part = args.volume.options(args.unit)?;
    let source = &Source::open(&args.input, args.input_format.as_deref(), SAMPLES, &Cancel::new())?;
    let kind = input::kind(source, &args.volume, &part)?;
    let bar = Bar::new();
    bar.show("reading", 0.0);
    let (summary, output) = match kind {
        Kind::Volume(_) => volume(args, source, &part, &bar)?,
        Kind::Cloud(_) | Kind::Mesh(_) => points_or_faces(args, source, &bar)?,
        Kind::Field => {
            return Err(Failure::usage(format!(
                "{}: is a fitted field; turn it into a mesh by `isoclay mesh` or into a volume by `isoclay sample`",
                source.name()
            )));
        }
    };
    bar.clear();
    summary.with_cost(&cost).print_after(&output, args.json)
}

/// The output, checked now that it is known what is written.
fn output(args: &Args, source: &Source, formats: &[&str]) -> Outcome<Output> {
    Output::check("OUTPUT", &args.output, formats, args.format.as_deref(), &[source])
}

fn volume(args: &Args, source: &Source, part: &VolumeOptions, bar: &Bar) -> Outcome<(Summary, Output)> {
    let output = output(args, source, &VOLUMES)?;
    if args.shape.is_some() {
        return Err(Failure::usage(
            "--as is for files of points and faces; leave it out for a volume",
        ));
    }
    let mut volume =
        volumes::read(source.path(), part, &limits(args.memory)).map_err(|e| source.reading(e))?;
    if let Some(unit) = args.unit.filter(|_| part.raw.is_none()) {
        volume.header.to_mm(unit).map_err(Failure::usage)?;
    }
    let store = stored_as(&volume, args.store)?;
    bar.show("writing", 0.5);
    let Volume {
        header,
        values,
        notes,
        ..
    } = volume;
    volumes::save(
        output.path(),
        header.dims,
        &values,
        &header.world_from_voxel,
        header.unit,
        store,
    )
    .map_err(|e| output.writing(e))?;
    let summary = Summary {
        input_count: Some(values.len()),
        notes,
        ..Default::default()
    };
    Ok((summary, output))
}

/// Whole densities within the range of the input's type stay in that type, all else becomes a float.
fn stored_as(volume: &Volume, wish: Option<VoxelType>) -> Outcome<StoreAs> {
    let holds = |voxel: VoxelType| {
        let (low, high) = voxel.range();
        volume
            .values
            .iter()
            .all(|v| v.fract() == 0.0 && (low..=high).contains(&f64::from(*v)))
    };
    match wish {
        Some(voxel) if voxel.is_integer() && !holds(voxel) => Err(Failure::usage(format!(
            "--store {voxel}: the volume has densities that are not whole numbers or beyond its range; take a wider \
             integer type or float32"
        ))),
        Some(voxel) => asked(voxel),
        None => {
            let candidates = [volume.header.stored, VoxelType::I16, VoxelType::I32];
            let fitting = candidates.into_iter().find(|v| v.is_integer() && holds(*v));
            match fitting {
                Some(voxel) if volume.header.stored.is_integer() => Ok(whole(voxel)),
                _ => Ok(StoreAs::Float32),
            }
        }
    }
}

fn points_or_faces(args: &Args, source: &Source, bar: &Bar) -> Outcome<(Summary, Output)> {
    if args.store.is_some() {
        return Err(Failure::usage(
            "--store is the type of voxels; leave it out for points and meshes",
        ));
    }
    let mut cloud = points::read(source.path(), &limits(args.memory)).map_err(|e| source.reading(e))?;
    let has_faces = cloud.face_count > 0;
    let as_mesh = match args.shape {
        Some(shape) => shape == Shape::Mesh,
        None => has_faces && can_be_mesh(args),
    };
    // What has faces may become a mesh under another name.
    let also = MESHES
        .iter()
        .filter(|m| !CLOUDS.contains(m) && has_faces && args.shape.is_none());
    let clouds: Vec<&str> = CLOUDS.iter().chain(also).copied().collect();
    let output = output(args, source, if as_mesh { &MESHES } else { &clouds })?;
    if as_mesh {
        drop(cloud);
        return Ok((mesh(args, source, &output, bar)?, output));
    }
    if let Some(unit) = args.unit {
        cloud.to_mm(unit).map_err(Failure::usage)?;
    }
    bar.show("writing", 0.5);
    let notes = points::save(output.path(), &cloud).map_err(|e| output.writing(e))?;
    let PointCloud {
        positions,
        file_count,
        notes: met,
        left_out_attributes: left_out,
        ..
    } = cloud;
    let left_out = (!left_out.is_empty()).then(|| {
        format!(
            "only positions and normals are converted; left out: {}",
            left_out.join(", ")
        )
    });
    let summary = Summary {
        input_count: Some(file_count),
        used_count: Some(positions.len()),
        notes: met.into_iter().chain(left_out).chain(notes).collect(),
        ..Default::default()
    };
    Ok((summary, output))
}

/// Whether the output can hold faces, as far as its format or name tells.
fn can_be_mesh(args: &Args) -> bool {
    match &args.format {
        Some(format) => MESHES.contains(&format.as_str()),
        None => args.output == Path::new("-") || MeshFormat::from_path(&args.output).is_ok(),
    }
}

fn mesh(args: &Args, source: &Source, output: &Output, bar: &Bar) -> Outcome<Summary> {
    let mut mesh = meshes::read(source.path(), &limits(args.memory)).map_err(|e| source.reading(e))?;
    if let Some(unit) = args.unit {
        mesh.to_mm(unit).map_err(Failure::usage)?;
    }
    bar.show("writing", 0.5);
    let notes = meshes::save(output.path(), &mesh.as_mesh()).map_err(|e| output.writing(e))?;
    Ok(Summary {
        vertices: Some(mesh.vertices.len()),
        triangles: Some(mesh.triangles.len()),
        notes: mesh.notes.iter().cloned().chain(notes).collect(),
        ..Default::default()
    })
}
