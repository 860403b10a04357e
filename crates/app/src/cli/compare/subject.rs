//! What programs are compared on, in the files that they read.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use bspline::Aabb;
use fitting::Cancel;
use fitting::mesh::MeshDistance;
use formats::ReadLimits;
use glam::DVec3;
use rayon::prelude::*;

use super::super::failure::{Failure, OrFail, Outcome};
use super::super::own;
use super::super::source::{SAMPLES, Source};
use crate::check::ErrorStatistics;

/// Points of a result that are measured against the truth, and of the truth against the result.
const POINTS: usize = 100_000;

/// What an input is compared as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Points with normals; results are triangles.
    Cloud,
    /// Densities; results are splines.
    Volume,
}

/// One input.
pub struct Subject {
    /// Its file name.
    pub name: String,
    /// What it is.
    pub kind: Kind,
    /// The file that `isoclay` fits.
    pub fitted: PathBuf,
    /// The file that others read: PLY with normals, or NRRD of float32.
    pub given: PathBuf,
    /// Where results are written.
    pub directory: PathBuf,
    points: Vec<DVec3>,
    truth: Option<MeshDistance>,
    diagonal: f64,
}

impl Subject {
    /// Makes the files of an input in a directory of its own.
    pub fn prepare(input: &Path, directory: &Path, cancel: &Cancel) -> Outcome<Self> {
        fs::create_dir(directory).or_limit()?;
        let source = Source::open(input, None, SAMPLES, cancel)?;
        let kind = formats::detect(input).map_err(|e| source.reading(e))?;
        let name = input.file_name().map(|n| n.to_string_lossy().into_owned());
        let name = name.unwrap_or_else(|| input.display().to_string());
        let convert = |to: &Path, options: &[&str]| {
            let arguments = [input.as_os_str().into(), to.as_os_str().into()].into_iter();
            own::ask("convert", arguments.chain(options.iter().map(OsString::from))).map(drop)
        };
        if kind == formats::Kind::Field {
            return Err(Failure::usage(format!(
                "{}: is a fitted field; give what it was fitted to: {SAMPLES}",
                source.name()
            )));
        }
        if let formats::Kind::Volume(_) = kind {
            let given = directory.join("given.nrrd");
            convert(&given, &["--store", "float32"])?;
            return Ok(Self {
                name,
                kind: Kind::Volume,
                fitted: input.into(),
                given,
                directory: directory.into(),
                points: Vec::new(),
                truth: None,
                diagonal: 1.0,
            });
        }
        let limits = ReadLimits::default();
        // A mesh that is measured as a cloud is still the truth.
        let truth = match formats::meshes::read(input, &limits) {
            Ok(mesh) => Some(MeshDistance::new(&mesh.vertices, &mesh.triangles).or_input()?.0),
            Err(_) => None,
        };
        let given = directory.join("given.ply");
        convert(&given, &["--as", "cloud"])?;
        let cloud = formats::points::read(&given, &limits).map_err(|e| source.reading(e))?;
        if cloud.normals.is_none() {
            return Err(Failure::input(format!(
                "{}: has no normals, which the other programs need; write them by isoclay fit --unoriented and isoclay mesh",
                source.name()
            )));
        }
        let bounds = Aabb::about(cloud.positions.iter().copied());
        Ok(Self {
            name,
            kind: Kind::Cloud,
            fitted: given.clone(),
            given,
            directory: directory.into(),
            diagonal: bounds.map_or(1.0, |b| b.size().length()),
            points: spread(&cloud.positions),
            truth,
        })
    }

    /// The mesh that a program writes.
    pub fn result(&self) -> PathBuf {
        self.directory.join("result.ply")
    }

    /// Triangles of the result, exact distances to it from the points, and from points of it back to the truth; in 1e-4 of the
    /// diagonal.
    pub fn errors(&self) -> Outcome<(usize, ErrorStatistics, Option<ErrorStatistics>)> {
        let mesh = formats::meshes::read(&self.result(), &ReadLimits::default()).or_input()?;
        let (result, _) = MeshDistance::new(&mesh.vertices, &mesh.triangles).or_input()?;
        let of = |mesh: &MeshDistance, points: &[DVec3]| {
            let unit = 1e-4 * self.diagonal;
            let mut errors: Vec<f64> = points.par_iter().map(|p| mesh.distance(*p) / unit).collect();
            ErrorStatistics::of(&mut errors)
        };
        let back = (self.truth.as_ref()).map(|truth| of(truth, &result.surface_samples(POINTS)));
        Ok((mesh.triangles.len(), of(&result, &self.points), back))
    }
}

/// As many of the points as are measured, spread over all.
fn spread(points: &[DVec3]) -> Vec<DVec3> {
    let step = points.len().div_ceil(POINTS).max(1);
    points.iter().step_by(step).copied().collect()
}
