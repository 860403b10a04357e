use std::path::Path;

use bspline::Aabb;
use clap::ValueEnum;
use formats::meshes::TriangleMesh;
use formats::points::PointCloud;
use formats::volumes::{Volume, VolumeFormat, VolumeOptions};
use formats::{Fault, FormatError, Kind, ReadLimits};
use glam::DVec3;

use super::cost;
use super::failure::{Failure, Outcome};
use super::flags;
use super::quantity::{Memory, human_bytes};

/// Something that can be fitted.
pub enum Input {
    /// Points.
    Cloud(PointCloud),
    /// Triangles.
    Mesh(TriangleMesh),
    /// Voxels.
    Volume(Volume),
}

/// What to take a file with vertices and faces for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Shape {
    /// Its vertices, with normals that the file holds or that its faces define.
    Cloud,
    /// Its faces.
    Mesh,
}

/// Reads something that can be fitted, of a volume what `part` asks for, holding no more than `memory` in the whole
/// process. `shape` is the user's word for files with faces; by itself a file that can hold points alone is a cloud.
pub fn read(
    path: &Path,
    shape: Option<Shape>,
    part: &VolumeOptions,
    memory: Option<Memory>,
) -> Outcome<Input> {
    let limits = limits(memory);
    let kind = kind(path, part)?;
    let shape = match (kind, shape) {
        (Kind::Volume(_), None) => {
            let volume = formats::volumes::read(path, part, &limits).map_err(reading)?;
            return Ok(Input::Volume(volume));
        }
        (Kind::Volume(_), Some(_)) => {
            return Err(Failure::usage(format!(
                "{}: is a {kind}, and --as is for files with faces; leave it out",
                path.display()
            )));
        }
        (Kind::Field, _) => {
            return Err(Failure::input(format!(
                "{}: is a fitted field, where a point cloud, a mesh or a volume is needed",
                path.display()
            )));
        }
        (Kind::Mesh(_), shape) => shape.unwrap_or(Shape::Mesh),
        (Kind::Cloud(_), shape) => shape.unwrap_or(Shape::Cloud),
    };
    match shape {
        Shape::Cloud => formats::points::read(path, &limits).map(Input::Cloud),
        Shape::Mesh => formats::meshes::read(path, &limits).map(Input::Mesh),
    }
    .map_err(reading)
}

/// What a file is: without a header that is the user's word.
pub fn kind(path: &Path, part: &VolumeOptions) -> Outcome<Kind> {
    if part.raw.is_some() {
        return Ok(Kind::Volume(VolumeFormat::Raw));
    }
    let kind = formats::detect(path).map_err(reading)?;
    if !matches!(kind, Kind::Volume(_)) && *part != VolumeOptions::default() {
        return Err(Failure::usage(format!(
            "{}: is a {kind}, and options under «Reading volumes» are for volumes; leave them out",
            path.display()
        )));
    }
    Ok(kind)
}

/// What reading may hold: the ceiling of the user less what the process holds already.
pub fn limits(memory: Option<Memory>) -> ReadLimits {
    memory.map_or_else(ReadLimits::default, |m| ReadLimits {
        max_bytes: remaining(m),
    })
}

/// Bytes of the user's ceiling that are still free.
pub fn remaining(memory: Memory) -> u64 {
    memory.0.saturating_sub(cost::rss_bytes().unwrap_or(0))
}

/// An error of reading: bad input, unless a limit stopped it.
pub fn reading(e: FormatError) -> Failure {
    match &e.fault {
        Fault::Limit { what, needed, .. } => Failure::limit(format!(
            "{}: {what} would need {}, more than the memory ceiling leaves; raise --memory if the file is trusted",
            e.path.display(),
            human_bytes(*needed)
        )),
        fault => match fault.choice() {
            Some(choice) => Failure::input(format!("{e} ({})", flags::of(choice))),
            None => Failure::input(e),
        },
    }
}

/// An error of writing: a name that no format fits is wrong usage, all else a limit of the machine.
pub fn writing(e: FormatError) -> Failure {
    match &e.fault {
        Fault::UnknownKind { .. } | Fault::Directory => Failure::usage(e),
        _ => Failure::limit(e),
    }
}

/// Refuses an output that cannot be written before hours of work are spent on it.
pub fn check_output(path: &Path, extensions: &[&str]) -> Outcome {
    let name = path
        .file_name()
        .map(|n| n.to_string_lossy().to_ascii_lowercase())
        .unwrap_or_default();
    let is_device = path.metadata().is_ok_and(|m| !m.is_file() && !m.is_dir());
    if path.is_dir() {
        return Err(Failure::usage(format!(
            "-o {}: is a directory; name a file in it",
            path.display()
        )));
    }
    if !is_device && !extensions.iter().any(|e| name.ends_with(&format!(".{e}"))) {
        return Err(Failure::usage(format!(
            "-o {}: the name has to end in .{}",
            path.display(),
            extensions.join(" or .")
        )));
    }
    let directory = match path.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    };
    if !directory.is_dir() {
        return Err(Failure::usage(format!(
            "-o {}: there is no directory {}; make it first",
            path.display(),
            directory.display()
        )));
    }
    Ok(())
}

/// Smallest box round `points`, which are not empty.
pub fn bounding_box(points: &[DVec3]) -> Aabb {
    let (min, max) = points
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), &p| {
            (lo.min(p), hi.max(p))
        });
    Aabb { min, max }
}
