use bspline::Aabb;
use clap::ValueEnum;
use formats::meshes::TriangleMesh;
use formats::points::PointCloud;
use formats::volumes::{Volume, VolumeFormat, VolumeOptions};
use formats::{Fault, FormatError, Kind, ReadLimits, Unit};
use glam::DVec3;

use super::failure::{Failure, Outcome};
use super::quantity::Memory;
use super::source::Source;
use super::volume_choice::VolumeChoice;
use super::{ceiling, cost};

/// Something that can be fitted.
pub enum Input {
    /// Points.
    Cloud(PointCloud),
    /// Triangles.
    Mesh(TriangleMesh),
    /// Voxels.
    Volume(Volume),
}

impl Input {
    /// Bytes that it holds.
    pub fn bytes(&self) -> u64 {
        let bytes = match self {
            Self::Cloud(c) => (1 + usize::from(c.normals.is_some())) * size_of_val(&c.positions[..]),
            Self::Mesh(m) => {
                size_of_val(&m.vertices[..])
                    + size_of_val(&m.triangles[..])
                    + m.colors.as_deref().map_or(0, size_of_val)
            }
            Self::Volume(v) => size_of_val(&v.values[..]),
        };
        bytes as u64
    }
}

/// What to take a file with vertices and faces for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Shape {
    /// Its vertices, with normals that the file holds or that its faces define.
    Cloud,
    /// Its faces.
    Mesh,
}

impl Shape {
    fn name(self) -> &'static str {
        match self {
            Self::Cloud => "cloud",
            Self::Mesh => "mesh",
        }
    }
}

/// Reads something that can be fitted, of a volume what `choice` asks for, holding no more than `memory` in the whole
/// process. `shape` is the user's word for files with faces; by itself a file that can hold points alone is a cloud.
pub fn read(
    source: &Source,
    shape: Option<Shape>,
    choice: &VolumeChoice,
    unit: Option<Unit>,
    memory: Option<Memory>,
) -> Outcome<Input> {
    let limits = limits(memory);
    let part = &choice.options(unit)?;
    let kind = kind(source, choice, part)?;
    let path = source.path();
    let reading = |e| source.reading(e);
    let shape = match (kind, shape) {
        (Kind::Volume(_), None) => {
            let volume = formats::volumes::read(path, part, &limits).map_err(reading)?;
            return Ok(Input::Volume(volume));
        }
        (Kind::Volume(_), Some(shape)) => {
            return Err(Failure::usage(format!(
                "--as {}: {} is a {kind}, and only files with faces can be taken for one or the other; leave it out",
                shape.name(),
                source.name()
            )));
        }
        (Kind::Field, _) => {
            return Err(Failure::input(format!(
                "{}: is a fitted field already; give the point cloud, the mesh or the volume that it was fitted to",
                source.name()
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
pub fn kind(source: &Source, choice: &VolumeChoice, part: &VolumeOptions) -> Outcome<Kind> {
    if part.raw.is_some() {
        return Ok(Kind::Volume(VolumeFormat::Raw));
    }
    let kind = formats::detect(source.path()).map_err(|e| source.reading(e))?;
    if !matches!(kind, Kind::Volume(_)) && *part != VolumeOptions::default() {
        return Err(Failure::usage(format!(
            "{}: is a {kind}, and the options under «Reading volumes» are for volumes; leave them out",
            source.name()
        )));
    }
    choice.suits(kind)?;
    Ok(kind)
}

/// What reading may hold: the ceiling of the user less what the process holds already.
pub fn limits(memory: Option<Memory>) -> ReadLimits {
    memory
        .or_else(ceiling::limit)
        .map_or_else(ReadLimits::default, |m| ReadLimits {
            max_bytes: remaining(m),
        })
}

/// Bytes of the user's ceiling that are still free.
pub fn remaining(memory: Memory) -> u64 {
    memory.0.saturating_sub(cost::rss_bytes().unwrap_or(0))
}

/// An error of writing: a name that no format fits is wrong usage, all else a limit of the machine.
pub fn writing(e: FormatError) -> Failure {
    match &e.fault {
        Fault::UnknownKind { .. } | Fault::Directory => Failure::usage(e),
        _ => Failure::limit(e),
    }
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
