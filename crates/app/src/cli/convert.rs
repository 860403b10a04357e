use std::path::PathBuf;

use clap::ValueEnum;
use formats::meshes::MeshFormat;
use formats::points::PointCloud;
use formats::volumes::{StoreAs, Volume, VolumeOptions, VoxelType};
use formats::{Kind, Unit, meshes, points, volumes};

use super::cost::Cost;
use super::failure::{Failure, Outcome};
use super::input::{self, check_output, limits, reading, writing};
use super::progress::Bar;
use super::quantity::Memory;
use super::summary::Summary;
use super::volume_choice::VolumeChoice;

/// Arguments of `isoclay convert`.
#[derive(clap::Args)]
pub struct Args {
    /// Cloud, mesh or volume; a directory for DICOM series and stacks of TIFF
    input: PathBuf,
    /// File to write; its name tells the format
    output: PathBuf,
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
    json: bool,
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
const CLOUDS: [&str; 8] = ["ply", "xyz", "xyzn", "txt", "pcd", "las", "laz", "e57"];
/// Names that a mesh can be written under.
const MESHES: [&str; 7] = ["ply", "stl", "obj", "glb", "gltf", "3mf", "wrl"];

/// Writes a cloud, a mesh or a volume in another format.
pub fn run(args: &Args) -> Outcome {
    let cost = Cost::start();
    let part = args.volume.options(args.unit)?;
    let kind = input::kind(&args.input, &part)?;
    let bar = Bar::new();
    bar.show("reading", 0.0);
    let summary = match kind {
        Kind::Volume(_) => volume(args, &part, &bar)?,
        Kind::Cloud(_) | Kind::Mesh(_) => points_or_faces(args, &bar)?,
        Kind::Field => {
            return Err(Failure::usage(format!(
                "{}: is a fitted field; turn it into a mesh by `isoclay mesh` or into a volume by `isoclay sample`",
                args.input.display()
            )));
        }
    };
    bar.clear();
    Summary {
        output: Some(args.output.display().to_string()),
        ..summary
    }
    .with_cost(&cost)
    .print(args.json)
}

fn volume(args: &Args, part: &VolumeOptions, bar: &Bar) -> Outcome<Summary> {
    check_output(&args.output, &VOLUMES)?;
    if args.shape.is_some() {
        return Err(Failure::usage(
            "--as is for files of points and faces; leave it out for a volume",
        ));
    }
    let mut volume = volumes::read(&args.input, part, &limits(args.memory)).map_err(reading)?;
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
        &args.output,
        header.dims,
        &values,
        &header.world_from_voxel,
        header.unit,
        store,
    )
    .map_err(writing)?;
    Ok(Summary {
        input_count: Some(values.len()),
        notes,
        ..Default::default()
    })
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
    let whole = |voxel| StoreAs::Integer {
        voxel,
        slope: 1.0,
        intercept: 0.0,
    };
    match wish {
        Some(VoxelType::F32) => Ok(StoreAs::Float32),
        Some(voxel) if voxel.is_integer() && holds(voxel) => Ok(whole(voxel)),
        Some(voxel) => Err(Failure::usage(format!(
            "--store {voxel}: does not hold every density of the volume; choose a wider integer type or float32"
        ))),
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

fn points_or_faces(args: &Args, bar: &Bar) -> Outcome<Summary> {
    if args.store.is_some() {
        return Err(Failure::usage(
            "--store is the type of voxels; leave it out for points and meshes",
        ));
    }
    let mut cloud = points::read(&args.input, &limits(args.memory)).map_err(reading)?;
    let has_faces = cloud.face_count > 0;
    let as_mesh = match args.shape {
        Some(shape) => shape == Shape::Mesh,
        None => has_faces && MeshFormat::from_path(&args.output).is_ok(),
    };
    check_output(&args.output, if as_mesh { &MESHES } else { &CLOUDS })?;
    if as_mesh {
        drop(cloud);
        return mesh(args, bar);
    }
    if let Some(unit) = args.unit {
        cloud.to_mm(unit).map_err(Failure::usage)?;
    }
    bar.show("writing", 0.5);
    let notes = points::save(&args.output, &cloud).map_err(writing)?;
    let PointCloud {
        positions,
        file_count,
        notes: met,
        ..
    } = cloud;
    Ok(Summary {
        input_count: Some(file_count),
        used_count: Some(positions.len()),
        notes: met.into_iter().chain(notes).collect(),
        ..Default::default()
    })
}

fn mesh(args: &Args, bar: &Bar) -> Outcome<Summary> {
    let mut mesh = meshes::read(&args.input, &limits(args.memory)).map_err(reading)?;
    if let Some(unit) = args.unit {
        mesh.to_mm(unit).map_err(Failure::usage)?;
    }
    bar.show("writing", 0.5);
    let notes = meshes::save(&args.output, &mesh.as_mesh()).map_err(writing)?;
    Ok(Summary {
        vertices: Some(mesh.vertices.len()),
        triangles: Some(mesh.triangles.len()),
        notes: mesh.notes.iter().cloned().chain(notes).collect(),
        ..Default::default()
    })
}
